"""Mask errors: each changes what it may and no more, and something of the object always stays."""

import numpy as np
import pytest

from anyprobe.masks import check as masks_at_run_time
from anyprobe_train.dataset.mask_errors import KEPT_SHARE, MIN_CHANGED_PX, disturb_mask, narrow, object_px, shift, widen

SIZE = 64


def disc(radius: float = 20.0, x: float = 31.5, y: float = 31.5) -> np.ndarray:
    row, column = np.mgrid[:SIZE, :SIZE]
    return np.hypot(column - x, row - y) <= radius


def bar() -> np.ndarray:
    """Two discs and a thin rod between them: much edge, little inside."""
    mask = disc(9.0, 16.0, 20.0) | disc(9.0, 46.0, 42.0)
    for k in np.linspace(0, 1, 200):
        mask[round(20 + 22 * k), round(16 + 30 * k)] = True
    return mask


def edge_distance(mask: np.ndarray) -> np.ndarray:
    """Every pixel's distance to the nearest one of the other kind, by trying all."""
    pixels = np.stack(np.mgrid[:SIZE, :SIZE], axis=-1).reshape(-1, 2).astype(float)
    inside = mask.reshape(-1)
    distance = np.zeros(len(pixels))
    for kind in (True, False):
        away = pixels[inside == kind][:, None] - pixels[inside != kind][None]
        distance[inside == kind] = np.sqrt((away**2).sum(axis=-1)).min(axis=1)
    return distance.reshape(mask.shape)


@pytest.fixture(params=[disc, bar])
def mask(request):
    return request.param()


@pytest.mark.parametrize("pixels", [1, 2, 3])
def test_wider_and_narrower_by_just_so_many_pixels(mask, pixels):
    """All so near to the edge turns over, nothing a fifth further: a circle could do little better."""
    distance = edge_distance(mask)
    wide, thin = widen(mask, pixels), narrow(mask, pixels)
    assert wide[mask].all()
    assert not thin[~mask].any()
    assert wide[distance <= pixels].all()
    assert not thin[distance <= pixels].any()
    beyond = distance > 1.2 * pixels
    np.testing.assert_array_equal(wide[beyond], mask[beyond])
    np.testing.assert_array_equal(thin[beyond], mask[beyond])


@pytest.mark.parametrize(("right", "down"), [(2, 0), (-1, 2), (0, -2), (1, 1)])
def test_a_shift_moves_the_centre(right, down):
    mask = bar()
    moved = shift(mask, right, down)
    assert moved.sum() == mask.sum()
    before, after = (np.array(np.nonzero(m)).mean(axis=1) for m in (mask, moved))
    np.testing.assert_allclose(after - before, [down, right])


def test_something_of_the_object_always_stays(rng):
    thin = np.zeros((SIZE, SIZE), bool)
    thin[30:33, 10:40] = True
    small = disc(12.2)
    for mask in (thin, small, bar(), disc()):
        for _ in range(200):
            result = disturb_mask(mask, rng)
            assert result.dtype == bool
            assert result.shape == mask.shape
            assert object_px(result) >= MIN_CHANGED_PX
            assert (result & mask).sum() >= KEPT_SHARE * mask.sum()


def test_what_training_leaves_is_what_an_estimate_accepts():
    assert MIN_CHANGED_PX >= masks_at_run_time.MIN_OBJECT_PX
