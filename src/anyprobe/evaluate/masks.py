"""How well masks are found: IoU of the network and of baselines, on photos whose masks are known."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.files.images import read_image
from anyprobe.masks.grabcut import cut_seeded, cut_surroundings, mask_from_box
from anyprobe.masks.propose import MaskNetwork
from anyprobe.masks.refine import refine, resize
from anyprobe.masks.sources import mask_from_file

BOX_MARGIN = 0.04
"""A told box leaves so much of the object's longer side free on every side."""

Found = np.ndarray | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """A photo [H, W, 3], its object's mask [H, W] in [0, 1], a click x, y on it and a box around it."""

    name: str
    rgb: np.ndarray
    mask: np.ndarray
    click: tuple[float, float]
    box: tuple[float, float, float, float]


def photo_cases(folder: Path) -> Iterator[Case]:
    """Photos NAME.* with NAME_mask.png beside them; the click is the pixel deepest inside the mask."""
    for mask_path in sorted(folder.glob("[!.]*_mask.png")):
        stem = mask_path.stem.removesuffix("_mask")
        path = next(p for p in sorted(folder.iterdir()) if p.stem == stem)
        pixels = read_image(path)
        mask = mask_from_file(mask_path, pixels.rgb.shape[:2])
        rows, columns = np.nonzero(mask > 0.5)
        corners = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        yield make_case(stem, pixels.rgb, mask, deepest_point(mask), corners)


def deepest_point(mask: np.ndarray) -> tuple[float, float]:
    """x, y of the point of a mask that is furthest from everything outside, to a 64th of the longer side."""
    height, width = mask.shape
    step = max(1, round(max(height, width) / 64))
    inside = np.pad(mask[step // 2 :: step, step // 2 :: step] > 0.5, 1)
    last = inside
    while inside.any():
        last = inside
        inside = inside.copy()
        inside[1:-1, 1:-1] &= last[:-2, 1:-1] & last[2:, 1:-1] & last[1:-1, :-2] & last[1:-1, 2:]
    rows, columns = np.nonzero(last)
    middle = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return (columns[middle] - 1) * step + step // 2 + 0.5, (rows[middle] - 1) * step + step // 2 + 0.5


def iou(found: Found, true: np.ndarray) -> float:
    """Intersection over union of the two masks cut at one half; 0 where nothing was found."""
    if found is None:
        return 0.0
    a, b = found > 0.5, true > 0.5
    return float((a & b).sum() / max((a | b).sum(), 1))


def methods(network: MaskNetwork) -> dict[str, Callable[[Case], Found]]:
    """What is compared, by name: told what, found how."""

    def proposed(given: dict, finish: Callable[[Case, np.ndarray, dict], Found]) -> Callable[[Case], Found]:
        def find(case: Case) -> Found:
            asked = {name: tell(case) for name, tell in given.items()}
            return finish(case, network.propose(case.rgb, **asked).cover, asked)

        return find

    def plain(case: Case, cover: np.ndarray, asked: dict) -> Found:
        return resize(cover, case.rgb.shape[1], case.rgb.shape[0])

    def guided(case: Case, cover: np.ndarray, asked: dict) -> Found:
        return refine(case.rgb, cover)

    def cut(case: Case, cover: np.ndarray, asked: dict) -> Found:
        return cut_seeded(case.rgb, cover, asked.get("on", ()))

    def grabcut_box(case: Case) -> Found:
        try:
            return mask_from_box(case.rgb, case.box)
        except ValueError:
            return None

    given = {"nothing": {}, "click": {"on": lambda case: [case.click]}, "box": {"box": lambda case: case.box}}
    table = {}
    for name, tell in given.items():
        table[f"{name}: network"] = proposed(tell, plain)
        table[f"{name}: network, guided filter"] = proposed(tell, guided)
        table[f"{name}: network, GrabCut"] = proposed(tell, cut)
    table["nothing: ellipse in the middle"] = lambda case: _ellipse(
        case.mask.shape, tuple(share * side for share in (0.25, 0.75) for side in case.mask.shape[::-1])
    )
    table["nothing: GrabCut in the middle"] = lambda case: grabcut_box(
        replace(case, box=tuple(share * side for share in (0.15, 0.85) for side in case.mask.shape[::-1]))
    )
    table["click: GrabCut around it"] = lambda case: cut_surroundings(case.rgb, case.click)
    table["box: GrabCut"] = grabcut_box
    table["box: ellipse in it"] = lambda case: _ellipse(case.mask.shape, case.box)
    return table


def _ellipse(shape: tuple[int, int], box: tuple[float, float, float, float]) -> np.ndarray:
    """The ellipse that touches a box x0, y0, x1, y1, as a mask [H, W] bool."""
    x0, y0, x1, y1 = box
    y, x = np.ogrid[: shape[0], : shape[1]]
    across, down = (2 * (x + 0.5) - x0 - x1) / (x1 - x0), (2 * (y + 0.5) - y0 - y1) / (y1 - y0)
    return across**2 + down**2 <= 1.0


def make_case(name: str, rgb, mask, click, corners) -> Case:
    """A case; its box is corners x0, y0, x1, y1 widened by BOX_MARGIN inside the photo."""
    height, width = mask.shape
    x0, y0, x1, y1 = (float(v) for v in corners)
    more = BOX_MARGIN * max(x1 - x0, y1 - y0)
    box = (max(x0 - more, 0.0), max(y0 - more, 0.0), min(x1 + more, width), min(y1 + more, height))
    return Case(name=name, rgb=np.ascontiguousarray(rgb), mask=mask, click=click, box=box)
