"""The second stage beside the model that ships, on the same photos through the same first stage.

    python -m research.second_stage measure --data DATA            # pairs that are left out of training
    python -m research.second_stage measure --data DATA --frozen   # report only

Prints a Markdown table for each of: the photo alone, normals given, material given, both given. Columns: LDR RMSE of
all pairs and of each kind of material and width; RMSE after the best gain; total power, median bias and mean absolute
error in stops; explained variance of ln radiance by order of spherical harmonics against the mean of the true maps;
share of pairs whose total power lies within the stated 68 % interval. What ships is not asked again once a material is
given, so that its rows do not change by it; the repair afterwards is not part of them. Choose by the pairs that are
left out of training; the frozen set reports.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.learning.dataset.asset_store import load_asset_store
from anyprobe.learning.dataset.pair import Pair
from anyprobe.learning.dataset.recipe import read_recipes
from anyprobe.learning.evaluate.scoring import FROZEN
from anyprobe.learning.nets.emitter_head import EmitterHead
from anyprobe.learning.nets.lifting import given_or_estimated
from anyprobe.learning.nets.light_net import LightNet
from anyprobe.learning.train.checkpoint import load_init_weights
from anyprobe.learning.train.lift import Lift
from anyprobe.light.environment import MAP_HEIGHT
from research.harmonics import real_basis
from research.kept_pairs import kept_pairs
from research.left_out import left_out_pairs
from research.second_stage.net import SecondStage
from research.second_stage.two_stages import light_of, points

GIVEN = ("photo alone", "normals", "material", "normals, material")
ORDERS = 8
GAINS = np.exp2(np.arange(-2.5, 2.6, 0.25))
KINDS = ("all", "metal < .1", "metal .1-.5", "metal > .5", "dielectric < .5", "dielectric > .5")


def kinds_of(pair: Pair) -> np.ndarray:
    """[6] bool, in the order of KINDS."""
    alpha, metal = pair.material.alpha, not np.any(pair.material.albedo)
    dull = alpha >= 0.5
    metals = [metal and alpha < 0.1, metal and 0.1 <= alpha < 0.5, metal and dull]
    return np.array([True, *metals, not metal and not dull, not metal and dull])


def material_numbers(pair: Pair) -> torch.Tensor:
    """[1, 8] as the second stage takes a given material."""
    f0, albedo = (np.broadcast_to(each, 3) for each in (pair.material.f0, pair.material.albedo))
    numbers = np.concatenate([[1.0], f0, albedo, [np.sqrt(pair.material.alpha)]])
    return torch.from_numpy(numbers.astype(np.float32))[None]


def given_normals(pair: Pair) -> torch.Tensor:
    """[1, 3, 64, 64], unit, zero outside the object."""
    normals = F.avg_pool2d(torch.from_numpy(pair.normals.transpose(2, 0, 1)[None].copy()), 2)
    length = normals.square().sum(dim=1, keepdim=True).sqrt()
    return torch.where(length > 0.5, normals / length.clip(min=0.5), torch.zeros(()))


class Estimator:
    """Both models on one pair."""

    def __init__(self, first: LightNet, second: SecondStage) -> None:
        self.first, self.second, self.emitters = first.eval(), second.eval(), EmitterHead(1)

    @torch.no_grad()
    def __call__(self, pair: Pair, given: str) -> dict[str, tuple[np.ndarray, float, float]]:
        """Radiance [3, 64, 128], and the stated ln mean luminance and its deviation, nan from what ships."""
        photo = torch.from_numpy(pair.crop.transpose(2, 0, 1)[None].copy())
        tan_half = torch.tensor([[pair.tan_half]], dtype=torch.float32)
        normals = given_normals(pair) if "normals" in given else torch.zeros(1, 3, 64, 64)
        guess = self.first(photo, tan_half, normals)
        material = material_numbers(pair) * float("material" in given)
        known = given_or_estimated(normals, guess.normals)[1]
        seen = points(photo, guess.normals, known, tan_half, guess.features.root_alpha, material)
        second = self.second(*seen, torch.zeros(1, 4, MAP_HEIGHT, 2 * MAP_HEIGHT))
        shown, drawn, _ = light_of(second, self.emitters)
        stated = float(second.ln_power), float(torch.exp(second.ln_spread[0, 1]))
        return {
            "lift": (torch.exp(guess.ln_radiance.clip(max=9.0))[0].numpy(), np.nan, np.nan),
            "second stage": ((shown + drawn)[0].numpy(), *stated),
        }


@dataclass(kw_only=True)
class Rows:
    """Figures of one method, one row a pair."""

    rmse: list[float] = field(default_factory=list)
    after_gain: list[float] = field(default_factory=list)
    stops: list[float] = field(default_factory=list)
    within: list[float] = field(default_factory=list)
    harmonics: list[np.ndarray] = field(default_factory=list)

    def add(self, radiance: np.ndarray, ln_power: float, spread: float, pair: Pair) -> None:
        """One pair's."""
        true = pair.radiance.transpose(2, 0, 1)
        self.rmse.append(_rmse(radiance, true))
        self.after_gain.append(min(_rmse((radiance * gain)[:, ::2, ::2], true[:, ::2, ::2]) for gain in GAINS))
        power, true_power = mean_luminance(radiance), mean_luminance(true)
        self.stops.append(float(np.log2(power / true_power)))
        self.within.append(float(abs(np.log(true_power) - ln_power) < spread) if spread == spread else np.nan)
        self.harmonics.append(harmonics(radiance))


