"""The paper's Fig. 4 by number and by picture: which irradiance image says most of the light, and can be estimated.

    python -m research.irradiance_targets DATA [-o research/irradiance_targets]

A sphere in the light of training maps, materials as in training, photos clipped and with noise. By ridge regression:
LDR RMSE of the map (16 x 32) that is read from the true target, and how much of the target's variance is read from the
photo; on maps of the test set. No network: what is linear in display values and in logarithms of radiance.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from PIL import Image, ImageDraw

from anyprobe.cli.app import main as run_command
from anyprobe.core.response import response
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.dataset.catalog import load_maps
from anyprobe_train.dataset.distributions import draw_material
from research.irradiance_targets.targets import TARGETS, lit, metal_and_irradiance, seen
from research.limits.sphere import Views, reflected, sphere_points

ALPHAS = (0.03, 0.1, 0.3, 1.0)
NOISE = 0.01
"""Standard deviation, of white, in photos and in targets, which no network says exactly."""
MIDDLE = 0.35
"""Mean of a photo's radiance."""
COARSE = 4
RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
"""Share of the mean feature variance that is added to the diagonal; chosen by every LEFT_OUT-th map."""
LEFT_OUT = 5
SIDE = 96


class Reader:
    """Ridge regression from pictures [N, P, 3] of radiance to numbers [N, M]."""

    def __init__(self, pictures: np.ndarray, numbers: np.ndarray, of_map: np.ndarray) -> None:
        """of_map [N]: which map lit each picture."""
        x = _features(pictures)
        self._x0, self._y0 = x.mean(axis=0), numbers.mean(axis=0)
        x, y = x - self._x0, numbers - self._y0
        gram = x @ x.T
        held = of_map % LEFT_OUT == 0

        def solved(ridge: float, chosen: np.ndarray) -> np.ndarray:
            system = gram[np.ix_(chosen, chosen)] + ridge * np.trace(gram) / len(x) * np.eye(chosen.sum())
            return np.linalg.solve(system, y[chosen])

        def missed(ridge: float) -> float:
            return float(((gram[np.ix_(held, ~held)] @ solved(ridge, ~held) - y[held]) ** 2).mean())

        best = min(RIDGES, key=missed)
        self._weights = x.T @ solved(best, np.ones(len(x), bool))

    def __call__(self, pictures: np.ndarray) -> np.ndarray:
        return (_features(pictures) - self._x0) @ self._weights + self._y0


def _features(pictures: np.ndarray) -> np.ndarray:
    shown = np.clip(pictures, 1e-3, 1.0)
    return np.concatenate([np.log(shown), 2 * response(shown)], axis=1).reshape(len(shown), -1).astype(np.float32)


