"""Draw a real photo with a golden and a matte sphere in it, over its panorama.

python examples/draw_real.py PHOTO MASK docs/real.jpg
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from PIL import Image

import anyprobe
from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.files.objects import open_object
from anyprobe.relight.insert import Arrangement, Stage

HEIGHT, GAP = 300, 6
"""Of the photos, and between all pictures [px]."""
SIZE = 0.6
"""Height of the spheres over the object's."""


def main(
    photo: Annotated[Path, typer.Argument(help="The photo.")],
    mask: Annotated[Path, typer.Argument(help="Its object's mask.")],
    out: Annotated[Path, typer.Argument(help="The picture to write, .jpg.")],
) -> None:
    """Write photo, photo with spheres, and panorama in one picture."""
    shown = anyprobe.load_photo(photo, mask=mask)
    light = anyprobe.estimate(shown)
    around = light.panorama(256, frame="camera").radiance
    pictures = [shown.rgb]
    for material in ("gold", "matte"):
        stage = Stage(shown, open_object("sphere"), Arrangement(size=SIZE, ground=light.ground, match_shadow=True))
        pictures.append(stage.relit(around, material, "own"))
    row = [_scaled(one, HEIGHT) for one in pictures]
    width = sum(one.width for one in row) + GAP * (len(row) - 1)
    place = _scaled(response(light.panorama(512).radiance), width // 2)
    canvas = Image.new("RGB", (width, HEIGHT + GAP + place.height), "white")
    left = 0
    for one in row:
        canvas.paste(one, (left, 0))
        left += one.width + GAP
    canvas.paste(place, (0, HEIGHT + GAP))
    canvas.save(out, quality=88)


def _scaled(display: np.ndarray, height: int) -> Image.Image:
    picture = Image.fromarray(to_bytes(display))
    return picture.resize((round(picture.width * height / picture.height), height), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    typer.run(main)
