"""The second stage learns from reflectance maps: losses, and a loop that resumes exactly.

    python -m research.second_stage train --data DATA --runs runs

goes on from runs/second_stage/checkpoint.pt where there is one. The folder also keeps what is made once: maps.npy and
matrices.npy, and first_stage.npz of research.second_stage.first_stage, which must be there.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.learning.evaluate.calibration import CLOSE
from anyprobe.learning.nets.blocks import autocast
from anyprobe.learning.nets.emitter_head import POWER_FLOOR
from anyprobe.learning.train.config import LightConfig
from anyprobe.learning.train.dataloader import stream
from anyprobe.learning.train.lift import display
from anyprobe.light.environment import shrink
from research.second_stage.first_stage import SeenSurfaces
from research.second_stage.net import SecondGuess, SecondStage
from research.second_stage.reflectance_pairs import BASE_ROWS, ReflectanceBatch, ReflectanceConfig, ReflectanceSource
from research.second_stage.reflectance_tables import reflectance_matrices

CHECKPOINT_SECONDS = 180.0
AVERAGED_EVERY = 4
LEAST_LN = -5.0
"""ln radiance below which darker does not count in patterns."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SecondConfig:
    """averaging: share of the old in the mean of the weights, each step; it is the mean that is used."""

    steps: int = 400_000
    learning_rate: float = 1.2e-3
    warmup: int = 200
    weight_decay: float = 0.02
    averaging: float = 0.999
    width: int = 512
    blocks: int = 2
    light: LightConfig = field(default_factory=lambda: LightConfig(procedural=160, variants=260, seed=41))
    pairs: ReflectanceConfig = field(default_factory=lambda: ReflectanceConfig(seed=401))


class SecondLosses:
    """Losses of a guess; weights were set by their sizes after a thousand steps, all but ldr about a tenth of it."""

    weights = {"ldr": 10.0, "pattern": 0.15, "emitters": 0.06, "above": 0.03, "power": 0.06}
    weights |= {"chroma": 0.03, "confidence": 0.05, "metal": 0.05, "material": 0.02}

    def __init__(self) -> None:
        angles = torch.from_numpy(pixel_solid_angles(32)).expand(-1, 64)[None, None]
        self.angles, self.shares = angles, angles / angles.sum()
        self.weight = 0.5 + 0.5 * angles / angles.mean()
        self.luminance = torch.tensor(REC709)[:, None, None]

    def __call__(self, guess: SecondGuess, batch: ReflectanceBatch) -> dict[str, torch.Tensor]:
        """Unweighted."""
        terms = {**self._map(guess, batch.radiance), **self._numbers(guess, batch.radiance)}
        metal, numbers = batch.true_material[:, :1], batch.true_material[:, 1:]
        terms["metal"] = F.binary_cross_entropy_with_logits(guess.material[:, :1], metal)
        wrong = (guess.material[:, 1:7] - numbers[:, :6]).square().mean(dim=1, keepdim=True)
        terms["material"] = _nll(wrong, guess.material_ln_spread)
        terms["material"] = terms["material"] + (guess.material[:, 7] - numbers[:, 6]).abs().mean()
        return terms

    def _map(self, guess: SecondGuess, radiance: torch.Tensor) -> dict[str, torch.Tensor]:
        true = display(torch.log(radiance.clip(min=1e-6))).clip(max=1.0)
        shown = display(guess.ln_shown)
        shown = torch.where((shown > 1) & (true >= 1), shown.clip(max=1.0), shown)
        wrong = shown - true
        true_ln = torch.log(radiance.clip(min=1e-6)).clip(LEAST_LN, 0.0)
        ln = guess.ln_shown - true_ln
        ln = torch.where((guess.ln_shown > 0) & (true_ln >= 0), 0.0, ln)
        ln = ln - (ln * self.shares).sum(dim=(2, 3), keepdim=True)
        close = (wrong.detach().abs().mean(dim=1, keepdim=True) < CLOSE).float()
        half = F.avg_pool2d(wrong, 4).square().mean()
        return {
            "ldr": (wrong.square() * self.weight).mean() + 0.5 * half,
            "pattern": (ln.square() * self.shares).sum(dim=(2, 3)).mean(),
            "confidence": F.binary_cross_entropy_with_logits(guess.confidence_logit, close),
        }

    def _numbers(self, guess: SecondGuess, radiance: torch.Tensor) -> dict[str, torch.Tensor]:
        above = (radiance - 1).clip(min=0.0) * self.angles
        total = above.sum(dim=(2, 3))
        share = above.sum(dim=1).flatten(1) / total.sum(dim=1, keepdim=True).clip(min=1e-6)
        guessed = torch.log_softmax((guess.emitter_logit + torch.log(self.angles)).flatten(1), dim=1)
        mean = total.mean(dim=1)
        colour = (radiance * self.shares).sum(dim=(2, 3)).clip(min=1e-5)
        power = torch.log((colour * self.luminance[:, 0, 0]).sum(dim=1, keepdim=True))
        chroma = torch.log(colour[:, ::2] / colour[:, 1:2])
        spread = guess.ln_spread
        return {
            "emitters": -(mean / (mean + 1.0) * (share * guessed).sum(dim=1)).mean(),
            "above": _nll(
                (guess.ln_above - torch.log(total + POWER_FLOOR)).square().mean(1, keepdim=True), spread[:, :1]
            ),
            "power": _nll((guess.ln_power - power).square(), spread[:, 1:2]),
            "chroma": _nll((guess.chroma - chroma).square().mean(dim=1, keepdim=True), spread[:, 2:]),
        }


