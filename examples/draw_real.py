"""Draw docs/real.jpg and docs/outdoors.jpg: a real photo, a golden and a plaster sphere put into it, and its panorama.

    python examples/draw_real.py [NAME ...]

The light is what `anyprobe relight PHOTO --box BOX` estimates, one estimate for both spheres; where they stand, --at,
and how high they are, --scale, is chosen. Nothing else is given. Photos: teapot, oriento (Unsplash licence); duck,
Nataniel Ruiz (CC BY 4.0, made smaller); both from google/dreambooth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

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
WIDTH, GAP, LABEL = 424, 4, 24


@dataclass(frozen=True)
class Scene:
    """A photo, what is given of it, and what is shown. In pixels of the photo.

    Attributes:
        box: around the object: x0, y0, x1, y1.
        spheres: where the sphere of each material stands.
        scale: height of the spheres, in heights of the object.
        shown: the part of the photo that is drawn: x0, y0, x1, y1.
    """

    photo: str
    picture: str
    box: tuple[int, int, int, int]
    spheres: dict[str, tuple[int, int]]
    scale: float
    shown: tuple[int, int, int, int]


SCENES = {
    "teapot": Scene(
        photo="teapot.jpg",
        picture="real.jpg",
        box=(152, 218, 322, 336),
        spheres={"gold": (382, 351), "plaster": (110, 351)},
        scale=0.45,
        shown=(0, 100, 512, 484),
    ),
    "duck": Scene(
        photo="duck.jpg",
        picture="outdoors.jpg",
        box=(160, 205, 356, 380),
        spheres={"gold": (440, 366), "plaster": (392, 452)},
        scale=0.45,
        shown=(0, 100, 512, 484),
    ),
}


def main(*names: Annotated[Literal["teapot", "duck"], Parameter(help="Without any, both.")]) -> None:
    """Write the picture of each scene."""
    for name in names or SCENES:
        draw(SCENES[name])


def draw(scene: Scene) -> None:
    """Write photo, photo with spheres, and panorama in one picture."""
    before = anyprobe.load_photo(ROOT / "examples" / scene.photo, box=scene.box)
    light = anyprobe.estimate(before)
    around = light.panorama(256, frame="camera", lit=True).radiance * np.float32(least_scale(before, light.radiance))
    after = before
    for material, foot in scene.spheres.items():
        seen = {"ground": light.ground, "long_fov_deg": light.origin.long_fov_deg}
        arrangement = Arrangement(size=scene.scale, at=foot, likely=light.dominant_light().exists, **seen)
        stage = Stage(after, open_object("sphere"), arrangement)
        after = replace(after, rgb=stage.relit(around, material))
    panels = [_fitted(one.rgb, scene.shown, WIDTH) for one in (before, after)]
    place = _fitted(light.panorama(512).display(), None, 2 * WIDTH + GAP)
    sheet = Image.new("RGB", (place.width, 2 * LABEL + panels[0].height + place.height), "white")
    drawn, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for index, (title, panel) in enumerate(zip(("photo", "with a golden and a plaster sphere"), panels, strict=True)):
        drawn.text((index * (WIDTH + GAP), 3), title, fill="black", font=font)
        sheet.paste(panel, (index * (WIDTH + GAP), LABEL))
    below = LABEL + panels[0].height
    drawn.text((0, below + 3), "the place around, as estimated: panorama, level", fill="black", font=font)
    sheet.paste(place, (0, below + LABEL))
    sheet.save(ROOT / "docs" / scene.picture, quality=86, optimize=True)


def _fitted(display: np.ndarray, part: tuple[int, int, int, int] | None, width: int) -> Image.Image:
    picture = Image.fromarray(to_bytes(display))
    picture = picture if part is None else picture.crop(part)
    return picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    cyclopts.run(main)
