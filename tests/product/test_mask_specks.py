"""What a given mask holds beside its object leaves the crop where it is; what belongs to the object stays."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from anyprobe import estimate
from anyprobe.masks.check import look_at_given, object_box
from tests.support.refused import refused

CASES = Path(__file__).parent / "cases"
GIVEN = json.loads((CASES / "mask_specks.json").read_text(encoding="utf-8"))


def drawn(shapes) -> np.ndarray:
    """Draw shapes of the shared cases, [H, W] float32."""
    rows, columns = np.mgrid[: GIVEN["height"], : GIVEN["width"]]
    mask = np.zeros(rows.shape, np.float32)
    for kind, value, numbers in shapes:
        if kind == "salt":
            where = np.arange(mask.size).reshape(mask.shape) % numbers[0] == 0
        elif kind == "rect":
            x0, y0, x1, y1 = numbers
            where = (columns >= x0) & (columns < x1) & (rows >= y0) & (rows < y1)
        else:
            x, y, radius, *width = numbers
            where = (columns - x) ** 2 + (rows - y) ** 2 < radius**2
            if width:
                where &= (columns - x) ** 2 + (rows - y) ** 2 >= (radius - width[0]) ** 2
        mask[where] = value
    return mask


@pytest.mark.parametrize("case", GIVEN["cases"], ids=lambda case: case["name"])
def test_only_what_belongs_to_the_object_stays(case):
    shapes = case.get("object", GIVEN["object"])
    given = drawn([*shapes, *case["more"]])
    mask, said = look_at_given(given)
    assert [line.code for line in said] == case.get("said", [])
    if case.get("keeps"):
        np.testing.assert_array_equal(mask, given)
    else:
        alone = drawn(shapes)
        np.testing.assert_allclose(object_box(mask), object_box(alone), atol=case.get("slack", 0))
        assert ((mask > 0.5) != (alone > 0.5)).mean() < 1e-3


def test_a_mask_of_dust_is_refused():
    dust = drawn([["disc", 1, [100, 100, 6]], ["disc", 1, [500, 400, 6]]])
    with refused("mask", code="no-object"):
        look_at_given(dust)


def test_a_stray_pixel_leaves_the_light_where_it_was():
    photo = Path(__file__).parents[2] / "examples" / "table.jpg"
    clean = np.asarray(Image.open(CASES / "table_mask.png").convert("L"))
    stray = clean.copy()
    stray[20, 620] = 255
    one, other = (estimate(photo, mask=mask) for mask in (clean, stray))
    np.testing.assert_array_equal(one.radiance, other.radiance)
