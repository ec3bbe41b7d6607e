"""The square of a photo that the paper's networks see."""

import numpy as np
import pytest

from anyprobe.estimate.light_graph import graph_inputs
from anyprobe.estimate.runtime import crop_of


@pytest.mark.parametrize("at", [(30, 40), (0, 40), (30, 0)])
@pytest.mark.parametrize("size", [8, 64])
def test_a_crop_shows_the_object_alone_in_its_own_colours(at, size):
    """An object of 20 x 20 pixels, at the photo's border too, where the square goes on over it."""
    rgb, mask = np.full((80, 100, 3), 0.9, np.float32), np.zeros((80, 100), np.float32)
    inside = slice(at[0], at[0] + 20), slice(at[1], at[1] + 20)
    rgb[inside], mask[inside] = (0.2, 0.4, 0.6), 1.0
    image, frame = crop_of(graph_inputs(rgb, mask, 60.0), size)
    assert image.shape == (size, size, 4)
    cover = image[..., 3:]
    np.testing.assert_allclose(image[..., :3], cover * np.float32([0.2, 0.4, 0.6]), atol=1e-6)
    np.testing.assert_allclose(cover.mean(), 1 / 1.1**2, rtol=0.03)
    np.testing.assert_allclose(frame[3, 1:], [at[1] + 10, at[0] + 10])
    assert cover[0].max() < 0.8
    assert cover[size // 2, size // 2] == pytest.approx(1.0, abs=1e-6)


def test_a_smaller_square_of_a_slope_has_its_means():
    rgb = np.repeat(np.linspace(0, 1, 64, dtype=np.float32)[None, :, None], 64, axis=0).repeat(3, axis=2)
    image, _ = crop_of(graph_inputs(rgb, np.ones((64, 64), np.float32), 60.0), 16)
    inner = image[4:-4, 4:-4, 0]
    np.testing.assert_allclose(np.diff(inner, axis=1), 1.1 * 4 / 63, atol=1e-3)
