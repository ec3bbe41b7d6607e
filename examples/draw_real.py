"""Draw docs/real.jpg: a real photo, a golden and a plaster sphere put into it, and the panorama of its place.

    python examples/draw_real.py [PHOTO]

The light is what `anyprobe relight PHOTO --box 152,218,322,336` estimates, one estimate for both spheres; where they
stand, --at, and how high they are, --scale, is chosen. Nothing else is given.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import cyclopts
import numpy as np
from cyclopts import Parameter
from PIL import Image, ImageDraw, ImageFont

import anyprobe
from anyprobe.core.color import to_bytes
from anyprobe.files.objects import open_object
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import Arrangement, Stage

ROOT = Path(__file__).parents[1]
PHOTO = ROOT / "examples" / "teapot.jpg"
BOX = 152, 218, 322, 336
"""Around the teapot, without its saucer, in pixels of PHOTO."""
SPHERES = {"gold": (382, 351), "plaster": (110, 351)}
"""Materials, and the pixels of PHOTO where they stand."""
SCALE = 0.45
SIDE = 512
"""Of PHOTO, pixels: a larger copy is shrunk to it."""
SHOWN = 0, 100, 512, 484
"""What is shown of the photo: x0, y0, x1, y1."""
WIDTH, GAP, LABEL = 424, 4, 24


def main(photo: Annotated[Path, Parameter(help="The teapot's photo, square.")] = PHOTO, /) -> None:
    """Write photo, photo with spheres, and panorama in one picture."""
    with Image.open(photo) as image:
        pixels = np.asarray(image.convert("RGB").resize((SIDE, SIDE), Image.Resampling.LANCZOS))
    before = anyprobe.load_photo(pixels, box=BOX)
    light = anyprobe.estimate(before)
    around = light.panorama(256, frame="camera").radiance * np.float32(least_scale(before, light.radiance))
    after = before
    for material, foot in SPHERES.items():
        arrangement = Arrangement(size=SCALE, at=foot, ground=light.ground)
        stage = Stage(after, open_object("sphere"), arrangement)
        after = replace(after, rgb=stage.relit(around, material))
    panels = [_fitted(one.rgb, SHOWN, WIDTH) for one in (before, after)]
    place = _fitted(light.panorama(512).display(), None, 2 * WIDTH + GAP)
    sheet = Image.new("RGB", (place.width, 2 * LABEL + panels[0].height + place.height), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for index, (title, panel) in enumerate(zip(("photo", "with a golden and a plaster sphere"), panels, strict=True)):
        draw.text((index * (WIDTH + GAP), 3), title, fill="black", font=font)
        sheet.paste(panel, (index * (WIDTH + GAP), LABEL))
    below = LABEL + panels[0].height
    draw.text((0, below + 3), "the place around, as estimated: panorama, level", fill="black", font=font)
    sheet.paste(place, (0, below + LABEL))
    sheet.save(ROOT / "docs" / "real.jpg", quality=86, optimize=True)


def _fitted(display: np.ndarray, part: tuple[int, int, int, int] | None, width: int) -> Image.Image:
    picture = Image.fromarray(to_bytes(display))
    picture = picture if part is None else picture.crop(part)
    return picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    cyclopts.run(main)
