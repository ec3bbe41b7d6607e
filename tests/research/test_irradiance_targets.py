"""Targets of an irradiance network: what each is of a map that is known."""

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.sampling import hammersley
from anyprobe.render.integrate import shade_specular, shading_pyramid
from research.irradiance_targets.targets import TARGETS, lit, metal_and_irradiance, seen, weights
from research.limits.sphere import sphere_points


@pytest.mark.parametrize("target", TARGETS)
def test_a_constant_map_is_seen_as_it_is(target):
    rows = weights(target, 0.3, sphere_points())
    np.testing.assert_allclose(rows.sum(axis=1), 1, rtol=1e-4)
    assert rows.min() >= 0


def test_mirror_image_is_the_light_of_the_mirrored_direction_in_grey():
    """The sphere's middle mirrors what is behind the camera, at +Z."""
    radiance = np.zeros((1, 64, 128, 3), np.float32)
    radiance[0, pixel_directions(64)[..., 2] > 0.9] = (1.0, 0.0, 0.0)
    middle = np.array([[0.0, 0.0, 1.0]], np.float32)
    np.testing.assert_allclose(seen("mirror, grey", 0.5, radiance, middle)[0, 0], 0.2126, atol=1e-4)


def test_uniform_sampling_does_not_know_alpha_and_eq_5_does():
    n = sphere_points()[::40]
    assert np.array_equal(weights("uniform", 0.1, n), weights("uniform", 1.0, n))
    assert np.abs(weights(TARGETS[0], 0.1, n) - weights(TARGETS[0], 1.0, n)).sum() > 1


def test_irradiance_is_the_renderers():
    rng = np.random.default_rng(0)
    radiance = np.repeat(np.repeat(rng.random((8, 16, 3), np.float32), 8, axis=0), 8, axis=1)
    n = sphere_points()[::30]
    n = n[n[:, 2] > 0.3]
    wo = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), n.shape)
    irradiance, specular, _ = shade_specular(shading_pyramid(radiance, 0.4), n, wo, np.float32(0.4), hammersley(4096))
    np.testing.assert_allclose(seen(TARGETS[0], 0.4, radiance[None], n)[0], irradiance, rtol=0.03)
    np.testing.assert_allclose(lit(metal_and_irradiance(0.4, n)[0], radiance[None])[0], specular, rtol=0.03)
