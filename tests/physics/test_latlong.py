"""The map's grid: each test is one way to shift, mirror or tear it."""

import numpy as np
import pytest

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles, uv_to_direction


def random_directions(count, seed=0):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("height", [4, 64, 256])
def test_midpoint_solid_angles_miss_the_sphere(height):
    """sin(theta) dtheta dphi at row centres sums to 4 pi (1 + 1e-4) at 64 rows; exact bands do not."""
    total = 2 * height * pixel_solid_angles(height).astype(np.float64).sum()
    np.testing.assert_allclose(total, 4 * np.pi, rtol=2e-7)


def test_solid_angle_is_that_of_the_row_not_of_its_neighbour():
    """A flipped or shifted row order keeps the sum; the cap above row k must be 2 pi (1 - cos)."""
    above = np.cumsum(64 * pixel_solid_angles(32)[:, 0].astype(np.float64))
    cap = 2 * np.pi * (1 - np.cos(np.arange(1, 33) * np.pi / 32))
    np.testing.assert_allclose(above, cap, rtol=1e-6)


@pytest.mark.parametrize(
    ("d", "uv"),
    [
        ((0, 0, -1), (0.5, 0.5)),
        ((1, 0, 0), (0.75, 0.5)),
        ((-1, 0, 0), (0.25, 0.5)),
        ((0.001, 0, 1), (1.0, 0.5)),
        ((-0.001, 0, 1), (0.0, 0.5)),
    ],
)
def test_quarter_turn_or_mirror_of_the_frame(d, uv):
    """-Z is the centre column, +X lies right of it, the seam is behind the camera."""
    d = np.array(d, np.float64)
    np.testing.assert_allclose(direction_to_uv(d / np.linalg.norm(d)), uv, atol=2e-4)


def test_map_upside_down():
    """+Y is the top row, -Y the bottom one."""
    assert direction_to_uv(np.array([0.0, 1.0, 0.0]))[1] == 0.0
    assert direction_to_uv(np.array([0.0, -1.0, 0.0]))[1] == 1.0
    assert (pixel_directions(8)[0, :, 1] > 0.9).all()


def test_uv_is_not_the_inverse_of_direction():
    d = random_directions(2000)
    np.testing.assert_allclose(uv_to_direction(direction_to_uv(d)), d, atol=1e-7)


def test_pixel_centres_off_by_half():
    """Pixel (row, column) looks at u = (column + 0.5) / 2H, v = (row + 0.5) / H, and at unit length."""
    d = pixel_directions(16).astype(np.float64)
    row, column = np.mgrid[:16, :32]
    uv = direction_to_uv(d)
    np.testing.assert_allclose(uv[..., 0] * 32 - 0.5, column, atol=1e-4)
    np.testing.assert_allclose(uv[..., 1] * 16 - 0.5, row, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1, atol=1e-6)


def ramps(height):
    row, column = np.mgrid[:height, : 2 * height].astype(np.float64)
    return np.stack([row, column, np.zeros_like(row)], axis=-1)


def test_half_pixel_shift_of_bilinear():
    """A ramp of its own row and column index reads back the coordinate it is read at."""
    x, y = np.meshgrid(np.linspace(0.0, 30.9, 37), np.linspace(0.0, 14.9, 23))
    uv = np.stack([(x + 0.5) / 32, (y + 0.5) / 16], axis=-1)
    read = bilinear(ramps(16), uv)
    np.testing.assert_allclose(read[..., 0], y, atol=1e-9)
    np.testing.assert_allclose(read[..., 1], x, atol=1e-9)


def test_seam_has_no_jump():
    """u = 0 and u = 1 are the same place, the mean of the last and the first column."""
    image = np.random.default_rng(1).random((8, 16, 3))
    v = np.full(5, 3.5 / 8)
    read = bilinear(image, np.stack([np.array([-1e-9, 0.0, 1e-9, 1.0 - 1e-9, 1.0]), v], axis=-1))
    np.testing.assert_allclose(read, np.broadcast_to((image[3, 0] + image[3, -1]) / 2, (5, 3)), atol=1e-7)


def test_pole_reads_past_the_edge():
    """At v = 0 and v = 1 the first and last rows are read, not the opposite pole."""
    image = ramps(8)
    np.testing.assert_array_equal(bilinear(image, np.array([[0.3, 0.0], [0.3, 1.0]]))[:, 0], [0, 7])


def test_smooth_function_of_direction_survives_the_map():
    """Write cosines at the pixels, read them anywhere: ties pixel_directions to bilinear."""
    d = random_directions(500)
    d = d[np.abs(d[:, 1]) < 0.98]
    np.testing.assert_allclose(bilinear(pixel_directions(64), direction_to_uv(d)), d, atol=2e-3)


def test_torch_reads_another_pixel():
    torch = pytest.importorskip("torch", reason="torch is an extra")
    image, d = np.random.default_rng(2).random((8, 16, 3)), random_directions(300)
    uv = direction_to_uv(d)
    uv_torch = direction_to_uv(torch.asarray(d))
    np.testing.assert_allclose(uv_torch.numpy(), uv, atol=1e-12)
    np.testing.assert_allclose(bilinear(torch.asarray(image), uv_torch).numpy(), bilinear(image, uv), atol=1e-12)
