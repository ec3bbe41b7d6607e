"""Is an estimated light more saturated than lights are, and does drawing it towards the Planckian locus help?

    python -m research.light_color --data DATA --part train --pairs 240     # left-out training assets: to choose by
    python -m research.light_color --data DATA --part frozen --pairs 200    # held-out assets: to report

Each pair is rendered twice: with its own material, and with a strongly coloured one. For tolerances D the mean colour
of the estimate (CIE 1960 uv) that lies farther than D off the locus is drawn back to D, by one gain a channel.
The figure is the mean colour angle of a white Lambert sphere, before and after, and how often the prior acts.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from anyprobe.core.color import REC709_CHROMATICITIES, xyz_from_rgb
from anyprobe.dataset.asset_store import AssetStore, load_asset_store, load_left_out
from anyprobe.dataset.pair import Pair, render_pair
from anyprobe.dataset.plan import balanced_recipes
from anyprobe.dataset.recipe import Recipe
from anyprobe.estimate.estimator import Estimator
from anyprobe.evaluate.calibration import SEED
from anyprobe.evaluate.metrics import color_angle_deg
from anyprobe.evaluate.test_sets import FROZEN, read_recipes
from anyprobe.light.environment import integral
from anyprobe.render.picture import draw_mesh
from anyprobe.render.spheres import diffuse, sphere_normals
from anyprobe.scatter.materials import Material

TOLERANCES = (0.0, 0.004, 0.005, 0.006, 0.008)
TEMPERATURES = np.linspace(2000.0, 15000.0, 400)
SPHERE = 24
XYZ = xyz_from_rgb(REC709_CHROMATICITIES)


def planckian_uv(kelvin: np.ndarray) -> np.ndarray:
    """CIE 1960 u, v [..., 2] of black bodies from 1000 to 15000 K; Krystek 1985."""
    t = kelvin
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (
        1 + 8.42420235e-4 * t + 7.08145163e-7 * t**2
    )
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (
        1 - 2.89741816e-5 * t + 1.61456053e-7 * t**2
    )
    return np.stack([u, v], axis=-1)


def uv_of(rgb: np.ndarray) -> np.ndarray:
    """CIE 1960 u, v [2] of linear Rec. 709 [3]."""
    x, y, z = XYZ @ rgb
    return np.array([4 * x, 6 * y]) / (x + 15 * y + 3 * z)


def rgb_of(uv: np.ndarray) -> np.ndarray:
    """Linear Rec. 709 [3] of luminance 1 with these u, v."""
    scale = 2 * uv[0] - 8 * uv[1] + 4
    x, y = 3 * uv[0] / scale, 2 * uv[1] / scale
    return np.linalg.solve(XYZ, np.array([x / y, 1.0, (1 - x - y) / y]))


def off_locus(rgb: np.ndarray) -> tuple[float, np.ndarray]:
    """Distance from the locus, and its nearest point [2]."""
    locus = planckian_uv(TEMPERATURES)
    away = np.linalg.norm(uv_of(rgb) - locus, axis=1)
    return float(away.min()), locus[away.argmin()]


def gain_towards_locus(mean: np.ndarray, tolerance: float) -> np.ndarray:
    """Gains [3] that bring a light of this mean colour [3] to the tolerance off the locus; ones where it is nearer."""
    away, nearest = off_locus(mean)
    if away <= tolerance:
        return np.ones(3)
    uv = uv_of(mean)
    return rgb_of(nearest + (uv - nearest) * tolerance / away) / rgb_of(uv)


def coloured(material: Material, seed: int) -> Material:
    """The same surface of a strong hue: saturation 0.6 to 0.97."""
    rng = np.random.default_rng(seed % 2**32)
    hue, saturation, value = 6 * rng.random(), rng.uniform(0.6, 0.97), rng.uniform(0.3, 0.9)
    pure = np.clip(np.abs((hue + np.array([0, 4, 2])) % 6 - 3) - 1, 0, 1)
    color = np.clip(value * (1 - saturation + saturation * pure), 0.05, 0.95)
    return replace(material, albedo=color) if np.any(material.albedo > 0) else replace(material, f0=color)


def pairs_of(recipe: Recipe, store: AssetStore) -> Iterator[tuple[str, Pair]]:
    """The recipe's pair, and the same with a coloured material."""
    yield "own", render_pair(recipe, store)
    yield (
        "coloured",
        render_pair(recipe, store, trace=lambda mesh, camera, light, material: draw_mesh(
            mesh, camera, light, coloured(material, recipe.seed))),
    )  # fmt: skip


def figures(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Distances off the locus, and the colour angle as it is and for each tolerance."""
    mask = sphere_normals(SPHERE)[1]
    mean, sphere, true = integral(estimate), diffuse(estimate, SPHERE), diffuse(truth, SPHERE)
    found = {"off": off_locus(mean)[0], "true off": off_locus(integral(truth))[0]}
    found["as it is"] = color_angle_deg(sphere, true, mask)
    for tolerance in TOLERANCES:
        gain = gain_towards_locus(mean, tolerance)
        found[f"{tolerance:g}"] = color_angle_deg(sphere * gain, true, mask)
    return found


def main() -> None:
    """One JSON object a kind of material."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--part", choices=("train", "frozen"), default="train")
    parser.add_argument("--pairs", type=int, default=240)
    given = parser.parse_args()
    if given.part == "train":
        store = load_left_out(given.data)
        recipes = balanced_recipes(store, given.pairs, SEED)
    else:
        store, recipes = (
            load_asset_store(given.data, "test", commercial_only=False),
            read_recipes(FROZEN)[: given.pairs],
        )
    models, rows = Estimator().models, {"own": [], "coloured": []}
    for recipe in recipes:
        for kind, pair in pairs_of(recipe, store):
            rows[kind].append(figures(models(pair.crop, pair.tan_half, None, None).radiance, pair.radiance))
    for kind, found in rows.items():
        print(json.dumps({"material": kind, "pairs": len(found), **summary(found)}))


def summary(rows: list[dict[str, float]]) -> dict:
    """Medians and 95 % quantiles of the distances, and the mean angle.

    For each tolerance its change with the standard error of that, and the share of pairs where the prior acts.
    """
    column = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    result = {name: np.quantile(column[name], [0.5, 0.95]).round(4).tolist() for name in ("off", "true off")}
    result["as it is"] = round(float(column["as it is"].mean()), 3)
    for tolerance in TOLERANCES:
        change = column[f"{tolerance:g}"] - column["as it is"]
        error = change.std() / np.sqrt(len(change))
        acts = (column["off"] > tolerance).mean()
        result[f"{tolerance:g}"] = {
            "change": round(float(change.mean()), 3),
            "+-": round(float(error), 3),
            "acts": round(float(acts), 2),
        }
    return result


if __name__ == "__main__":
    main()
