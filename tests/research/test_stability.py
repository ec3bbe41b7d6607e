"""The same photo given in another way: what differs, and that an answer that follows it is said not to move."""

import numpy as np
import pytest
from PIL import Image
from support.scenes import sphere_photo

from anyprobe.light.dominant_light import find_dominant_light
from research.real_photos import stability

NAMES = ["mirrored", "mask 2 px wider", "mask 2 px narrower", "cropped by 5 px", "+0.5 EV", "-0.5 EV"]


@pytest.fixture
def files(tmp_path):
    """A sphere in a photo, and its mask."""
    photo = sphere_photo(center=(90, 40), diameter=40)
    Image.fromarray(photo[..., :3]).save(tmp_path / "sphere.png")
    Image.fromarray(photo[..., 3]).save(tmp_path / "sphere_mask.png")
    return tmp_path / "sphere.png", tmp_path / "sphere_mask.png"


def test_each_variant_changes_what_it_says():
    rng = np.random.default_rng(1)
    rgb, mask = rng.integers(0, 256, (80, 100, 3), np.uint8), np.zeros((80, 100), np.uint8)
    mask[30:50, 20:60] = 255
    made = dict(stability.variants(rgb, mask, 60.0))
    assert list(made) == ["", *NAMES]
    np.testing.assert_array_equal(made["mirrored"][0][:, ::-1], rgb)
    assert (made["mirrored"][1][:, ::-1] == mask).all()
    for name, pixels in (("wider", 24 * 44), ("narrower", 16 * 36)):
        assert (made[f"mask 2 px {name}"][1] > 0).sum() == pixels
    cropped, fov_deg = made["cropped by 5 px"][0], made["cropped by 5 px"][2]
    assert cropped.shape == (70, 90, 3)
    assert np.tan(np.radians(fov_deg / 2)) / np.tan(np.radians(30)) == pytest.approx(0.9)
    assert made["-0.5 EV"][0].mean() < rgb.mean() < made["+0.5 EV"][0].mean()


class TowardsTheObject:
    """An estimator whose light is where the object stands: it turns with the photo."""

    def from_photo(self, photo):
        rows, columns = np.nonzero(photo.mask > 0.5)
        height, width = photo.mask.shape
        focal = max(height, width) / 2 / np.tan(np.radians(photo.long_fov_deg / 2))
        d = np.array([(columns.mean() + 0.5 - width / 2) / focal, (height / 2 - rows.mean() - 0.5) / focal, -1.0])
        self.light = d / np.linalg.norm(d)
        return self

    def dominant_light(self):
        light = find_dominant_light(np.ones((64, 128, 3), np.float32))
        object.__setattr__(light, "direction", self.light)
        return light


def test_an_answer_that_follows_the_photo_does_not_move(files):
    moved = stability.moved_lights(*files, TowardsTheObject())
    assert list(moved) == ["default", "object alone"]
    for row in moved.values():
        assert list(row) == NAMES
        assert max(row.values()) < 0.2
    rows = stability.summary({"one": moved, "two": moved})
    assert rows["default, mirrored"]["photos"] == 2
    assert rows["default, mirrored"]["largest_deg"] == moved["default"]["mirrored"]


class ToTheRight:
    """An estimator that says the right of every photo, which mirrored is the left."""

    def from_photo(self, photo):
        return self

    def dominant_light(self):
        radiance = np.full((64, 128, 3), 0.1, np.float32)
        radiance[31:33, 95:97] = 100.0
        return find_dominant_light(radiance)


def test_an_answer_that_does_not_turn_with_the_photo_moves(files):
    row = stability.moved_lights(*files, ToTheRight())["default"]
    assert row.pop("mirrored") == pytest.approx(180, abs=1)
    assert max(row.values()) == 0
