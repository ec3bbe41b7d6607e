"""What a notebook shows: the sheet of a light, short texts, public names, and help that names real parameters."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import anyprobe
from anyprobe.masks.find import find_mask
from anyprobe.masks.networks import load_network
from anyprobe.pictures.images import read_image

ROOT = Path(__file__).parents[2]


def test_light_is_shown_as_its_sheet():
    radiance = np.full((64, 128, 3), 0.2, np.float32)
    radiance[10:13, 100:103] = 40
    light = anyprobe.Light(radiance=radiance)
    with Image.open(io.BytesIO(light._repr_png_())) as sheet:
        width, height = sheet.size
        spheres = np.asarray(sheet, np.float32)[height // 2 :].mean(axis=-1)
    assert width > 1000
    assert height > 700  # the panorama of 512 rows over the spheres of 256
    assert spheres.std() > 30
    assert re.fullmatch(r"<Light 64 x 128, dominant light towards \(.*\)>", repr(light))


@pytest.mark.ci
@pytest.mark.parametrize("segmenter", [None, "small"])
def test_the_clicks_that_the_notebook_names_find_what_its_box_does(segmenter):
    notebook = (ROOT / "docs" / "tutorials" / "first_light.ipynb").read_text(encoding="utf-8")
    pairs = dict(re.findall(r"(click|exclude)=\((\d+, \d+)\)", notebook))
    x0, y0, x1, y1 = map(int, re.search(r"box=\((\d+), (\d+), (\d+), (\d+)\)", notebook).groups())
    pixels = read_image(ROOT / "examples" / "table.jpg")
    network = None if segmenter is None else load_network(segmenter)
    boxed = find_mask(pixels, box=(x0, y0, x1, y1), segmenter=network).mask > 0.5
    points = {name: [tuple(map(int, one.split(", ")))] for name, one in pairs.items()}
    clicked = find_mask(pixels, **points, segmenter=network).mask > 0.5
    assert set(pairs) == {"click", "exclude"}
    assert (boxed & clicked).sum() > 0.9 * (boxed | clicked).sum()
