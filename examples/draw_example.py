"""Draw docs/example.png: a photo, a golden sphere inserted with the estimated light, and the same with the true light.

    python examples/draw_example.py

The scene is examples/table.py's, whose light is known. The errors of the estimate are written into the picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from table import LONG_FOV_DEG, PITCH_DEG, Table, emitter

import anyprobe
from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.estimate.photo import load_photo
from anyprobe.files.objects import open_object
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.render.spheres import diffuse
from anyprobe_train.evaluate.metrics import color_angle_deg, direction_error_deg, power_ratio_stops

WIDTH, GAP, LABEL = 424, 4, 24
TITLES = ("photo", "golden sphere, estimated light", "golden sphere, true light")
GREY = (60, 60, 60)


def main(root: Path) -> None:
    """Estimate, insert by both lights, write the sheet."""
    picture = np.asarray(Image.open(root / "examples" / "table.png"))
    photo = load_photo(picture[..., :3], mask=picture[..., 3], fov_deg=LONG_FOV_DEG)  # no cut-out
    light = anyprobe.Estimator().from_photo(photo)
    source, truth = true_light(*photo.rgb.shape[1::-1])
    stage = Stage(photo, open_object("sphere"), Arrangement(size=0.6, at=(455, 365), pitch_deg=PITCH_DEG))
    pictures = [photo.rgb] + [stage.relit(map_, "gold") for map_ in (light.radiance, truth)]
    panels = [fitted(picture) for picture in pictures]
    maps = [fitted(response(map_)) for map_ in (light.radiance, truth)]
    height = panels[0].height
    sheet = Image.new("RGB", (3 * WIDTH + 2 * GAP, LABEL + height + LABEL + maps[0].height), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    below = LABEL + height
    for index, (title, panel) in enumerate(zip(TITLES, panels, strict=True)):
        left = index * (WIDTH + GAP)
        draw.text((left, 3), title, fill="black", font=font)
        sheet.paste(panel, (left, LABEL))
    for index, (title, map_) in enumerate(zip(("estimated", "true"), maps, strict=True), 1):
        left = index * (WIDTH + GAP)
        draw.text((left, below + 3), f"{title} environment map", fill="black", font=font)
        sheet.paste(map_, (left, below + LABEL))
    draw.multiline_text((0, below + LABEL), errors(light, source, truth), fill=GREY, font=font, spacing=8)
    sheet.save(root / "docs" / "example.png", optimize=True)


def true_light(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """What examples/table.png was drawn under: the emitter alone, and all of it, both [64, 128, 3]."""
    table = Table(width, height)
    azimuth_deg, color = emitter(0.0)
    gain = table.gain(azimuth_deg, color)
    source = gain * color * table.emitter(azimuth_deg)
    return reduced(source, MAP_HEIGHT), reduced(gain * table.coarse + source, MAP_HEIGHT)


def errors(light: anyprobe.Light, source: np.ndarray, truth: np.ndarray) -> str:
    """One line for each error of the estimate."""
    angle = direction_error_deg(light.dominant_light().direction, find_dominant_light(source).direction)
    spheres = diffuse(light.radiance, MAP_HEIGHT), diffuse(truth, MAP_HEIGHT)
    color = color_angle_deg(*spheres, spheres[1].sum(axis=-1) > 0)
    return (
        "Errors of this estimate\n"
        f"direction of the strongest light: {angle:.0f} degrees\n"
        f"colour of a white sphere: {color:.0f} degrees\n"
        f"total power: {power_ratio_stops(light.radiance, truth):+.1f} stops"
    )


def fitted(picture: np.ndarray) -> Image.Image:
    """A display picture at WIDTH."""
    image = Image.fromarray(to_bytes(picture))
    return image.resize((WIDTH, round(WIDTH * image.height / image.width)), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main(Path(__file__).parent.parent)