def _rmse(radiance: np.ndarray, true: np.ndarray) -> float:
    return float(np.sqrt(np.mean((response(radiance) - response(true)) ** 2)))


_ANGLES = np.repeat(pixel_solid_angles(MAP_HEIGHT)[:, 0], 2 * MAP_HEIGHT)
_BASIS = real_basis(pixel_directions(MAP_HEIGHT).reshape(-1, 3).astype(np.float64), ORDERS) * _ANGLES[:, None]


def mean_luminance(radiance: np.ndarray) -> float:
    """Of a map [3, 64, 128], by solid angle."""
    return float(np.einsum("c,cp,p->", REC709, radiance.reshape(3, -1), _ANGLES) / (4 * np.pi))


def harmonics(radiance: np.ndarray) -> np.ndarray:
    """Coefficients of ln radiance of a map [3, 64, 128], [3, (ORDERS + 1)^2]."""
    return np.log(np.maximum(radiance.reshape(3, -1), 2e-3)) @ _BASIS


def line(name: str, rows: Rows, kinds: np.ndarray, true: np.ndarray) -> str:
    """A row of the table; kinds [N, 6], true [N, 3, K] coefficients of the true maps."""
    wrong, about_mean = (np.square(each) for each in (np.stack(rows.harmonics) - true, true - true.mean(axis=0)))
    parts = [slice(n * n, (n + 1) ** 2) for n in range(ORDERS + 1)]
    explained = [1 - wrong[..., part].sum() / about_mean[..., part].sum() for part in parts]
    errors, stops = np.array(rows.rmse), np.array(rows.stops)
    cells = [f"{errors[kind].mean():.4f}" for kind in kinds.T]
    cells += [f"{np.mean(rows.after_gain):.4f}", f"{np.median(stops):+.2f} / {np.abs(stops).mean():.2f}"]
    cells += [" ".join(f"{each:.2f}" for each in explained), f"{np.mean(rows.within):.2f}"]
    return f"| {name} | " + " | ".join(cells) + " |"


def measure(estimator: Estimator, pairs: Iterable[Pair]) -> list[str]:
    """The tables."""
    rows: dict[tuple[str, str], Rows] = {}
    kinds, true = [], []
    for pair in pairs:
        kinds.append(kinds_of(pair))
        true.append(harmonics(pair.radiance.transpose(2, 0, 1)))
        for given in GIVEN:
            for name, answer in estimator(pair, given).items():
                rows.setdefault((given, name), Rows()).add(*answer, pair)
    lines = [f"{len(kinds)} pairs", ""]
    lines += ["| | " + " | ".join(KINDS) + " | after gain | power, stops | explained by order | within |"]
    lines += ["|" + "---|" * (len(KINDS) + 5)]
    lines += [line(f"{name}: {given}", row, np.stack(kinds), np.stack(true)) for (given, name), row in rows.items()]
    return lines


def tables(data: Path, checkpoint: Path, first: Path, frozen: bool, count: int | None, kept: Path | None) -> list[str]:
    """What `python -m research.second_stage measure` prints."""
    nets = Lift.networks()
    load_init_weights(nets, first)
    stored = torch.load(checkpoint, weights_only=True)
    config = json.loads(stored["config"])
    second = SecondStage(config["width"], config["blocks"])
    second.load_state_dict(stored["averaged"])
    if frozen:
        store = load_asset_store(data, "test", commercial_only=False)
        pairs = kept_pairs(read_recipes(FROZEN), store, kept)
    else:
        pairs = left_out_pairs(data, kept)
    samples = stored["step"] * config["pairs"]["batch"]
    head = [f"step {stored['step']}, {samples} samples", ""]
    return head + measure(Estimator(nets["light"], second), islice(pairs, count))
