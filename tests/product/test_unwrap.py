"""Rivals' pictures unwrapped: every direction comes from where it was seen."""

import numpy as np

from anyprobe.core.frames import reflect
from anyprobe.core.latlong import pixel_directions
from anyprobe.evaluate.unwrap import push_pull, unwrap_ball, unwrap_mirror
from anyprobe.render.balls import ball_normals
from anyprobe.render.reflectance import reflectance_disc


def test_ball_of_directions_unwraps_to_them():
    n, _ = reflectance_disc(64)
    wi = 2 * n[..., 2:] * n - np.array([0, 0, 1])
    d = pixel_directions(64)
    found = unwrap_ball(wi)
    cosine = (found * d).sum(-1) / np.linalg.norm(found, axis=-1)
    error = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    front = d[..., 2] > -0.9  # the last 26 degrees are the rim's few pixels
    assert error[front].max() < 6.0
    assert error[front].mean() < 1.0


def test_mirror_values_land_in_their_directions():
    normals, _ = ball_normals(128)
    wo = np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape)
    found = unwrap_mirror(reflect(wo, normals), normals, wo)
    d = pixel_directions(64)
    cosine = (found * d).sum(-1) / np.linalg.norm(found, axis=-1)
    assert np.degrees(np.arccos(np.clip(cosine[d[..., 2] > -0.7], -1, 1))).max() < 10.0


def test_push_pull_keeps_what_is_known_and_fills_the_rest():
    rng = np.random.default_rng(0)
    values = rng.random((64, 128, 1))
    known = rng.random((64, 128, 1)) < 0.1
    filled = push_pull(values, known)
    np.testing.assert_allclose(filled[known], values[known], rtol=1e-6)
    assert values[known].min() - 1e-6 <= filled.min() <= filled.max() <= values[known].max() + 1e-6
    even = push_pull(np.where(known, 0.3, 9.0), known)
    np.testing.assert_allclose(even, 0.3, rtol=1e-5)
    assert not push_pull(values, np.zeros_like(known)).any()


def test_a_hole_is_like_its_neighbours():
    values = np.where(pixel_directions(64)[..., :1] > 0, 1.0, 0.0)
    known = np.ones_like(values, bool)
    known[28:36, 92:100] = False  # around +X, all ones about it
    assert push_pull(np.where(known, values, 0.0), known)[31:33, 95:97].min() > 0.9
