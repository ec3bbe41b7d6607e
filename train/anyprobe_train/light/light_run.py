"""The run of the light network: its settings, its optimizer, and a step of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from anyprobe_train.light.light_losses import LIGHT_WEIGHTS, LightLoss, total_of
from anyprobe_train.light.network import LeanNet, LightInputs
from anyprobe_train.light.pictured import LightTruth, learned, tensors_of
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.train.checkpoint import load_weights, read_checkpoint
from anyprobe_train.train.loop import learn
from anyprobe_train.train.muon import MuonAndAdam

SAYING = ("head.", "posture.", "of_light.2.", "of_photo.2.", "features.", "shape.head.")
"""Layers that say the answer."""

Batches = Callable[[int], Iterator[Any]]
"""From the first step on: the batches of its and of the following steps, as the world makes them."""
Scored = Callable[[LeanNet], dict[str, float]]


@dataclass(frozen=True, kw_only=True, slots=True)
class LightRunConfig:
    """A run's settings.

    name: of the run's folder. The learning rates, AdamW's and for matrices Muon's, rise over warmup steps and fall over
    the last cooldown share.
    averaged: decay of the running mean of the weights, which is what is scored and exported. seed, with the step's
    number, decides everything that is drawn.
    """

    name: str = "light"
    steps: int = 120_000
    batch: int = 32
    learning_rate: float = 1e-3
    matrix_rate: float = 3e-3
    weight_decay: float = 1e-2
    warmup: int = 400
    cooldown: float = 0.5
    averaged: float = 0.999
    most_gradient: float = 1.0
    seed: int = 7


def run_light(
    config: LightRunConfig,
    *,
    batches: Batches,
    runs: Path,
    assets: str,
    device: str = "cpu",
    last: int | None = None,
    scored: Scored | None = None,
    start: Path | None = None,
) -> Path:
    """Train to config.steps by train.loop.learn, which has the other arguments; the checkpoint's path.

    assets: identity of what batches are drawn from. start: weights that `save_init_weights` kept.
    """
    torch.manual_seed(config.seed)
    torch.set_flush_denormal(True)
    net = LeanNet().to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = MuonAndAdam(net, config.learning_rate, config.matrix_rate, config.weight_decay, last=SAYING)
    losses = LightLoss(device)

    def examples(first: int, last: int) -> Iterator[tuple[LightInputs, LightTruth]]:
        for step, batch in zip(range(first, last), batches(first), strict=False):
            yield learned(*tensors_of(batch, device), (config.seed, step))

    def do_step(example: tuple[LightInputs, LightTruth], rate: float) -> tuple[dict[str, torch.Tensor], int]:
        inputs, truth = example
        with autocast(device):
            guess = net(inputs)
        terms = losses(guess, truth)
        loss = total_of(terms)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), config.most_gradient)
        optimizer.step(rate / config.learning_rate)
        return {**terms, "loss": loss}, len(truth.fov)

    return learn(
        config,
        net,
        optimizer,
        do_step,
        examples,
        runs=runs,
        columns=(*LIGHT_WEIGHTS, "loss"),
        origin={"assets": assets},
        device=device,
        last=last,
        scored=scored,
        start=start,
    )


def load_lean_net(checkpoint: Path) -> tuple[LeanNet, dict[str, Any]]:
    """Return the trained network of a checkpoint (the mean of its weights), ready to run, and its step, configuration
    and origin; ModelError if there is none, or of another release."""
    stored = read_checkpoint(checkpoint)
    net = LeanNet()
    load_weights(net, stored["net"], checkpoint)
    about = {"step": stored["step"], "origin": stored.get("origin", {}), **json.loads(stored["config"])}
    return net.eval().requires_grad_(False), about
