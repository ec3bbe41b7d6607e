"""By default what the photo shows around the object is used, unless the networks do not take it for the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import anyprobe
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import load_photo

EXAMPLES = Path(__file__).parents[2] / "examples"
GREEN = np.array([0.7, 1.0, 0.6])
FOV_DEG, PITCH_DEG = 60.0, 25.0


def on_a_table() -> tuple[np.ndarray, np.ndarray]:
    """The example's photo [H, W, 3] uint8, and its mask."""
    with Image.open(EXAMPLES / "table.jpg") as photo, Image.open(EXAMPLES / "table.png") as mask:
        return np.array(photo.convert("RGB")), np.array(mask.getchannel("A"))


@pytest.mark.parametrize("pitch_deg", [PITCH_DEG, None])
def test_below_the_horizon_the_light_takes_the_ground_s_colour(pitch_deg):
    photo, mask = on_a_table()
    given = {"mask": mask, "fov_deg": FOV_DEG, "pitch_deg": pitch_deg}
    tinted = np.where(mask[..., None] > 0, photo, (photo * GREEN).astype(np.uint8))
    before, light = (anyprobe.estimate(one, **given) for one in (photo, tinted))
    down = -pixel_directions(64) @ up_of(PITCH_DEG)
    ground = (pixel_directions(64)[..., 2] > 0.3) & (down > 0.6)  # what the camera cannot see
    found, was = (one.radiance[ground].mean(axis=0) for one in (light, before))
    tint = np.log(found[1] / found[[0, 2]]) - np.log(was[1] / was[[0, 2]])
    assert (tint > 0.1).all()


def test_the_ground_is_given_or_estimated():
    photo, mask = on_a_table()
    given = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, pitch_deg=PITCH_DEG).ground
    assert (given.pitch_deg, given.source) == (PITCH_DEG, "given")
    found = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG)
    assert found.ground.source == "estimated"
    assert -20 < found.ground.pitch_deg < 80
    assert found.sidecar()["ground"]["pitch_deg"] == round(found.ground.pitch_deg, 2)
    assert anyprobe.estimate(photo, mask=mask, surroundings="none").ground is None


@pytest.mark.ci
def test_transparent_corners_say_nothing_whatever_their_colours():
    photo, mask = on_a_table()
    alpha = np.full(mask.shape, 255, np.uint8)
    alpha[:, :120] = alpha[400:, 500:] = 0
    maps, details = [], []
    for color in (0, 255):
        cut = np.dstack([np.where(alpha[..., None] > 0, photo, np.uint8(color)), alpha])
        loaded = load_photo(cut, mask=mask, fov_deg=FOV_DEG)
        maps.append(anyprobe.estimate(cut, mask=mask, fov_deg=FOV_DEG).radiance)
        details.append(anyprobe.Estimator().from_photo(loaded).seen)
    np.testing.assert_array_equal(maps[0], maps[1])
    np.testing.assert_allclose(*(one[..., :3] * (one[..., 3:] > 0) for one in details), atol=0.05)
    whole = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG).radiance
    assert np.abs(np.log(maps[0].mean() / whole.mean())) < 0.3, "the light is that of what is seen"


@pytest.mark.parametrize("background", ["transparent", "white", "flaws", "backdrop"])
def test_cut_outs_say_what_the_object_alone_says(background):
    photo, mask = on_a_table()
    rng = np.random.default_rng(1)
    photo[mask == 0] = 250
    if background == "flaws":  # as of JPEG around the object
        photo[40:52][mask[40:52] == 0] = rng.integers(190, 256, ((mask[40:52] == 0).sum(), 3))
    if background == "backdrop":  # paper that is lit from above
        rows = np.linspace(90, 160, len(photo))[:, None, None]
        paper = rows + rng.integers(-1, 2, photo.shape)
        photo[mask == 0] = paper[mask == 0]
    if background == "transparent":
        photo[mask == 0] = rng.integers(0, 255, ((mask == 0).sum(), 3))
        photo, mask = np.dstack([photo, mask]), None
    auto = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG)
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    assert auto.ground is None
    assert auto.plate is None
    assert "surroundings" not in auto.info["hints"]
    far = np.abs(response(auto.radiance) - response(alone.radiance)).mean()
    assert far < (1e-4 if background == "transparent" else 0.12)


@pytest.mark.parametrize(("grey", "opaque", "said"), [(250, True, True), (0, True, False), (250, False, False)])
def test_a_backdrop_that_is_not_used_is_said(grey, opaque, said):
    """White may be a studio's; black and transparency are a cut-out's."""
    photo, mask = on_a_table()
    photo[mask == 0] = grey
    given = {"mask": mask, "fov_deg": FOV_DEG} if opaque else {"fov_deg": FOV_DEG}
    photo = photo if opaque else np.dstack([photo, mask])
    light = anyprobe.estimate(photo, **given)
    assert any(one.code == "plain-backdrop" for one in light.warnings) == said
    assert light.ground is None
    asked = anyprobe.estimate(photo, **given, surroundings="photo")
    assert asked.ground is not None
    assert "plain-backdrop" not in [one.code for one in asked.warnings]


def test_alpha_that_is_zero_everywhere_cuts_nothing_out():
    photo, mask = on_a_table()
    empty = np.dstack([photo, np.zeros_like(mask)])
    assert load_photo(empty, mask=mask, fov_deg=FOV_DEG).ground == load_photo(photo, mask=mask, fov_deg=FOV_DEG).ground
