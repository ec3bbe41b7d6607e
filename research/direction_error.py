"""How far off an estimate's dominant light is, from the estimate alone.

    python -m research.direction_error LEFT_OUT...    # folders of research.scenes pairs --part left-out, or test

A light whose map is bright elsewhere too is found less reliably: the error is fitted as

    error not exceeded in two of three cases = factor (spread about the light + offset)^exponent

to pairs of all families, photos and cut-outs, and reported in thirds of what it says, by family.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.cli.app import main as run_command
from anyprobe.core.contract import contract
from anyprobe.estimate.runtime import Models
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.dominant_light import ERROR, ESTIMATED_ERROR, direction_error, find_dominant_light, spread_about
from anyprobe_train.evaluate.metrics import direction_error_deg
from anyprobe_train.whole_network.families import FAMILIES
from research.scenes.estimates import estimates_of

SHARE = 2 / 3
OFFSET_DEG: float = contract("dominant_light")["error"]["offset_deg"]
EXPONENTS = np.arange(0.3, 1.85, 0.05)
CUT_OUT = "cut-out"


def measured(folder: Path, models: Models) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return spreads about the dominant light, of the map alone and of the expected one, its error [degrees], and the
    group, of each pair."""
    spread, expected, error, group = [], [], [], []
    for one in estimates_of(sorted(folder.glob("*.npz")), models):
        estimate = one.shipped()
        main = find_dominant_light(estimate)
        spread.append(spread_about(estimate, main.direction))
        expected.append(spread_about(one.expected, main.direction, ESTIMATED_ERROR))
        error.append(direction_error_deg(main.direction, find_dominant_light(one.truth).direction))
        group.append(CUT_OUT if one.is_cut_out else FAMILIES[one.family])
    return np.array(spread), np.array(expected), np.array(error), np.array(group)


def fitted(spread: np.ndarray, error: np.ndarray, offset_deg: float = OFFSET_DEG) -> tuple[float, float]:
    """Return factor and exponent of the least quantile loss of ln error."""
    best = (np.inf, 0.0, 0.0)
    for exponent in EXPONENTS:
        rest = np.log(error + 1.0) - exponent * np.log(spread + offset_deg)
        level = float(np.quantile(rest, SHARE))
        loss = float(np.maximum(SHARE * (rest - level), (SHARE - 1) * (rest - level)).mean())
        best = min(best, (loss, float(np.exp(level)), float(exponent)))
    return best[1], best[2]


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return Spearman's correlation of two rows without ties."""
    return float(np.corrcoef(np.argsort(np.argsort(a)), np.argsort(np.argsort(b)))[0, 1])


def report(name: str, said: np.ndarray, error: np.ndarray) -> None:
    """Print what is said and what is true."""
    kept = float((error <= said).mean())
    print(
        f"{name}: said {np.median(said):.0f} degrees, true median {np.median(error):.0f}, not exceeded in "
        f"{kept:.2f} +- {np.sqrt(kept * (1 - kept) / len(said)):.2f} of {len(said)}, "
        f"rank correlation {rank_correlation(said, error):.2f}"
    )


def main(
    folders: Annotated[list[Path], typer.Argument(help="The first is fitted to; all are reported on.")],
    model: Annotated[str, typer.Option(help="Bundled model or folder.")] = DEFAULT_MODEL,
) -> None:
    """Fit on the first folder's pairs; print what ships, by folder, third and family."""
    models = Models(model, threads=1)
    for number, folder in enumerate(folders):
        *spreads, error, group = measured(folder, models)
        for name, spread, own in zip(("map alone", "expected map"), spreads, (ERROR, ESTIMATED_ERROR), strict=True):
            if number == 0:
                factor, exponent = fitted(spread, error, own["offset_deg"])
                print(f"{name}: factor {factor:.3g}, exponent {exponent:.2f}")
            said = np.array([direction_error(one, own) for one in spread])
            where = f"{folder.name}, {name}"
            report(where, said, error)
            thirds = np.array_split(np.argsort(said), 3)
            for third, which in zip(("surest", "middle", "least sure"), thirds, strict=True):
                report(f"{where}, {third}", said[which], error[which])
            for family in (*FAMILIES, CUT_OUT):
                if (group == family).any():
                    report(f"{where}, {family}", said[group == family], error[group == family])


if __name__ == "__main__":
    run_command(lambda: typer.run(main))
