"""The octahedral square: round trips, folds, levels."""

import numpy as np
import pytest
from support.pyramids import lookup

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions
from anyprobe.light.octahedral import Pyramid, build_pyramid, direction_to_octahedral, octahedral_to_direction


def directions(count, seed=0):
    return normalize(np.random.default_rng(seed).normal(size=(count, 3)))


def linear_map(height=64):
    """L = 1 + d / 2, one axis a channel: any fold or flip shows."""
    return (1 + 0.5 * pixel_directions(height)).astype(np.float32)


def test_square_is_not_the_inverse():
    d = directions(3000)
    st = direction_to_octahedral(d)
    assert st.min() >= 0
    assert st.max() <= 1
    np.testing.assert_allclose(octahedral_to_direction(st), d, atol=1e-7)


@pytest.mark.parametrize(
    ("d", "st"),
    [
        ((0, 1, 0), (0.5, 0.5)),
        ((1, 0, 0), (1.0, 0.5)),
        ((0, 0, 1), (0.5, 1.0)),
        ((-1, 0, 0), (0.0, 0.5)),
        ((0, 0, -1), (0.5, 0.0)),
    ],
)
def test_axes_land_elsewhere(d, st):
    np.testing.assert_allclose(direction_to_octahedral(np.array(d, np.float64)), st)


def test_down_is_not_a_corner():
    for st in ((0, 0), (0, 1), (1, 0), (1, 1)):
        np.testing.assert_allclose(octahedral_to_direction(np.array(st, np.float64)), [0, -1, 0], atol=1e-12)


@pytest.mark.parametrize("lod", [0, 1, 2, 3])
def test_fold_has_a_jump(lod):
    """Across each of the square's four edges, and at -Y where its corners meet.

    The edges are the half planes x = 0 and z = 0 below the horizon. One hundredth
    of a degree apart, a linear map may change by 1e-4, a wrong border texel by 0.1.
    """
    pyramid = build_pyramid(linear_map(), side=32)
    angle = np.linspace(0.05, np.pi / 2 - 0.02, 40)
    down, out, eps = -np.sin(angle), np.cos(angle), np.full(40, 1e-4)
    for axis, sign in ((0, 1), (0, -1), (2, 1), (2, -1)):
        sides = []
        for tilt in (eps, -eps):
            d = np.zeros((40, 3))
            d[:, axis], d[:, 1], d[:, 2 - axis] = sign * out, down, tilt
            sides.append(lookup(pyramid, normalize(d), np.full(40, float(lod))))
        np.testing.assert_allclose(sides[0], sides[1], atol=3e-4)
    surroundings = np.linspace(0, 2 * np.pi, 33)
    d = normalize(np.stack([1e-4 * np.cos(surroundings), -np.ones(33), 1e-4 * np.sin(surroundings)], axis=-1))
    read = lookup(pyramid, d, np.full(33, float(lod)))
    np.testing.assert_allclose(read, np.broadcast_to(read[0], read.shape), atol=1e-3)


@pytest.mark.parametrize("side", [4, 8, 64, 256, 2048])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_level_offset_slips_by_a_texel(side, dtype):
    """Texels that hold their own level: every read of level k, at every corner, gives k."""
    sides = [side >> k for k in range(int(np.log2(side)) - 1)]
    levels = [np.full(((s + 2) ** 2, 3), float(k), np.float32) for k, s in enumerate(sides)]
    pyramid = Pyramid(texels=np.concatenate(levels), side=side, num_levels=len(levels))
    corners = octahedral_to_direction(np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]], dtype))
    d = np.concatenate([directions(200).astype(dtype), corners])
    for k in range(len(levels)):
        read = lookup(pyramid, d, np.full(len(d), k, dtype))
        np.testing.assert_allclose(read, k, atol=1e-6)


def test_coarse_levels_lose_light():
    """Each texel of a level is the mean of four below it."""
    pyramid = build_pyramid(np.random.default_rng(5).random((16, 32, 3)).astype(np.float32), side=16)
    fine = pyramid.texels[: 18**2].reshape(18, 18, 3)[1:-1, 1:-1]
    coarse = pyramid.texels[18**2 : 18**2 + 10**2].reshape(10, 10, 3)[1:-1, 1:-1]
    np.testing.assert_allclose(coarse, fine.reshape(8, 2, 8, 2, 3).mean(axis=(1, 3)), rtol=1e-5)


def test_torch_lookup_differs():
    torch = pytest.importorskip("torch", reason="torch is an extra")
    radiance = np.random.default_rng(6).random((16, 32, 3)).astype(np.float32)
    d, lod = (directions(500).astype(np.float32), np.random.default_rng(7).uniform(-1, 6, 500).astype(np.float32))
    a, b = build_pyramid(radiance, side=32), build_pyramid(torch.asarray(radiance), side=32)
    np.testing.assert_allclose(b.texels.numpy(), a.texels, atol=1e-5)
    np.testing.assert_allclose(lookup(b, torch.asarray(d), torch.asarray(lod)).numpy(), lookup(a, d, lod), atol=1e-5)
