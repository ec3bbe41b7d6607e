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

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.nets.blocks import autocast
from anyprobe.nets.light_net import display
from anyprobe.nets.whole_net import WholeNet
from anyprobe.train.checkpoint import agreed, load_weights, read_checkpoint, read_init_weights, resumed
from anyprobe.train.logger import RunLogger, run_folder
from anyprobe.train.loop import CHECKPOINT_SECONDS, learning_rate
from research.whole_network.looks import LOOKS, brighter
from research.whole_network.losses import WEIGHTS, WholeLoss
from research.whole_network.score import score_pairs

LEVEL, TINT = 0.08, 0.04
"""Standard deviations of ln of the light that a pair has more of, all of it and each channel, each time it is seen."""

UNUSED = ("image", "scene", "lift", "posterior")
"""Arrays of pairs that this network is not given, or has from its looks."""
GROWN = 100
"""Steps after which a growing run looks for further pairs."""
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
    """Kept pairs of research.scenes.pairs and their looks in memory, half a megabyte each."""

    def __init__(self, folder: Path, looks: Path, most: int = 0, before: Pairs | None = None) -> None:
        """Read a folder's files in the order of their names, those that `before` has from there; InputError where
        there are none whose looks are kept."""
        self.folder, self.looks, self._read = folder, looks, {} if before is None else before._read
        files = [path for path in sorted(folder.glob("*.npz")) if (looks / path.name).is_file()]
        if not files:
            raise InputError(f"{folder}: expected pairs and their looks in {looks}, found none; make them first")
        self._parts, count, seen = [], 0, hashlib.sha256()
        for path in files:
            if path.name not in self._read:
                with np.load(path, allow_pickle=False) as stored:
                    part = {name: stored[name] for name in stored.files if name not in UNUSED}
                with np.load(looks / path.name, allow_pickle=False) as stored:
                    part |= {name: stored[name] for name in stored.files}
                self._read[path.name] = part
            part = self._read[path.name]
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
        return Pairs(self.folder, self.looks, before=self)

    def rows(self, start: int, stop: int) -> dict[str, torch.Tensor]:
        """Return pairs in order, as they are, as the network takes them."""
        index = np.arange(start, min(stop, len(self)))
        batch = self._looked(index, np.zeros(len(index), int))
        return {**batch, "given_up": torch.zeros(len(index), 3)}

    def batch(
        self, rng: np.random.Generator, count: int, given_up: float, panoramas: float = 0.0
    ) -> dict[str, torch.Tensor]:
        """Return a random batch, half of it second looks, as the network takes it."""
        batch = self._looked(rng.integers(len(self), size=count), rng.integers(LOOKS, size=count))
        ln_gain = torch.from_numpy(rng.normal(0.0, LEVEL, (count, 1)) + rng.normal(0.0, TINT, (count, 3))).float()
        gain = ln_gain[:, :, None, None]
        noise = torch.from_numpy(rng.uniform(0.0, NOISE, (count, 1, 1, 1))).float()
        generator = torch.Generator().manual_seed(int(rng.integers(2**62)))

        def noisy(values: torch.Tensor, share: float, where: torch.Tensor | float = 1.0) -> torch.Tensor:
            return values + share * noise * where * _grain(values, generator)

        def seen(picture: torch.Tensor) -> torch.Tensor:  # of the last channel's cover
            bright = brighter(picture, gain)
            cover = bright[:, -1:]
            colors = noisy(bright[:, :3], 1.0, cover) * (cover > 0)
            return torch.cat([colors, bright[:, 3:]], dim=1).clip(0.0, 1.0)

        lift = batch["lift"]
        batch |= {
            "context": seen(batch["context"]),
            "surroundings": seen(batch["surroundings"]),
            "lift": torch.cat([noisy(lift[:, :6] + gain.repeat(1, 2, 1, 1), 3.0), lift[:, 6:]], dim=1),
            "truth": batch["truth"] + gain,
            "given_up": batch["up"] * torch.from_numpy(rng.random((count, 1)) < given_up).float(),
        }
        batch = _with_panoramas(batch, rng, panoramas)
        return {**batch, "context": batch["context"].contiguous(memory_format=torch.channels_last)}

    def _looked(self, index: np.ndarray, look: np.ndarray) -> dict[str, torch.Tensor]:
        """Return pairs [N] by their looks [N]: the second mirrored, under its gain, some of the object alone."""
        parts = np.searchsorted(self._starts, index, side="right") - 1
        inside = index - self._starts[parts]

        def of(name: str, *look: np.ndarray) -> torch.Tensor:
            picked = [
                self._parts[p][name][at] for p, *at in zip(parts, inside, *look, strict=True) for at in (tuple(at),)
            ]
            return torch.from_numpy(np.stack(picked)).float()

        second = torch.from_numpy(look == 1)
        here = second[:, None, None, None]
        gain = (of("gain") * second[:, None])[:, :, None, None]
        known = 1.0 - (of("alone") * second)[:, None, None, None]
        pictures = {
            "context": brighter((of("context") / 255).permute(0, 3, 1, 2), gain),
            "surroundings": brighter(of("surroundings") / 255, gain),
            "truth": of("truth") + gain,
        }
        pictures["context"] = pictures["context"] * known * (pictures["context"][:, 4:] > 0)
        pictures["surroundings"] = pictures["surroundings"] * known * (pictures["surroundings"][:, 3:] > 0)
        pictures = {name: torch.where(here, one.flip(3), one) for name, one in pictures.items()}
        signs = torch.where(second[:, None], torch.tensor([-1.0, 1.0, 1.0]), torch.ones(3))
        return {
            **pictures,
            "tan_half": of("tan_half")[:, None],
            "lift": of("lift", look),
            "said": of("said", look),
            "lifted": of("lifted", look),
            "object_code": of("code", look),
            "profiles": of("profiles"),
            "colors": of("colors"),
            "up": of("up") * signs,
            "family": of("family"),
        }


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


NET_INPUTS = ("context", "tan_half", "lift", "said", "surroundings", "given_up", "lifted", "object_code")
"""Arrays of a batch in the order of WholeNet's arguments."""


def predict(net: WholeNet, batch: dict[str, torch.Tensor]):
    """The network's answer to a batch."""
    with autocast("cpu"):
        return net(*(batch[name] for name in NET_INPUTS))


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


def looks_of(pairs: Path) -> Path:
    """Return the folder of the looks at a folder's pairs."""
    return pairs.with_name(f"{pairs.name}-looks")


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
    data, losses = Pairs(pairs, looks_of(pairs), config.pairs), WholeLoss()
    kept = None if left_out is None else Pairs(left_out, looks_of(left_out))
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
            if config.growing and (step + 1) % GROWN == 0:
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
    """The trained network of a checkpoint (the mean of its weights), ready to run, and its stored step, configuration
    and origin; ModelError if there is none, or of another release."""
    stored = read_checkpoint(checkpoint, holds="net")
    net = WholeNet()
    load_weights(net, stored["net"], checkpoint)
    about = {"step": stored["step"], "origin": stored.get("origin", {}), **json.loads(stored["config"])}
    return net.eval().requires_grad_(False), about
