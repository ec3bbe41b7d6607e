"""Samplers against their densities and inverses."""

import numpy as np
import pytest
from support.chi2 import assert_follows_pdf
from support.warps import (
    cosine_hemisphere_pdf,
    cosine_hemisphere_to_square,
    ggx_normal_pdf,
    ggx_normal_to_square,
    ggx_visible_normal_pdf,
    ggx_visible_normal_to_square,
    square_to_ggx_normal,
    square_to_ggx_visible_normal,
)

from anyprobe.core.frames import dot, normalize, orthonormal_basis, reflect, world_from_local
from anyprobe.core.sampling import hammersley, square_to_cosine_hemisphere

ALPHAS = (0.05, 0.3, 1.0)
VIEWS_DEG = (0, 45, 75)
NUM_TESTS = 2 + 3 * len(ALPHAS) + 2 * len(VIEWS_DEG)


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_hammersley_repeats_or_clumps():
    """64 points put exactly one in every 1/64 of both axes and one in every 8 x 8 cell."""
    u = hammersley(64)
    for axis in range(2):
        assert sorted((u[:, axis] * 64).astype(int)) == list(range(64))
    cells = (u * 8).astype(int)
    assert len(np.unique(cells[:, 0] * 8 + cells[:, 1])) == 64


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.37, 0.91), (0.5 - 1e-12, 1.0 - 1e-12), (-0.2, 3.4)])
def test_hammersley_leaves_the_unit_square(shift):
    """1 itself is the horizon, where densities are 0; float32 rounding must not reach it."""
    for count in (1, 100):
        u = hammersley(count, shift)
        assert u.shape == (count, 2)
        assert u.min() >= 0
        assert u.max() < 1


def test_shift_changes_the_pattern():
    """Shifted points are the old ones moved with wrap-around, not clamped."""
    moved = (hammersley(64).astype(np.float64) + (0.3, 0.8)) % 1
    np.testing.assert_allclose(hammersley(64, (0.3, 0.8)), moved, atol=1e-6)


def test_cosine_sampler_against_its_density(rng):
    assert_follows_pdf(square_to_cosine_hemisphere, cosine_hemisphere_pdf, rng, NUM_TESTS)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_ggx_sampler_against_its_density(alpha, rng):
    assert_follows_pdf(lambda u: square_to_ggx_normal(u, alpha), lambda h: ggx_normal_pdf(h, alpha), rng, NUM_TESTS)


def view(angle_deg, azimuth_deg=130.0):
    """wo in the local frame, tilted by angle_deg from n = +Z."""
    angle, azimuth = np.radians(angle_deg), np.radians(azimuth_deg)
    return np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)])


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("view_deg", [20, 80])
def test_visible_normals_against_their_density(alpha, view_deg, rng):
    wo = view(view_deg)
    assert_follows_pdf(
        lambda u: square_to_ggx_visible_normal(u, wo, alpha),
        lambda h: ggx_visible_normal_pdf(h, wo, alpha),
        rng,
        NUM_TESTS,
    )


@pytest.mark.parametrize("alpha", [0.01, *ALPHAS])
@pytest.mark.parametrize("view_deg", [0.0, 60.0, 89.0])
def test_visible_normal_inverse(alpha, view_deg, rng):
    u, wo = rng.random((2000, 2)), view(view_deg)
    h = square_to_ggx_visible_normal(u, wo, alpha)
    np.testing.assert_allclose(np.linalg.norm(h, axis=-1), 1, atol=1e-12)
    assert (h @ wo > 0).all()
    away = np.abs(ggx_visible_normal_to_square(h, wo, alpha) - u)
    np.testing.assert_allclose(np.minimum(away, [1, 2] - away), 0, atol=1e-6)  # azimuth 0 is azimuth 1


@pytest.mark.parametrize("alpha", [0.3, 1.0])
@pytest.mark.parametrize("view_deg", VIEWS_DEG)
def test_reflected_directions_miss_the_jacobian(view_deg, alpha, rng):
    """wi = reflect(wo, h) has density D (n.h) / (4 wo.h), below the horizon too.

    The cells' pole is wo: around -wo the density grows like 1 / (wo.h), which only
    the pole's own sine takes back.
    """
    wo = np.array([0.0, 0.0, 1.0])
    n = np.array([[np.sin(np.radians(view_deg)), 0.0, np.cos(np.radians(view_deg))]])
    tangent, bitangent = orthonormal_basis(n)

    def sample(u):
        h = world_from_local(square_to_ggx_normal(u, alpha), n)
        return reflect(wo[None], h)[h[:, 2] > 0]

    def pdf(wi):
        h = normalize(wo + wi)
        local = np.concatenate([dot(h, tangent), dot(h, bitangent), dot(h, n)], axis=-1)
        return ggx_normal_pdf(local, alpha) / (4 * h[..., 2])

    assert_follows_pdf(sample, pdf, rng, NUM_TESTS)


def test_tilted_frame_loses_the_density(rng):
    """Carried to a normal below the horizon, the cosine density turns with it."""
    n = normalize(np.array([0.5, -0.3, -0.8]))
    assert_follows_pdf(
        lambda u: world_from_local(square_to_cosine_hemisphere(u), n),
        lambda d: np.maximum(d @ n, 0) / np.pi,
        rng,
        NUM_TESTS,
    )


def test_cosine_inverse(rng):
    u = rng.random((2000, 2))
    np.testing.assert_allclose(cosine_hemisphere_to_square(square_to_cosine_hemisphere(u)), u, atol=1e-9)


@pytest.mark.parametrize("alpha", [0.01, *ALPHAS])
def test_ggx_inverse(alpha, rng):
    u = rng.random((2000, 2))
    np.testing.assert_allclose(ggx_normal_to_square(square_to_ggx_normal(u, alpha), alpha), u, atol=1e-7)


def test_torch_samples_differ():
    torch = pytest.importorskip("torch", reason="torch is an extra")
    u = hammersley(64).astype(np.float64)
    wo = view(40)
    got = square_to_ggx_visible_normal(torch.asarray(u), torch.asarray(wo), 0.3).numpy()
    np.testing.assert_allclose(got, square_to_ggx_visible_normal(u, wo, 0.3), atol=1e-12)
    np.testing.assert_allclose(
        square_to_cosine_hemisphere(torch.asarray(u)).numpy(), square_to_cosine_hemisphere(u), atol=1e-12
    )
