"""PhotoNet's training: its own small loop over pairs that are kept, one checkpoint that resumes exactly."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch

from anyprobe_train.nets.light_net import display
from anyprobe_train.nets.whole_net import WholePrediction
from anyprobe_train.train.checkpoint import (
    agreed,
    init_weights_id,
    load_weights,
    read_checkpoint,
    read_init_weights,
    resumed,
    save_checkpoint,
)
from anyprobe_train.train.logger import RunLogger, run_folder
from anyprobe_train.train.loop import CHECKPOINT_SECONDS, learning_rate, mean_of, move_mean
from anyprobe_train.whole_network.batches import Pairs, mirrored_pairs
from anyprobe_train.whole_network.left_out_scores import score_left_out
from anyprobe_train.whole_network.object_losses import OBJECT_WEIGHTS, ObjectLoss
from anyprobe_train.whole_network.photo_net import PhotoNet
from anyprobe_train.whole_network.whole_losses import WHOLE_WEIGHTS, WholeLoss

MIRROR = "mirror"
"""Name of the loss of a mirrored photo's answer."""
MIRROR_WEIGHT = 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class WholeRunConfig:
    """A run's settings.

    name: of the run's folder. The learning rate rises over warmup steps and falls over the last cooldown share.
    averaged: decay of the running mean of the weights, which is what is exported. object_rate: learning rate of
    LightNet, in shares of the rest's; 0 leaves it as it is. given_up: share of the pairs that are told which way is
    up; panoramas: that know a part of the map in the place of the photo around the object. pairs: how many of the kept
    ones are learned from, 0 for all. scored: steps between two scores of the left-out pairs. growing: whether pairs
    that are added meanwhile are learned from too, from the next score on; such a run does not resume to the same bits.
    Half of every batch is the other half in a mirror.
    """

    name: str = "whole"
    steps: int = 2_500
    batch: int = 128
    learning_rate: float = 1e-3
    object_rate: float = 0.3
    weight_decay: float = 1e-2
    warmup: int = 100
    cooldown: float = 0.7
    averaged: float = 0.999
    given_up: float = 0.2
    panoramas: float = 0.05
    seed: int = 7
    pairs: int = 0
    scored: int = 500
    growing: bool = False


def begin_from(net: torch.nn.Module, start: Path) -> None:
    """Load the weights that the network has in common with those in start; what it has more begins at zero there.

    start: weights of PhotoNet, of its part WholeNet, or of LightNet as runs of `lift` name them.
    """
    own = net.state_dict()
    for name, value in read_init_weights(start)[0].items():
        name = f"whole.{name}" if f"whole.{name}" in own else name
        if name not in own or own[name].dim() != value.dim():
            continue
        if own[name].shape != value.shape:
            own[name].zero_()
        own[name][tuple(slice(size) for size in value.shape)] = value.to(own[name].dtype)
    net.load_state_dict(own)


class PhotoLosses:
    """All losses of PhotoNet, unweighted, by name."""

    def __init__(self, net: PhotoNet, config: WholeRunConfig, device: str) -> None:
        self.object_learns = config.object_rate > 0
        self.weights = {**WHOLE_WEIGHTS, MIRROR: MIRROR_WEIGHT, **(OBJECT_WEIGHTS if self.object_learns else {})}
        self._whole = WholeLoss(device)
        self._object = ObjectLoss(net.light, device) if self.object_learns else None

    def __call__(self, net: PhotoNet, batch: dict[str, Any], seed: int) -> dict[str, torch.Tensor]:
        """Answer a batch and compute the losses; half of it is the other half in a mirror."""
        free = slice(None)
        if self._object is not None:
            generator = torch.Generator(batch["photo"].device).manual_seed(seed)
            batch = self._object.with_hints(batch, generator)
            free = ~batch["hinted"]  # hints are drawn and may be wrong
        alone, whole = net(batch, self.object_learns)
        known = {name: batch[name][free] for name in ("truth", "context", "profiles", "colors", "up")}
        terms = self._whole(_picked(whole, free), known)
        terms[MIRROR] = self._mirror(whole)
        return terms if self._object is None else {**terms, **self._object(alone, batch)}

    def _mirror(self, whole: WholePrediction) -> torch.Tensor:
        """Compare the second half of a batch with the first, of which it is the mirror image."""
        half = len(whole.logit) // 2

        def differences(values: torch.Tensor) -> torch.Tensor:
            return (values[:half] - values[half:].flip(3)).abs()

        power = torch.softmax((whole.logit + torch.log(self._whole.angles)).flatten(1), dim=1)
        shown = differences(display(whole.ln_expected).clip(max=1.0)).mean()
        return shown + 0.25 * differences(power.view_as(whole.logit)).sum(dim=(1, 2, 3)).mean()


