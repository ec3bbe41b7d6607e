"""Photos whose objects' true masks are known, with the prompts that a user would give."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.masks.sources import mask_from_file
from anyprobe.pictures.images import read_image

BOX_MARGIN = 0.04
"""A given box leaves so much of the object's longer side free on every side."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """A photo [H, W, 3], its object's mask [H, W] in [0, 1], a click x, y on it and a box around it.

    group: the object, where several photos show the same. others: masks [H, W] of what else stands there, if known.
    """

    name: str
    group: str
    rgb: np.ndarray
    mask: np.ndarray
    click: tuple[float, float]
    box: tuple[float, float, float, float]
    others: tuple[np.ndarray, ...] = ()

    @property
    def box_is_whole(self) -> bool:
        """Whether the box is the whole photo, and so says nothing."""
        return (self.box[2] - self.box[0]) * (self.box[3] - self.box[1]) >= self.mask.size


def photo_cases(folder: Path) -> Iterator[Case]:
    """Photos NAME.* with NAME_mask.png beside them.

    manifest.csv, where there is one, may give the column group or object, and click "X,Y" and box "X0,Y0,X1,Y1"
    for the id or file NAME; else the click is the point deepest inside the mask and the box is around it.
    """
    rows = _manifest(folder)
    for mask_path in sorted(folder.glob("[!.]*_mask.png")):
        stem = mask_path.stem.removesuffix("_mask")
        path = next(p for p in sorted(folder.iterdir()) if p.stem == stem)
        row = rows.get(stem, {})
        pixels = read_image(path)
        mask = mask_from_file(mask_path, pixels.rgb.shape[:2])
        rows_in, columns = np.nonzero(mask > 0.5)
        corners = columns.min(), rows_in.min(), columns.max() + 1, rows_in.max() + 1
        given = row.get("click"), row.get("box")
        click = _numbers(given[0]) if given[0] else deepest_point(mask)
        case = make_case(stem, pixels.rgb, mask, click, corners, row.get("group") or row.get("object") or stem)
        if given[1]:
            case = replace(case, box=_numbers(given[1]))
        yield case


def make_case(name: str, rgb, mask, click, corners, group: str | None = None) -> Case:
    """A case; its box is corners x0, y0, x1, y1 widened by BOX_MARGIN inside the photo."""
    height, width = mask.shape
    x0, y0, x1, y1 = (float(v) for v in corners)
    more = BOX_MARGIN * max(x1 - x0, y1 - y0)
    box = (max(x0 - more, 0.0), max(y0 - more, 0.0), min(x1 + more, width), min(y1 + more, height))
    return Case(name=name, group=group or name, rgb=np.ascontiguousarray(rgb), mask=mask, click=click, box=box)


def iou(found: np.ndarray | None, true: np.ndarray) -> float:
    """Intersection over union of the two masks cut at one half; 0 where nothing was found."""
    if found is None:
        return 0.0
    a, b = found > 0.5, true > 0.5
    return float((a & b).sum() / max((a | b).sum(), 1))


def _manifest(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / "manifest.csv"
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as stream:
        return {Path(row.get("id") or row.get("file") or "").stem: row for row in csv.DictReader(stream)}


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


def deepest_point(mask: np.ndarray) -> tuple[float, float]:
    """x, y of the point of a mask [H, W] that is furthest from everything outside, to a 64th of the longer side."""
    height, width = mask.shape
    step = max(1, round(max(height, width) / 64))
    inside = np.pad(mask[step // 2 :: step, step // 2 :: step] > 0.5, 1)
    if not inside.any():
        rows, columns = np.nonzero(mask > 0.5)
        return float(columns[0]) + 0.5, float(rows[0]) + 0.5
    last = inside
    while inside.any():
        last = inside
        inside = inside.copy()
        inside[1:-1, 1:-1] &= last[:-2, 1:-1] & last[2:, 1:-1] & last[1:-1, :-2] & last[1:-1, 2:]
    rows, columns = np.nonzero(last)
    middle = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return (columns[middle] - 1) * step + step // 2 + 0.5, (rows[middle] - 1) * step + step // 2 + 0.5
