"""WholeNet's training: its own small loop over pairs that are kept, one checkpoint that resumes exactly."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import time
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.response import MEAN_CURVE
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.learning.nets.blocks import autocast
from anyprobe.learning.nets.light_net import display
from anyprobe.learning.nets.whole_net import WholeNet
from anyprobe.learning.train.checkpoint import agreed, load_weights, read_checkpoint, read_init_weights, resumed
from anyprobe.learning.train.logger import RunLogger, run_folder
from anyprobe.learning.train.loop import CHECKPOINT_SECONDS, learning_rate
from anyprobe.learning.whole_network.losses import WEIGHTS, WholeLoss
from anyprobe.learning.whole_network.score import score_pairs
from anyprobe.learning.whole_network.source_profiles import source_colors, source_profiles

LEVEL, TINT = 0.25, 0.12
"""Standard deviations of ln of the light that a pair has more of, all of it and each channel, each time it is seen."""

UNUSED = ("image", "scene")
"""Arrays of pairs that this network is not given."""
WHITE = 0.98
"""Display value from which on a pixel of a photo is clipped: less light does not make it less."""
NOISE = 0.03
"""Largest standard deviation of display values, and a third of that of ln radiance, that pairs are seen with."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WholeRunConfig:
    """A run's settings.

    name: of the run's folder. The learning rate rises over warmup steps and falls over the last cooldown share.
    averaged: decay of the running mean of the weights, which is what is exported. given_up: share of the pairs that
    are told which way is up; panoramas: that know a part of the map in the place of the photo around the object.
    pairs: how many of the kept ones are learned from, 0 for all. scored: steps between two scores of the left-out
    pairs. growing: whether pairs that are added meanwhile are learned from too, from the next score on; such a run
    does not resume to the same bits.
    """

    name: str = "whole"
    steps: int = 9_500
    batch: int = 32
    learning_rate: float = 8e-4
    weight_decay: float = 1e-3
    warmup: int = 100
    cooldown: float = 0.6
    averaged: float = 0.999
    given_up: float = 0.2
    panoramas: float = 0.05
    seed: int = 7
    pairs: int = 0
    scored: int = 500
    growing: bool = False


class Pairs:
    """Kept pairs of research.scenes.pairs in memory, 240 KB each."""

    def __init__(self, folder: Path, most: int = 0) -> None:
        """Read a folder's files in the order of their names; InputError where there are none."""
        self.folder = folder
        files = sorted(folder.glob("*.npz"))
        if not files:
            raise InputError(f"{folder}: expected pairs, found none; make them with python -m research.scenes pairs")
        self._parts, count, seen = [], 0, hashlib.sha256()
        for path in files:
            with np.load(path, allow_pickle=False) as stored:
                part = {name: stored[name] for name in stored.files if name not in UNUSED}
            part["profiles"], part["colors"] = _profiles(part["truth"])
            self._parts.append(part)
            count += len(part["up"])
            seen.update(f"{path.name} {len(part['up'])} ".encode())
            if 0 < most <= count:
                break
        self._starts = np.cumsum([0, *(len(part["up"]) for part in self._parts)])
        self.identity = f"{count} pairs {seen.hexdigest()[:8]}"
        """Which pairs these are: how many, and a digest of their files' names and lengths."""

    def __len__(self) -> int:
        return int(self._starts[-1])

    def grown(self) -> Pairs:
        """Return the pairs with files that were added to the folder meanwhile."""
        return self if len(list(self.folder.glob("*.npz"))) == len(self._parts) else Pairs(self.folder)

    def rows(self, start: int, stop: int) -> dict[str, torch.Tensor]:
        """Return pairs in order, as they are, as the network takes them."""
        stop = min(stop, len(self))
        index = np.arange(start, stop)
        parts = np.searchsorted(self._starts, index, side="right") - 1

        def of(name: str) -> torch.Tensor:
            picked = [self._parts[p][name][row - self._starts[p]] for p, row in zip(parts, index, strict=True)]
            return torch.from_numpy(np.stack(picked)).float()

        return {
            "context": (of("context") / 255).permute(0, 3, 1, 2).contiguous(memory_format=torch.channels_last),
            "tan_half": of("tan_half")[:, None],
            "lift": of("lift"),
            "said": of("posterior"),
            "surroundings": of("surroundings") / 255,
            "truth": of("truth"),
            "up": of("up"),
            "given_up": torch.zeros(len(index), 3),
            "family": of("family"),
        }

    def batch(
        self, rng: np.random.Generator, count: int, given_up: float, panoramas: float = 0.0
    ) -> dict[str, torch.Tensor]:
        """Return a random batch of the arrays of pairs.Known, as the network takes them."""
        rows = rng.integers(len(self), size=count)
        parts = np.searchsorted(self._starts, rows, side="right") - 1

        def of(name: str) -> torch.Tensor:
            picked = [self._parts[p][name][row - self._starts[p]] for p, row in zip(parts, rows, strict=True)]
            return torch.from_numpy(np.stack(picked)).float()

        context = (of("context") / 255).permute(0, 3, 1, 2).contiguous(memory_format=torch.channels_last)
        up = of("up")
        ln_gain = torch.from_numpy(rng.normal(0.0, LEVEL, (count, 1)) + rng.normal(0.0, TINT, (count, 3))).float()
        around, gain = of("surroundings") / 255, ln_gain[:, :, None, None]
        lift = of("lift")
        noise = torch.from_numpy(rng.uniform(0.0, NOISE, (count, 1, 1, 1))).float()
        generator = torch.Generator().manual_seed(int(rng.integers(2**62)))

        def noisy(values: torch.Tensor, share: float, where: torch.Tensor | float = 1.0) -> torch.Tensor:
            return values + share * noise * where * _grain(values, generator)

        def seen(picture: torch.Tensor) -> torch.Tensor:  # of the last channel's cover
            bright = _brighter(picture, gain)
            cover = bright[:, -1:]
            colors = noisy(bright[:, :3], 1.0, cover) * (cover > 0)
            return torch.cat([colors, bright[:, 3:]], dim=1).clip(0.0, 1.0)

        batch = {
            "context": seen(context),
            "tan_half": of("tan_half")[:, None],
            "lift": torch.cat([noisy(lift[:, :6] + gain.repeat(1, 2, 1, 1), 3.0), lift[:, 6:]], dim=1),
            "said": of("posterior"),
            "surroundings": seen(around),
            "truth": of("truth") + gain,
            "profiles": of("profiles"),
            "colors": of("colors"),
            "up": up,
            "given_up": up * torch.from_numpy(rng.random((count, 1)) < given_up).float(),
        }
        batch = _with_panoramas(batch, rng, panoramas)
        batch = _mirrored(batch, torch.from_numpy(rng.random(count) < 0.5))
        return {**batch, "context": batch["context"].contiguous(memory_format=torch.channels_last)}


