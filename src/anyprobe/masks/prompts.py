"""Prompts: checks of clicks and boxes, in pixels from the top left of the photo as shown; and their drawing as an input
channel of the mask network, in inference and training.
"""

from collections.abc import Sequence

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.errors import InvalidMask
from anyprobe.masks.check import MIN_OBJECT_PX

CLICK_SIGMA_PX = float(contract("mask")["small"]["click_sigma_px"])
BOX_LEVEL = contract("mask")["small"]["box_level"]

Point = tuple[float, float]
Clicks = Point | Sequence[Point]


def draw_prompts(
    size: int, on: Sequence[Point] = (), off: Sequence[Point] = (), box: Sequence[float] | None = None
) -> np.ndarray:
    """Draw the prompt channel [size, size] float32 in [-1, 1]; zero where nothing is given.

    BOX_LEVEL inside the box, or the larger of that and a Gaussian of height 1 around each click on the object, less the
    largest Gaussian of height 1 around the clicks beside it.

    Args:
        on: x, y of clicks on the object, in pixels of this picture; pixel i covers [i, i + 1).
        off: the same for clicks beside it.
        box: x0, y0, x1, y1 around it; a pixel is inside if its centre is.
    """
    centre = np.arange(size) + 0.5
    hint = np.zeros((size, size), np.float32)
    if box is not None:
        x0, y0, x1, y1 = box
        rows, columns = (centre >= y0) & (centre < y1), (centre >= x0) & (centre < x1)
        hint[np.ix_(rows, columns)] = BOX_LEVEL
    for point in on:
        hint = np.maximum(hint, _blob(centre, point))
    excluded = np.zeros_like(hint)
    for point in off:
        excluded = np.maximum(excluded, _blob(centre, point))
    return np.clip(hint - excluded, -1.0, 1.0)


def _blob(centre: np.ndarray, point: Point) -> np.ndarray:
    across, down = (np.exp(-0.5 * ((centre - at) / CLICK_SIGMA_PX) ** 2) for at in point)
    return np.outer(down, across).astype(np.float32)


def check_clicks(clicks: Clicks, width: int, height: int, name: str = "click") -> list[Point]:
    """Convert one or several x, y to a list of points; InvalidMask if they are not numbers or lie outside the photo."""
    try:
        points = np.asarray(clicks, dtype=np.float64)
        points = points.reshape(-1, 2) if points.ndim == 1 and points.size in (0, 2) else points
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError
    except (TypeError, ValueError) as error:
        raise InvalidMask(f"expected X,Y in pixels, or several of them, got {clicks!r}", subject=name) from error
    for x, y in points:
        if not (0 <= x < width and 0 <= y < height):
            raise InvalidMask(
                f"expected X,Y with 0 <= X < {width} and 0 <= Y < {height}, got {x:g},{y:g}; "
                "count pixels from the top left of the photo as shown, upright",
                subject=name,
            )
    return [(float(x), float(y)) for x, y in points]


def check_box(box: Sequence[float], width: int, height: int) -> tuple[float, float, float, float]:
    """Convert a box to four numbers; InvalidMask if it is outside the photo, too small, or the whole photo."""
    try:
        x0, y0, x1, y1 = (float(v) for v in box)
    except (TypeError, ValueError) as error:
        raise InvalidMask(f"expected four numbers X0,Y0,X1,Y1 in pixels, got {box!r}", subject="box") from error
    shown = f"{x0:g},{y0:g},{x1:g},{y1:g}"
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise InvalidMask(
            f"expected X0,Y0,X1,Y1 with 0 <= X0 < X1 <= {width} and 0 <= Y0 < Y1 <= {height}, "
            f"got {shown}; count pixels from the top left of the photo as shown, upright",
            subject="box",
        )
    if max(x1 - x0, y1 - y0) < MIN_OBJECT_PX:
        raise InvalidMask(
            f"expected an object at least {MIN_OBJECT_PX} pixels across, got the box {shown}; "
            "draw it around the whole object, or use a larger photo",
            subject="box",
        )
    if (x1 - x0) * (y1 - y0) >= width * height:
        text = f"expected some background around the box, got the whole photo {shown}; draw it closer"
        raise InvalidMask(text, subject="box")
    return x0, y0, x1, y1
