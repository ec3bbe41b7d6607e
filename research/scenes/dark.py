"""What dark surroundings are worth: errors of the dominant light with and without them, by how dark they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from anyprobe.light.dominant_light import find_dominant_light
from anyprobe_train.evaluate.metrics import direction_error_deg
from anyprobe_train.whole_network.families import FAMILIES
from research.scenes.estimates import PairEstimate

BOUNDS = (0.0, 0.2, 0.35, 0.5, 0.7, 1.0, 2.0, np.inf)
"""Of the mean display luminance beside the object over the object's."""


def dark_rows(estimates: Iterable[PairEstimate]) -> Iterator[tuple[int, float, float, float]]:
    """Yield family, darkness beside the object, and angles [degrees] between the true dominant light and that of the
    object alone and of the whole photo, for each pair with surroundings."""
    for one in estimates:
        if not one.is_cut_out:
            truth = find_dominant_light(one.truth).direction
            alone, whole = (
                direction_error_deg(find_dominant_light(guess).direction, truth) for guess in (one.alone, one.whole)
            )
            yield one.family, one.beside, alone, whole


def dark_table(rows: np.ndarray) -> Iterator[str]:
    """Yield lines of medians and means by darkness, and by family."""
    for low, high in zip(BOUNDS[:-1], BOUNDS[1:], strict=True):
        some = rows[(rows[:, 1] >= low) & (rows[:, 1] < high)]
        if len(some):
            yield f"beside / object {low:.2f} to {high:.2f}: {_said(some)}"
    for number, family in enumerate(FAMILIES):
        some = rows[rows[:, 0] == number]
        if len(some):
            share = (some[:, 1] < BOUNDS[2]).mean()
            yield f"{family}: {_said(some)}, {100 * share:.0f} % below {BOUNDS[2]}"


def _said(rows: np.ndarray) -> str:
    alone, whole = rows[:, 2], rows[:, 3]
    figures = (f"{np.median(one):.1f} / {one.mean():.1f}" for one in (alone, whole))
    return "{} photos, dominant light median / mean: object alone {}, whole photo {}".format(len(rows), *figures)
