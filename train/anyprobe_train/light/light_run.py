"""The run of the light network: one small loop over the world's batches, one checkpoint that resumes to the bit."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch

from anyprobe_train.light.light_losses import LIGHT_WEIGHTS, LightLoss, total_of
from anyprobe_train.light.network import LeanNet, LightInputs
from anyprobe_train.light.pictured import LightTruth, learned, tensors_of
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.train.checkpoint import (
    agreed,
    keep_apart,
    load_weights,
    read_checkpoint,
    read_init_weights,
    resumed,
    save_checkpoint,
    save_weights,
)
from anyprobe_train.train.logger import RunLogger, run_folder
from anyprobe_train.train.loop import asked_to_stop, learning_rate, mean_of, move_mean
from anyprobe_train.train.muon import MuonAndAdam

SAVE_SECONDS, SCORE_SECONDS = 300.0, 1800.0
"""Seconds between two checkpoints, and between two scores of photos that are left out."""
SAYING = ("head.", "posture.", "of_light.2.", "of_photo.2.", "features.", "shape.head.")
"""Layers that say the answer."""

Batches = Callable[[int], Iterator[Any]]
"""From the first step on: the batches of its and of the following steps, as the world makes them."""
Scored = Callable[[LeanNet], dict[str, float]]
Item = TypeVar("Item")


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


def one_ahead(items: Iterator[Item]) -> Iterator[Item]:
    """Yield items, each of which a thread makes while the one before is used."""
    with ThreadPoolExecutor(1) as thread:
        coming = thread.submit(next, items, None)
        while (item := coming.result()) is not None:
            coming = thread.submit(next, items, None)
            yield item


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
    """Train to config.steps, going on from the checkpoint of runs/<config.name> when there is one; its path.

    assets: identity of what batches are drawn from. last: stop at this step, to go on later. scored: figures of photos
    that are left out, written to left_out.jsonl beside the checkpoint. start: weights of `keep_light` that a run goes
    on from, at the step that they were kept at.

    Raises:
        InputError, ModelError: of train.checkpoint.resumed and read_init_weights.
    """
    torch.manual_seed(config.seed)
    torch.set_flush_denormal(True)
    path = runs / config.name / "checkpoint.pt"
    net = LeanNet().to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = MuonAndAdam(net, config.learning_rate, config.matrix_rate, config.weight_decay, last=SAYING)
    stored, origin = resumed(path, config, {"assets": assets}, start, device)
    if stored is not None:
        origin = agreed(path, stored.get("origin", {}), origin)
    begun = 0
    if stored is None and start is not None:
        weights, pairs = read_init_weights(start)
        load_weights(net, weights, start)
        begun = (pairs or 0) // config.batch
    mean, first = mean_of(net, optimizer, stored, path)
    first = max(first, begun)
    last = config.steps if last is None else min(last, config.steps)
    if first >= last:
        return path
    losses, folder = LightLoss(device), run_folder(runs, config.name)
    logger = RunLogger(folder, config.name, (*LIGHT_WEIGHTS, "loss"), first, last, config.steps)
    saved = judged = time.monotonic()
    done = kept = first

    def keep() -> None:
        state = {"net": mean.state_dict(), "moving": net.state_dict(), "optimizer": optimizer.state_dict()}
        save_checkpoint(path, config, done, origin, state)

    def examples() -> Iterator[tuple[LightInputs, LightTruth]]:
        for step, batch in zip(range(first, last), batches(first), strict=False):
            yield learned(*tensors_of(batch, device), (config.seed, step))

    with logger, asked_to_stop() as asked:
        try:
            for step, (inputs, truth) in enumerate(one_ahead(examples()), first):
                rate = learning_rate(config, step)
                net.train()
                torch.manual_seed(config.seed + step)  # what is dropped is the step's own
                with autocast(device):
                    guess = net(inputs)
                terms = losses(guess, truth)
                loss = total_of(terms)
                optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(net.parameters(), config.most_gradient)
                optimizer.step(rate / config.learning_rate)
                move_mean(mean, net, min(config.averaged, (step + 1) / (step + 20)))
                done, count = step + 1, len(truth.fov)
                logger.note(done, done * count, count, {**terms, "loss": loss}, rate)
                is_judged = scored is not None and (time.monotonic() - judged > SCORE_SECONDS or done == config.steps)
                if is_judged or time.monotonic() - saved > SAVE_SECONDS:
                    keep()
                    kept, saved = done, time.monotonic()
                if is_judged and scored is not None:
                    with (folder / "left_out.jsonl").open("a", encoding="utf-8") as stream:
                        stream.write(json.dumps({"step": done, **scored(mean)}) + "\n")
                    judged = time.monotonic()
                if asked():
                    break
        except BrokenExecutor:
            if not asked():  # else the processes that make photos were asked to stop, too
                raise
        if done > kept:
            keep()
    return path


def keep_light(checkpoint: Path, path: Path) -> None:
    """Keep a run's weights, the mean of them, in half floats, to go on from in another run."""
    stored = read_checkpoint(checkpoint)
    keep_apart(checkpoint, path)
    save_weights(stored["net"], path, stored["step"] * json.loads(stored["config"])["batch"])


def load_lean_net(checkpoint: Path) -> tuple[LeanNet, dict[str, Any]]:
    """Return the trained network of a checkpoint (the mean of its weights), ready to run, and its step, configuration
    and origin; ModelError if there is none, or of another release."""
    stored = read_checkpoint(checkpoint)
    net = LeanNet()
    load_weights(net, stored["net"], checkpoint)
    about = {"step": stored["step"], "origin": stored.get("origin", {}), **json.loads(stored["config"])}
    return net.eval().requires_grad_(False), about