def _noisy(pictures: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return pictures + NOISE * rng.standard_normal(pictures.shape, np.float32)


def _small(ldr: np.ndarray) -> np.ndarray:
    """[N, 64, 128, 3] to [N, 16 * 32 * 3]."""
    n, h, w, _ = ldr.shape
    return ldr.reshape(n, h // COARSE, COARSE, w // COARSE, COARSE, 3).mean(axis=(2, 4)).reshape(n, -1)


def photos(views: Views, alpha: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Photos [N, 316, 3] of a sphere of random materials, of mean radiance MIDDLE, and the gains [N] for that."""
    drawn = [draw_material(rng, alpha) for _ in views.radiance]
    material = Material(
        albedo=np.stack([one.albedo for one in drawn]), f0=np.stack([one.f0 for one in drawn]), alpha=alpha
    )
    shown = reflected(views.terms(alpha), material)
    gains = MIDDLE / shown.mean(axis=(1, 2))
    return shown * gains[:, None, None], gains


def measure(learn: Views, test: Views, alpha: float) -> dict[str, tuple[float, float]]:
    """Of each target: LDR RMSE of maps that are read from it, and the share of the variance of its display values that
    is read from the photo. "photo": RMSE of maps read from the photo itself, and 1."""
    rng = np.random.default_rng(1)
    (photo, gain), (photo_test, gain_test) = (photos(views, alpha, rng) for views in (learn, test))
    photo, photo_test = _noisy(photo, rng), _noisy(photo_test, rng)
    maps, truth = (_small(response(v.radiance * g[:, None, None, None])) for v, g in ((learn, gain), (test, gain_test)))

    def error(estimate: np.ndarray) -> float:
        return float(np.sqrt(((estimate.clip(0, 1) - truth) ** 2).mean(axis=1)).mean())

    direct = error(Reader(photo, maps, learn.number)(photo_test))
    found = {"photo": (direct, 1.0), "mean map": (error(maps.mean(axis=0)[None]), 0.0)}
    n = sphere_points()
    for target in TARGETS:
        true, true_test = (
            _noisy(np.minimum(seen(target, alpha, v.radiance, n) * g[:, None, None], 1.0), rng)
            for v, g in ((learn, gain), (test, gain_test))
        )
        shown, shown_test = (response(one.clip(0, 1)).reshape(len(one), -1) for one in (true, true_test))
        missed = ((Reader(photo, shown, learn.number)(photo_test) - shown_test) ** 2).sum()
        variance = ((shown_test - shown.mean(axis=0)) ** 2).sum()
        found[target] = error(Reader(true, maps, learn.number)(true_test)), float(1 - missed / variance)
    return found


def draw(radiance: np.ndarray) -> Image.Image:
    """A column for each of ALPHAS: the photo of a metal sphere, and the three targets."""
    x = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    right, up = np.meshgrid(x, -x)
    inside = right**2 + up**2 < 1
    n = np.stack([right, up, np.sqrt(np.clip(1 - right**2 - up**2, 0, 1))], axis=-1)[inside].astype(np.float32)
    sheet = Image.new("RGB", (110 + SIDE * len(ALPHAS), 18 + SIDE * (1 + len(TARGETS))), "white")
    pen = ImageDraw.Draw(sheet)
    for column, alpha in enumerate(ALPHAS):
        pen.text((114 + SIDE * column, 4), f"alpha {alpha:g}", "black")
        photo = lit(metal_and_irradiance(alpha, n)[0], radiance[None])[0]
        rows = [photo, *(seen(target, alpha, radiance[None], n)[0] for target in TARGETS)]
        gain = MIDDLE / rows[2].mean()
        for row, values in enumerate(rows):
            picture = np.ones((SIDE, SIDE, 3), np.float32)
            picture[inside] = response(values * gain)
            where = (110 + SIDE * column, 18 + SIDE * row)
            sheet.paste(Image.fromarray((picture.clip(0, 1) * 255).round().astype(np.uint8)), where)
    for row, name in enumerate(("photo", *TARGETS)):
        pen.text((4, 18 + SIDE * row + SIDE // 2 - 6), name, "black")
    return sheet


def main(data: Path, /, *, out: Annotated[Path, Parameter(name="-o")] = Path("research/irradiance_targets")) -> None:
    """Print the table and draw the picture."""
    learn = Views([one.radiance for one in load_asset_store(data, "train").maps.values()])
    test = Views([one.radiance for one in load_maps(data / "hdri" / "test")], seed=1)
    names = ("photo", *TARGETS, "mean map")
    print(f"| alpha | {' | '.join(names)} |\n|---|{'---|' * len(names)}")
    for alpha in ALPHAS:
        found = measure(learn, test, alpha)
        cells = [
            f"{a:.3f}" + (f", {share:.0%}" if name in TARGETS else "") for name in names for a, share in [found[name]]
        ]
        print(f"| {alpha:g} | {' | '.join(cells)} |", flush=True)
    draw(learn.radiance[0]).quantize(128).save(out / "targets.png", optimize=True)


if __name__ == "__main__":
    run_command(main)