def _nll(squared: torch.Tensor, ln_spread: torch.Tensor) -> torch.Tensor:
    """Of a normal distribution but for a constant."""
    return (0.5 * squared * torch.exp(-2 * ln_spread) + ln_spread).mean()


def open_source(config: SecondConfig, data: Path, folder: Path) -> ReflectanceSource:
    """The batches of a run; maps and matrices are made once and kept in the folder."""
    maps, matrices = folder / "maps.npy", folder / "matrices.npy"
    if not maps.is_file():
        from anyprobe.learning.train.dataloader import load_assets, make_maps

        store = load_assets(config.light, data)
        small = [shrink(one, BASE_ROWS).transpose(2, 0, 1) for one in make_maps(config.light, store)]
        with atomic_path(maps) as temporary, open(temporary, "wb") as stream:
            np.save(stream, np.stack(small).astype(np.float32))
    if not matrices.is_file():
        with atomic_path(matrices) as temporary, open(temporary, "wb") as stream:
            np.save(stream, reflectance_matrices())
    return ReflectanceSource(
        torch.from_numpy(np.load(maps)), np.load(matrices), SeenSurfaces.load(folder / "first_stage.npz"), config.pairs
    )


def train(config: SecondConfig, data: Path, folder: Path, stop_after: int | None = None, workers: int = 0) -> Path:
    """Train to config.steps, going on from the folder's checkpoint; returns the checkpoint's path.

    workers: processes that make the batches ahead, 0 for none; batches do not depend on it.
    """
    path = folder / "checkpoint.pt"
    torch.manual_seed(0)
    net = SecondStage(config.width, config.blocks)
    averaged = copy.deepcopy(net).requires_grad_(False)
    optimizer = torch.optim.AdamW(
        net.parameters(), lr=config.learning_rate, betas=(0.9, 0.98), weight_decay=config.weight_decay, fused=True
    )
    first, said = 0, json.dumps(dataclasses.asdict(config))
    if path.is_file():
        stored = torch.load(path, weights_only=True)
        then, now = ({**json.loads(one), "steps": 0} for one in (stored["config"], said))
        if then != now:
            raise InputError(f"{path}: expected a run of the same settings, got another; train in another folder")
        net.load_state_dict(stored["net"])
        averaged.load_state_dict(stored["averaged"])
        optimizer.load_state_dict(stored["optimizer"])
        first = stored["step"]
    last = config.steps if stop_after is None else min(stop_after, config.steps)
    if workers:
        open_source(config, data, folder)  # makes what is kept, once
    batches = stream(partial(open_source, config, data, folder), range(first, last), workers)
    losses = SecondLosses()
    saved, sums, started = time.monotonic(), {}, (*_clocks(), first)
    for step, batch in enumerate(batches, start=first):
        rate = config.learning_rate * min(1.0, (step + 1) / config.warmup)
        for group in optimizer.param_groups:
            group["lr"] = rate
        with autocast("cpu"):
            guess = net(*batch.inputs())
        terms = losses(guess, batch)
        loss = sum(losses.weights[name] * value for name, value in terms.items())
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        if step % AVERAGED_EVERY == 0:
            share = min(config.averaging, (step + 1) / (step + 10)) ** AVERAGED_EVERY
            with torch.no_grad():
                torch._foreach_lerp_(list(averaged.parameters()), list(net.parameters()), 1 - share)
        for name, value in terms.items():
            sums.setdefault(name, []).append(float(value.detach()))
        if (step + 1) % 100 == 0:
            done = (step + 1 - started[2]) * config.pairs.batch
            pace = [done / (now - then) for now, then in zip(_clocks(), started, strict=False)]
            print(
                step + 1,
                "{:.0f}/s {:.0f}/core s".format(*pace),
                *(f"{name} {np.mean(each):.4f}" for name, each in sums.items()),
                flush=True,
            )
            sums = {}
        if time.monotonic() - saved > CHECKPOINT_SECONDS or step + 1 == last:
            with atomic_path(path) as temporary:
                torch.save(
                    {
                        "net": net.state_dict(),
                        "averaged": averaged.state_dict(),
                        "optimizer": optimizer.state_dict(),
                        "step": step + 1,
                        "config": said,
                    },
                    temporary,
                )
            saved = time.monotonic()
    return path


def _clocks() -> tuple[float, float]:
    return time.monotonic(), time.process_time()
