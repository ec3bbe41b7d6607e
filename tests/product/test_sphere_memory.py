"""Normals of a sphere in a large photo: what they cost, and that they are those of the whole photo."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from anyprobe.estimate import normals_hint
from anyprobe.estimate.normals_hint import normals_from_outline


def outline_of(centre: tuple[float, float, float], radius: float, shape: tuple[int, int], long_fov_deg: float):
    """Mask [H, W] of a sphere, and the normals [H, W, 3] where each ray meets it."""
    height, width = shape
    focal = max(shape) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    d = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    along = d @ np.array(centre)
    below = radius**2 - np.dot(centre, centre) + along**2
    hit = (below > 0) & (along > 0)
    s = along - np.sqrt(np.maximum(below, 0.0))
    return hit.astype(np.float32), np.where(hit[..., None], (s[..., None] * d - centre) / radius, 0.0)


@pytest.mark.parametrize("centre", [(0.0, 0.0, -4.0), (2.5, -1.0, -4.0), (-2.8, 1.6, -4.0), (0.05, 0.0, -1.7)])
def test_a_sphere_anywhere_in_a_wide_photo(centre, monkeypatch):
    mask, expected = outline_of(centre, 1.0, (240, 320), 100.0)
    found = normals_from_outline(mask, 100.0)
    both = (mask > 0) & found.any(axis=-1)
    assert both.sum() > 0.99 * max((mask > 0).sum(), found.any(axis=-1).sum())
    angle = np.degrees(np.arccos(np.clip((found * expected).sum(axis=-1)[both], -1, 1)))
    assert np.median(angle) < 0.5
    monkeypatch.setattr(normals_hint, "STRIP_PX", 1)  # a row each
    np.testing.assert_allclose(normals_from_outline(mask, 100.0), found, atol=1e-6)


@pytest.mark.parametrize("radius", [0.2, 1.05])
def test_a_large_photos_sphere_takes_little_beside_its_normals(radius):
    mask, _ = outline_of((0.1, 0.0, -2.5), radius, (1200, 1600), 60.0)
    tracemalloc.start()
    normals_from_outline(mask, 60.0)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 30 * mask.size  # 12 of them the normals; it was 118
