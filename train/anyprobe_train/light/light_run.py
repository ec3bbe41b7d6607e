"""The run of the light network: what it learns from, its settings, its optimizer, and a step of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from anyprobe.errors import InputError
from anyprobe_train.light.left_out_light import left_out_scores
from anyprobe_train.light.light_losses import LIGHT_WEIGHTS, LightLoss, total_of
from anyprobe_train.light.network import LeanNet, LightInputs
from anyprobe_train.light.pictured import LightTruth, learned, tensors_of
from anyprobe_train.light.traced import SHARE, traced_photos, with_traced
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.train.loop import learn
from anyprobe_train.train.muon import MuonAndAdam
from anyprobe_train.world.batch import LightBatch, World, assets_of
from anyprobe_train.world.feed import feed

SAYING = ("head.", "posture.", "of_light.2.", "of_photo.2.", "features.", "shape.head.")
"""Layers that say the answer."""
SMALL_BATCH, FEW_VIEWS = 8, 2
"""Photos a step of a run that tests a machine, and files of views that it draws from."""

Batches = Callable[[int], Iterator[LightBatch]]
"""From the first step on: the batches of its and of the following steps, as the world makes them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightRunConfig:
    """A run's settings.

    name: of the run's folder. The learning rates, AdamW's and for matrices Muon's, rise over warmup steps and fall over
    the last cooldown share. steps: of a new run; the card of `lift` says how many batches the shipped weights took.
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


def train_light(
    data: Path | None,
    runs: Path,
    steps: int | None,
    dry_run: int | None,
    device: str,
    processes: int,
    start: Path | None,
) -> Path:
    """Train the light network; the checkpoint's path.

    dry_run: so many steps of SMALL_BATCH photos in a run of their own that begins anew. processes: how many make photos
    while this one learns. start: weights to go on from.

    Raises:
        InputError: no data, or a device that is not there.
    """
    known = ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",)
    if device not in known:
        raise InputError(f"expected one of {', '.join(known)}", subject="device", source=device)
    config, settings = LightRunConfig(), {}
    if steps is not None:
        config = replace(config, steps=steps)
    if dry_run is not None:
        config = replace(config, name="light-dry", steps=dry_run, batch=SMALL_BATCH)
        settings = {"first": FEW_VIEWS}
        (runs / config.name / "checkpoint.pt").unlink(missing_ok=True)
    cache = runs / "world"
    traced = traced_photos(runs / "traced")
    assets = assets_of(World.open(data, cache))
    assets += "" if traced is None else f", {len(traced.family)} path-traced photos"

    def batches(first: int) -> Iterator[LightBatch]:
        made = config.batch if traced is None else round((1 - SHARE) * config.batch)
        given = {"batch": made, **settings}
        photos = feed(data, cache, config.seed, workers=max(1, processes), step=first, **given)
        for step, batch in enumerate(photos, first):
            yield with_traced(batch, traced, config.batch, (config.seed, step))

    scored = None if dry_run is not None else left_out_scores(runs / "left_out", data, cache)
    return run_light(config, batches=batches, runs=runs, assets=assets, device=device, scored=scored, start=start)


def run_light(config: LightRunConfig, *, batches: Batches, device: str = "cpu", **rest: Any) -> Path:
    """Train to config.steps by train.loop.learn, which has the other arguments; the checkpoint's path.

    rest: its, such as assets, identity of what batches are drawn from, and start, weights that export --keep saved.
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

    return learn(config, net, optimizer, do_step, examples, columns=(*LIGHT_WEIGHTS, "loss"), **rest)