def _picked(guess: WholePrediction, some: Any) -> WholePrediction:
    return WholePrediction(**{one.name: getattr(guess, one.name)[some] for one in fields(WholePrediction)})


def _both_ways(batch: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return a batch and after it the same in a mirror."""
    other = mirrored_pairs(batch, torch.ones(len(batch["up"]), dtype=torch.bool, device=batch["up"].device))
    return {name: torch.cat([batch[name], other[name]]) for name in batch}


def train_whole(
    config: WholeRunConfig,
    *,
    pairs: Path,
    runs: Path,
    start: Sequence[Path] = (),
    left_out: Path | None = None,
    device: str = "cpu",
    last: int | None = None,
) -> Path:
    """Train to config.steps, going on from the checkpoint of runs/<config.name> when there is one; its path.

    Args, errors: as of train.loop.train; pairs, left_out: folders of research.scenes.pairs; start: see begin_from;
    last: stop at this step, to go on later.
    """
    torch.manual_seed(config.seed)
    path = runs / config.name / "checkpoint.pt"
    net = PhotoNet().to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(
        _groups(net, config), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
    )
    stored, origin = resumed(path, config, {}, None, device, holds="net")
    origin["start"] = " ".join(init_weights_id(one) for one in start) or None
    for one in start:
        begin_from(net, one)
    losses = PhotoLosses(net, config, device)
    if stored is not None:
        origin = agreed(path, stored.get("origin", {}), origin)
    mean, first = mean_of(net, optimizer, stored, path)
    folder = run_folder(runs, config.name)
    last = config.steps if last is None else min(last, config.steps)
    if first >= last:
        return path
    data = Pairs(pairs, config.pairs, device)
    kept = None if left_out is None else Pairs(left_out, device=device)
    origin = {**origin, "assets": data.identity} if config.growing else agreed(path, origin, {"assets": data.identity})
    logger = RunLogger(folder, config.name, (*losses.weights, "loss"), first, last, config.steps)
    saved = time.monotonic()
    with logger:
        for step in range(first, last):
            rate = learning_rate(config, step)
            for group in optimizer.param_groups:
                group["lr"] = rate * group["share"]
            rng = np.random.default_rng((config.seed, step))
            batch = _both_ways(data.batch(rng, config.batch // 2, config.given_up, config.panoramas))
            net.train()
            net.light.train(losses.object_learns)
            torch.manual_seed(step + config.seed)  # what is dropped is the step's own
            terms = losses(net, batch, step + config.seed)
            loss = sum(losses.weights[name] * value for name, value in terms.items())
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimizer.step()
            move_mean(mean, net, min(config.averaged, (step + 1) / (step + 20)))
            logger.note(step + 1, (step + 1) * config.batch, config.batch, {**terms, "loss": loss}, rate)
            if config.growing and (step + 1) % config.scored == 0:
                data = data.grown()
                origin["assets"] = data.identity
            if kept is not None and ((step + 1) % config.scored == 0 or step + 1 == config.steps):
                with (folder / "left_out.jsonl").open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps({"step": step + 1, **score_left_out(mean, kept)}) + "\n")
            if time.monotonic() - saved > CHECKPOINT_SECONDS or step + 1 == last:
                state = {"net": mean.state_dict(), "moving": net.state_dict(), "optimizer": optimizer.state_dict()}
                save_checkpoint(path, config, step + 1, origin, state)
                saved = time.monotonic()
    return path


def _groups(net: PhotoNet, config: WholeRunConfig) -> list[dict[str, Any]]:
    """Return the parameters that learn, with their shares of the learning rate."""
    groups = [{"params": list(net.whole.parameters()), "share": 1.0}]
    if config.object_rate > 0:
        return [*groups, {"params": list(net.light.parameters()), "share": config.object_rate}]
    net.light.requires_grad_(False)
    return groups


def load_photo_net(checkpoint: Path, start: Sequence[Path] = (), share: float = 0.0) -> tuple[PhotoNet, dict]:
    """Return the trained network of a checkpoint (the mean of its weights), ready to run, and its stored step,
    configuration and origin; ModelError if there is none, or of another release.

    start, share: weights that it began from, see begin_from, and how much of the result they are.
    """
    stored = read_checkpoint(checkpoint, holds="net")
    net = PhotoNet()
    load_weights(net, stored["net"], checkpoint)
    about = {"step": stored["step"], "origin": stored.get("origin", {}), **json.loads(stored["config"])}
    if start:
        first = deepcopy(net)
        for one in start:
            begin_from(first, one)
        move_mean(net, first, 1.0 - share)
        about["mean_with_start"] = share
    return net.eval().requires_grad_(False), about