def _mirrored(batch: dict[str, torch.Tensor], some: torch.Tensor) -> dict[str, torch.Tensor]:
    """Left and right exchanged in some [N] of a batch's pairs."""
    pictures, ways = ("context", "lift", "surroundings", "truth"), ("up", "given_up")
    flipped = {name: torch.where(some[:, None, None, None], batch[name].flip(3), batch[name]) for name in pictures}
    signs = torch.where(some[:, None], torch.tensor([-1.0, 1.0, 1.0]), torch.ones(3))
    return {**batch, **flipped, **{name: batch[name] * signs for name in ways}}


def _grain(like: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Noise of pixels and of spots of four, of the same shape."""
    spots = torch.randn((*like.shape[:2], *(side // 4 for side in like.shape[2:])), generator=generator)
    wide = F.interpolate(spots, size=like.shape[2:], mode="bilinear")
    return 0.7 * (torch.randn(like.shape, generator=generator) + wide)


def _with_panoramas(batch: dict[str, torch.Tensor], rng: np.random.Generator, share: float) -> dict:
    """Return the batch with some photos of which only a part of the map is known, as from a panorama."""
    some = torch.from_numpy(rng.random(len(batch["truth"])) < share)
    if not some.any():
        return batch
    rows, columns = batch["truth"].shape[2:]
    turn, width = rng.integers(columns), rng.integers(columns // 4, columns)
    low, high = rng.uniform(0, 0.5), rng.uniform(0.5, 1)
    known = torch.zeros(1, 1, rows, columns)
    known[:, :, int(low * rows) : int(high * rows), :width] = 1.0
    known = known.roll(int(turn), dims=3).expand(len(some), -1, -1, -1)
    panorama = torch.cat([display(batch["truth"]).clip(max=1.0) * known, known], dim=1)
    where = some[:, None, None, None]
    context = torch.where(where, torch.zeros_like(batch["context"]), batch["context"])
    return {**batch, "surroundings": torch.where(where, panorama, batch["surroundings"]), "context": context}


def _brighter(picture: torch.Tensor, ln_gain: torch.Tensor) -> torch.Tensor:
    """Display values [N, 3 and more, H, W] of ln_gain [N, 3, 1, 1] more light; of premultiplied ones about.

    What is clipped stays clipped.
    """
    n, sigma = MEAN_CURVE.exponent, MEAN_CURVE.sigma
    ratio = (picture[:, :3] / (1 + sigma)).clip(max=0.999)
    ln = torch.log(ratio * sigma / (1 - ratio) + 1e-9) / n
    shown = (1 + sigma) * torch.sigmoid(n * (ln + ln_gain) - float(np.log(sigma)))
    shown = torch.where(picture[:, :3] >= WHITE, picture[:, :3], shown)
    return torch.cat([shown.clip(max=1.0), picture[:, 3:]], dim=1)


def _profiles(truth: np.ndarray, at_once: int = 32) -> tuple[np.ndarray, np.ndarray]:
    """Return source_profiles of ln maps [N, 3, H, 2H], and the sources' colours."""
    luminance, profiles, colors = torch.tensor(REC709), [], []
    for start in range(0, len(truth), at_once):
        radiance = torch.exp(torch.from_numpy(truth[start : start + at_once]).float())
        places, shares = source_profiles(torch.einsum("c,nchw->nhw", luminance, radiance))
        profiles.append(shares.numpy())
        colors.append(source_colors(radiance, places, luminance).numpy())
    return np.concatenate(profiles), np.concatenate(colors)


def predict(net: WholeNet, batch: dict[str, torch.Tensor]):
    """Return the network's answer to a batch."""
    names = ("context", "tan_half", "lift", "said", "surroundings", "given_up")
    with autocast("cpu"):
        return net(*(batch[name] for name in names))


def begin_from(net: WholeNet, start: Path) -> None:
    """Load the weights that the network has in common with those in start; what it has more begins at zero there."""
    own = net.state_dict()
    for name, value in read_init_weights(start)[0].items():
        if name not in own or own[name].dim() != value.dim():
            continue
        if own[name].shape != value.shape:
            own[name].zero_()
        own[name][tuple(slice(size) for size in value.shape)] = value.to(own[name].dtype)
    net.load_state_dict(own)


def train_whole(
    config: WholeRunConfig, *, pairs: Path, runs: Path, start: Path | None = None, left_out: Path | None = None
) -> Path:
    """Train to config.steps, going on from the checkpoint of runs/<config.name> when there is one; its path.

    Args, errors: as of train.loop.train; pairs, left_out: folders of research.scenes.pairs.
    """
    torch.manual_seed(config.seed)
    path = runs / config.name / "checkpoint.pt"
    net = WholeNet().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    mean, first = deepcopy(net), 0
    stored, origin = resumed(path, config, {}, start, holds="net")
    if stored is not None:
        load_weights(mean, stored["net"], path)
        load_weights(net, stored["moving"], path)
        optimizer.load_state_dict(stored["optimizer"])
        first = stored["step"]
    elif start is not None:
        begin_from(net, start)
        mean.load_state_dict(net.state_dict())
    folder = run_folder(runs, config.name)
    if first >= config.steps:
        return path
    data, losses = Pairs(pairs, config.pairs), WholeLoss()
    kept = None if left_out is None else Pairs(left_out)
    origin = {**origin, "assets": data.identity} if config.growing else agreed(path, origin, {"assets": data.identity})
    logger = RunLogger(folder, config.name, _columns(net), first, config.steps, config.steps)
    saved = time.monotonic()
    with logger:
        for step in range(first, config.steps):
            rate = learning_rate(config, step)
            for group in optimizer.param_groups:
                group["lr"] = rate
            batch = data.batch(
                np.random.default_rng((config.seed, step)), config.batch, config.given_up, config.panoramas
            )
            net.train()
            torch.manual_seed(step + config.seed)  # what is dropped is the step's own
            terms = losses(predict(net, batch), batch)
            loss = sum(WEIGHTS[name] * value for name, value in terms.items())
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimizer.step()
            follow(mean, net, min(config.averaged, (step + 1) / (step + 20)))
            logger.note(step + 1, (step + 1) * config.batch, config.batch, {**terms, "loss": loss}, rate)
            if config.growing and (step + 1) % config.scored == 0:
                data = data.grown()
                origin["assets"] = data.identity
            if kept is not None and (step + 1) % config.scored == 0:
                with (folder / "left_out.jsonl").open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps({"step": step + 1, **score_pairs(mean, kept)}) + "\n")
            if time.monotonic() - saved > CHECKPOINT_SECONDS or step + 1 == config.steps:
                words = {"step": step + 1, "config": json.dumps(dataclasses.asdict(config)), "origin": origin}
                weights = {"net": mean.state_dict(), "moving": net.state_dict(), "optimizer": optimizer.state_dict()}
                with atomic_path(path) as temporary:
                    torch.save({**weights, **words}, temporary)
                saved = time.monotonic()
    return path


def _columns(net: WholeNet) -> SimpleNamespace:
    return SimpleNamespace(columns=(*WEIGHTS, "loss"), nets=net)


@torch.no_grad()
def follow(mean: torch.nn.Module, net: torch.nn.Module, decay: float) -> None:
    """Move the running mean of the weights, and of the statistics, towards those of now."""
    for kept, new in zip(mean.state_dict().values(), net.state_dict().values(), strict=True):
        if kept.is_floating_point():
            kept.lerp_(new, 1.0 - decay)
        else:
            kept.copy_(new)


def load_whole_net(checkpoint: Path) -> tuple[WholeNet, dict]:
    """Return the trained network of a checkpoint (the mean of its weights), ready to run, and its stored step,
    configuration and origin; ModelError if there is none, or of another release."""
    stored = read_checkpoint(checkpoint, holds="net")
    net = WholeNet()
    load_weights(net, stored["net"], checkpoint)
    about = {"step": stored["step"], "origin": stored.get("origin", {}), **json.loads(stored["config"])}
    return net.eval().requires_grad_(False), about
