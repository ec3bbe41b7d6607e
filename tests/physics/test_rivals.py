"""The rivals of Fig. 4 against closed forms, and where Eq. 5's irradiance meets them."""

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.frames import normalize, reflect, rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.sampling import hammersley
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import shade_specular
from anyprobe.render.rivals import grey_mirror, uniform_irradiance

AXES = normalize(np.array([[1.0, 0.2, -0.3], [0.1, 1.0, 0.4], [-0.5, 0.3, 1.0]]))
"""Where the red, green and blue lobe point."""


def lobes(d, power=1):
    """One lobe a channel: L = 1 + cos^power to its axis, [..., 3] -> [..., 3]."""
    return 1 + np.maximum(d @ AXES.T, 0 if power > 1 else -1) ** power


def lobe_pyramid(power=1, turn=None):
    d = pixel_directions(64) if turn is None else pixel_directions(64) @ turn
    return build_pyramid(lobes(d, power).astype(np.float32), side=128)


@pytest.fixture
def points():
    """Normals all around, each seen from up to 70 degrees: n, wo [P, 3]."""
    rng = np.random.default_rng(4)
    n = normalize(rng.normal(size=(80, 3)))
    wo = normalize(n + rng.uniform(0, 0.94, (80, 1)) * normalize(rng.normal(size=(80, 3))))
    return n.astype(np.float32), wo.astype(np.float32)


def test_constant_light_stays_constant(points):
    n, wo = points
    color = np.array([0.3, 1.0, 2.0], np.float32)
    pyramid = build_pyramid(np.broadcast_to(color, (8, 16, 3)), side=16)
    np.testing.assert_allclose(uniform_irradiance(pyramid, n, hammersley(64)), color + 0 * n, rtol=1e-5)
    np.testing.assert_allclose(grey_mirror(pyramid, n, wo), luminance(color) + 0 * n, rtol=1e-5)


@pytest.mark.parametrize("count", [64, 1024])
def test_hemisphere_mean_of_one_lobe(points, count):
    """L = 1 + cos(d, a): the mean over the hemisphere about n is 1 + (n.a) / 2."""
    n, _ = points
    got = uniform_irradiance(lobe_pyramid(), n, hammersley(count))
    coarse = 0.05 if count == 64 else 0.006  # 64 samples read 8 x 8 texels
    np.testing.assert_allclose(got, 1 + 0.5 * n @ AXES.T, atol=coarse)


def test_hemisphere_mean_against_a_sum_over_the_map(points):
    """A sharp lobe, no sampling: sum of L dw over the pixels above the horizon, over 2 pi."""
    n, _ = points
    d = pixel_directions(64).astype(np.float64)
    above = (d @ n[:20].T > 0) * pixel_solid_angles(64)[..., None]
    expected = np.einsum("hwp,hwc->pc", above, lobes(d, 20)) / above.sum(axis=(0, 1))[:, None]
    got = uniform_irradiance(lobe_pyramid(20), n[:20], hammersley(4096))
    np.testing.assert_allclose(got, expected, rtol=0.01)


def test_world_turned_with_the_normals_changes_nothing(points):
    n, wo = points
    turn = (rotation_y(1.1) @ rotation_x(0.6)).astype(np.float32)
    still, turned = lobe_pyramid(4), lobe_pyramid(4, turn)
    u = hammersley(512)
    np.testing.assert_allclose(
        uniform_irradiance(turned, n @ turn.T, u), uniform_irradiance(still, n, u), rtol=0.02
    )
    np.testing.assert_allclose(
        grey_mirror(turned, n @ turn.T, wo @ turn.T), grey_mirror(still, n, wo), rtol=0.02
    )


def test_mirror_is_the_luminance_at_the_mirrored_direction(points):
    n, wo = points
    got = grey_mirror(lobe_pyramid(4), n, wo)
    np.testing.assert_allclose(got[:, 0], luminance(lobes(reflect(wo, n), 4)), rtol=0.01)
    np.testing.assert_array_equal(got, got[:, :1] + 0 * got)


def distances(power, alpha, points):
    """RMS between luminances: of Eq. 5's irradiance and the mirror image, and the even mean."""
    n, wo = points
    pyramid, u = lobe_pyramid(power), hammersley(512)
    weighted = luminance(shade_specular(pyramid, n, wo, alpha, u)[0])
    rms = lambda other: float(np.sqrt(np.mean((weighted - luminance(other)) ** 2)))  # noqa: E731
    return rms(grey_mirror(pyramid, n, wo)), rms(uniform_irradiance(pyramid, n, u))


def test_weighted_irradiance_begins_as_the_mirror_in_colour(points):
    """alpha 0.01: its luminance is the mirror image, which lost the colours."""
    n, wo = points
    weighted, _, _ = shade_specular(lobe_pyramid(8), n, wo, 0.01, hammersley(64))
    mirror = grey_mirror(lobe_pyramid(8), n, wo)
    np.testing.assert_allclose(luminance(weighted), mirror[:, 0], rtol=0.015)
    assert np.abs(weighted - mirror).max() > 0.3


def test_weighted_irradiance_goes_from_the_mirror_to_the_even_mean(points):
    """The rougher, the further from the one and the closer to the other."""
    mirror, even = zip(*(distances(20, alpha, points) for alpha in (0.01, 0.1, 0.3, 1.0)), strict=True)
    assert list(mirror) == sorted(mirror)
    assert list(even) == sorted(even, reverse=True)
    assert mirror[0] < 0.05 * even[0]
    assert even[-1] < 0.4 * mirror[-1]


def test_weighted_irradiance_ends_as_the_even_mean_seen_along_the_normal(points):
    """alpha 1, wo = n: the samples of Eq. 4 are even over the hemisphere."""
    n, _ = points
    weighted, _, _ = shade_specular(lobe_pyramid(8), n, n, 1.0, hammersley(4096))
    np.testing.assert_allclose(weighted, uniform_irradiance(lobe_pyramid(8), n, hammersley(1024)), rtol=0.015)


def test_torch_gives_other_numbers(points):
    torch = pytest.importorskip("torch", reason="torch is an extra")
    n, wo = points
    image = lobes(pixel_directions(16), 4).astype(np.float32)
    here, there = build_pyramid(image, side=32), build_pyramid(torch.asarray(image), side=32)
    u = hammersley(64)
    tn, two = torch.asarray(n), torch.asarray(wo)
    even = uniform_irradiance(there, tn, torch.asarray(u)).numpy()
    np.testing.assert_allclose(even, uniform_irradiance(here, n, u), rtol=1e-4)
    np.testing.assert_allclose(grey_mirror(there, tn, two).numpy(), grey_mirror(here, n, wo), rtol=1e-4)
