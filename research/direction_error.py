"""How far off an estimate's dominant light is, from the estimate alone.

    python -m research.direction_error DATA --kept DIR    # DIR: left-out, frozen, whole (research.world.whole render)

A light whose map is brighter on its side is found more reliably: the error is fitted as

    error not exceeded in two of three cases = factor (angle to the map's mean direction + offset)^exponent

to left-out pairs and left-out whole photos, and checked on the test parts, in thirds of what it says.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import track

from anyprobe.cli.app import main as run_command
from anyprobe.core.contract import contract
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import DEFAULT_MODEL, Models
from anyprobe.evaluate.metrics import direction_error_deg
from anyprobe.light.dominant_light import angle_to_mean, find_dominant_light
from research.paper_chain import pairs_of
from research.world.whole_photos import whole_photos
from research.world.whole_rows import SHIPPED, rows_of

SHARE = 2 / 3
OFFSET_DEG: float = contract("dominant_light")["error"]["offset_deg"]
EXPONENTS = np.arange(0.3, 1.25, 0.05)


def maps_of(part: str, data: Path, kept: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Estimate and truth, [64, 128, 3] each, of all pairs and whole photos of "left-out" or "test"."""
    models, estimator = Models(DEFAULT_MODEL, threads=1), Estimator(DEFAULT_MODEL, threads=1)
    name = "left-out" if part == "left-out" else "frozen"
    for pair in pairs_of(name, data, kept / name):
        yield models(pair.crop, pair.tan_half).radiance, pair.radiance
    for photo in whole_photos(data, part, kept / "whole"):
        yield rows_of(photo, estimator)[SHIPPED].radiance, photo.truth


def measured(part: str, data: Path, kept: Path) -> tuple[np.ndarray, np.ndarray]:
    """Degrees from dominant light to mean direction, and from it to the true dominant light, of each."""
    off, error = [], []
    for estimate, truth in track(maps_of(part, data, kept), part):
        main = find_dominant_light(estimate)
        off.append(angle_to_mean(estimate, main.direction))
        error.append(direction_error_deg(main.direction, find_dominant_light(truth).direction))
    return np.array(off), np.array(error)


def fitted(off: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Factor and exponent of the least quantile loss of ln error."""
    best = (np.inf, 0.0, 0.0)
    for exponent in EXPONENTS:
        rest = np.log(error + 1.0) - exponent * np.log(off + OFFSET_DEG)
        level = float(np.quantile(rest, SHARE))
        loss = float(np.maximum(SHARE * (rest - level), (SHARE - 1) * (rest - level)).mean())
        best = min(best, (loss, float(np.exp(level)), float(exponent)))
    return best[1], best[2]


def report(part: str, said: np.ndarray, error: np.ndarray) -> None:
    """Print what is said and what is true, in thirds of what is said."""
    for third, which in zip(("surest", "middle", "least sure"), np.array_split(np.argsort(said), 3), strict=True):
        kept = float((error[which] <= said[which]).mean())
        print(
            f"{part}, {third}: said {np.median(said[which]):.0f} degrees, true median {np.median(error[which]):.0f}, "
            f"not exceeded in {kept:.2f} +- {np.sqrt(kept * (1 - kept) / len(which)):.2f} of {len(which)}"
        )


def main(data: Path, kept: Annotated[Path, typer.Option(help="Folder of rendered pairs and photos.")]) -> None:
    """Fit on the left-out parts, check on the test parts."""
    off, error = measured("left-out", data, kept)
    factor, exponent = fitted(off, error)
    print(f"factor {factor:.3g}, exponent {exponent:.2f}")
    for part in ("left-out", "test"):
        if part == "test":
            off, error = measured(part, data, kept)
        report(part, factor * (off + OFFSET_DEG) ** exponent, error)


if __name__ == "__main__":
    run_command(lambda: typer.run(main))
