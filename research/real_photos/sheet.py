"""Real photos to be looked at: each with its mask, and for each model the map, three spheres and a vase in its light.

    python -m research.real_photos.sheet FOLDER... -o runs/real [--masks] [--model lift --model OTHER]

Every photo of a folder is taken. With --masks the mask NAME_mask.png beside NAME.*, or the one that lights.csv names,
is given where there is one; otherwise the default call finds its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from PIL import Image, ImageDraw

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.errors import AnyprobeError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.sheet import draw_overlay
from anyprobe.files.atomic import atomic_path
from anyprobe.files.objects import open_object
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.render.spheres import sphere_images
from research.model_names import titles_of
from research.real_photos.folders import masks_of, photos_of

ROW, CAPTION, PAGE = 150, 14, 10
"""Height of pictures and captions [px]; photos on a page."""
Tile = tuple[str, np.ndarray]
"""A caption and a picture [H, W, 3] of display values."""


def tiles_of(photo: Photo, light: Light) -> list[Tile]:
    """Return the pictures of one estimate."""
    gain = min(1.0, 0.8 / max(float(sphere_images(light.radiance, 32)["diffuse"].max()), 1e-6))
    spheres = [("", response(one * gain)) for one in sphere_images(light.radiance, ROW).values()]
    stage = Stage(
        photo, open_object("vase"), Arrangement(size=0.6, ground=light.ground, long_fov_deg=light.origin.long_fov_deg)
    )
    pitch = "" if light.pitch_deg is None else f"pitch {light.pitch_deg:.0f} deg"
    return [("", response(light.radiance * gain)), *spheres, (pitch, stage.relit(light.radiance, "matte"))]


def row_of(path: Path, mask: Path | None, estimators: Mapping[str, Estimator]) -> Image.Image:
    """Draw one photo's lines; what cannot be estimated says why."""
    lines = []
    try:
        photo = load_photo(path, mask=mask)
        first = [(path.stem, draw_overlay(photo.rgb, photo.mask))]
        for name, estimator in estimators.items():
            light = estimator.from_photo(photo)
            said = f"{len(light.sources())} sources, {len(light.warnings)} warnings"
            (_, drawn), *rest = tiles_of(photo, light)
            lines.append([*first, (f"{name}: {said}", drawn), *rest])
    except AnyprobeError as error:
        lines.append([(f"{path.stem}: {error}", np.ones((ROW, ROW, 3)))])
    return strip(lines)


def strip(lines: Sequence[Sequence[Tile]]) -> Image.Image:
    """Draw lines of pictures of one height, with their captions."""
    width = max(sum(_width(picture) for _, picture in line) for line in lines)
    sheet = Image.new("RGB", (width, len(lines) * (ROW + CAPTION)), "white")
    for number, line in enumerate(lines):
        left, top = 0, number * (ROW + CAPTION)
        for caption, picture in line:
            tile = Image.fromarray(to_bytes(picture)).resize((_width(picture), ROW), Image.Resampling.BICUBIC)
            sheet.paste(tile, (left, top))
            ImageDraw.Draw(sheet).text((left + 2, top + ROW), caption[:120], "black")
            left += _width(picture)
    return sheet


def write_pages(rows: Sequence[Image.Image], out: Path) -> Iterator[Path]:
    """Write page_0.jpg, page_1.jpg ... of PAGE rows each, and yield their paths."""
    for first in range(0, len(rows), PAGE):
        shown = rows[first : first + PAGE]
        page = Image.new("RGB", (max(row.width for row in shown), sum(row.height for row in shown)), "white")
        top = 0
        for row in shown:
            page.paste(row, (0, top))
            top += row.height
        path = out / f"page_{first // PAGE}.jpg"
        with atomic_path(path) as temporary:
            page.save(temporary, "JPEG", quality=85)
        yield path


def _width(picture: np.ndarray) -> int:
    return max(1, round(picture.shape[1] * ROW / picture.shape[0]))


def main(
    *folders: Annotated[Path, Parameter(help="Folders of photos.")],
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for page_0.jpg, page_1.jpg ...")],
    model: Annotated[list[str] | None, Parameter(help="Bundled model or folder; repeat for more.")] = None,
    masks: Annotated[bool, Parameter(name="--masks", help="Give the masks that the folders have.")] = False,
) -> None:
    """Draw the pages."""
    names = model or [DEFAULT_MODEL]
    estimators = {title: Estimator(name) for name, title in zip(names, titles_of(names), strict=True)}
    rows = []
    for folder in folders:
        given = masks_of(folder) if masks else {}
        rows += [row_of(path, given.get(path), estimators) for path in photos_of(folder)]
    for path in write_pages(rows, out):
        print(path)


if __name__ == "__main__":
    run_command(main)
