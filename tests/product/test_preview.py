"""The preview that estimate writes: what is clipped, what the captions say."""

from __future__ import annotations

import numpy as np
import pytest

import anyprobe
from anyprobe.estimate import sheet
from anyprobe.estimate.sheet import CAPTION, GAP, PANORAMA_ROW, ROW, draw_matches, draw_preview
from anyprobe.scatter.materials import MATERIALS


@pytest.fixture
def captions(monkeypatch) -> list[str]:
    """Captions in the order drawn."""
    seen: list[str] = []
    arrange = sheet._captioned

    def listed(rows):
        seen.extend(caption for row in rows for caption, _ in row)
        return arrange(rows)

    monkeypatch.setattr(sheet, "_captioned", listed)
    return seen


@pytest.mark.ci
@pytest.mark.parametrize(
    ("radiance", "exposure"), [(0, "0 EV"), (0.2, "0 EV"), (0.9, "0 EV"), (1.1, "-0.5 EV"), (2.7, "-1.5 EV")]
)
def test_a_bright_light_clips_no_white_sphere(photo_path, captions, radiance, exposure):
    photo = anyprobe.load_photo(photo_path)
    light = anyprobe.Light(radiance=np.full((64, 128, 3), radiance, np.float32))
    picture = draw_preview(light.panorama(), photo)
    assert captions[0].startswith("panorama, in the frame of the camera, ")
    assert captions[1:] == ["photo", "mask", *(f"{sphere}, {exposure}" for sphere in ("matte", "satin", "mirror"))]
    assert all(name in MATERIALS for name in ("matte", "satin", "mirror"))
    width = round(photo.rgb.shape[1] * ROW / photo.rgb.shape[0])
    middle = GAP + 2 * (width + GAP) + ROW // 2
    shown = picture[2 * GAP + PANORAMA_ROW + CAPTION + ROW // 2, middle]
    assert (shown < 1).all()
    assert (shown > 0.6).all() or radiance < 0.9


@pytest.mark.ci
@pytest.mark.parametrize(("name", "drawn"), [("sünset", "sunset"), ("日\n1", "??1")])
def test_names_of_maps_are_drawn_in_letters_that_the_font_has(photo_path, name, drawn):
    photo = anyprobe.load_photo(photo_path)
    named, plain = (draw_matches(photo, [(one, np.ones((64, 128, 3), np.float32))]) for one in (name, drawn))
    np.testing.assert_array_equal(named, plain)


def test_a_narrow_photo_keeps_its_captions_apart(photo_rgba, captions):
    narrow = anyprobe.load_photo(np.tile(photo_rgba[:, 48:80], (4, 1, 1)))  # 21 pixels wide in the preview
    light = anyprobe.Light(radiance=np.ones((64, 128, 3), np.float32))
    whole = draw_preview(light.panorama(), narrow)
    assert whole.shape == (PANORAMA_ROW + ROW + 2 * (CAPTION + GAP) + GAP, 2 * PANORAMA_ROW + 2 * GAP, 3)
    below = 2 * GAP + PANORAMA_ROW + CAPTION + ROW
    gap = whole[below + 1 : below + CAPTION]
    lit = np.flatnonzero((gap > 0.5).any(axis=(0, 2)))
    assert (np.diff(lit) >= GAP).sum() == 4  # between five captions
