"""The hidden ring: what is compared, with what, and what is left out."""

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_directions
from research.real_photos import hidden
from research.real_photos.hidden import FOV_DEG, KEPT

HEIGHT, WIDTH = 240, 320
FOCAL = WIDTH / 2 / np.tan(np.radians(FOV_DEG / 2))


def picture_of(colors) -> np.ndarray:
    """A photo [HEIGHT, WIDTH, 3] of a place that has colors(directions) far away."""
    row, column = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    d = np.stack([(column - WIDTH / 2) / FOCAL, (HEIGHT / 2 - row) / FOCAL, -np.ones_like(row)], axis=-1)
    return colors(d / np.linalg.norm(d, axis=-1, keepdims=True)).astype(np.float32)


def slopes(d: np.ndarray) -> np.ndarray:
    """Colours that differ everywhere: red to the right, green upwards."""
    return np.stack([0.5 + 0.8 * d[..., 0], 0.5 + 0.8 * d[..., 1], np.full(d.shape[:-1], 0.3)], axis=-1)


@pytest.fixture
def mask() -> np.ndarray:
    """An object a little beside the middle."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[90:160, 120:190] = 255
    return mask


def test_the_ring_is_the_photo_without_the_crop_where_the_map_has_it(mask):
    """A map that is the place itself has no error there, one turned by a pixel has one."""
    ring = hidden.ring_of(picture_of(slopes), mask)
    x, y, z = np.moveaxis(pixel_directions(64), -1, 0)
    across, up = FOCAL * x / -z / (WIDTH / 2), FOCAL * y / -z / (HEIGHT / 2)
    size = np.maximum(abs(across), abs(up))
    assert (ring.where == ((z < 0) & (size > KEPT) & (size < 1))).mean() > 0.999
    assert ring.crop.shape == (144, 192, 3)
    assert np.tan(np.radians(ring.fov_deg / 2)) == pytest.approx(KEPT * np.tan(np.radians(FOV_DEG / 2)))
    true = slopes(pixel_directions(64))
    scores = hidden.score_ring(ring, {"truth": true, "turned": np.roll(true, 1, axis=1)})
    assert scores["truth"]["rmse"] < 0.01 < scores["turned"]["rmse"]
    assert abs(scores["truth"]["tilt"]) < 0.02
