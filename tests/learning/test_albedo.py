"""The coat's directional albedo: against quadrature of the BRDF itself, and in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.scatter.materials import Material, brdf
from anyprobe_train.dataset.reflectance import albedo_table, directional_albedo

N = np.array([0.0, 0.0, 1.0])


def sent_back(f0: float, alpha: float, cosine: float) -> float:
    """Integral of the coat's f (n.wi) dwi over a grid in the half vector's polar angle and azimuth."""
    rows, columns = 1200, 400
    s = (np.arange(rows) + 0.5) / rows
    theta = np.pi / 2 * s**3  # crowds the pole, where a narrow lobe is
    phi = (np.arange(columns) + 0.5) * 2 * np.pi / columns
    t, p = np.meshgrid(theta, phi, indexing="ij")
    h = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    solid_angle = np.sin(t) * (np.pi / 2 * 3 * s**2 / rows)[:, None] * (2 * np.pi / columns)
    wo = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    facing = h @ wo
    wi = 2 * facing[..., None] * h - wo
    grey = Material(albedo=np.zeros(3), f0=np.full(3, f0), alpha=alpha)
    f = brdf(grey, wo + 0 * wi, wi, N + 0 * wi)[..., 0]
    return float((f * wi[..., 2].clip(min=0) * 4 * facing.clip(min=0) * solid_angle).sum())


@pytest.mark.ci
@pytest.mark.parametrize("cosine", [0.97, 0.6, 0.25, 0.08])
@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.5, 0.9])
def test_table_is_not_the_brdfs_integral(alpha, cosine):
    one, grazing = directional_albedo(np.array([cosine]), np.array([alpha]), albedo_table())
    assert one[0] == pytest.approx(sent_back(1.0, alpha, cosine), abs=0.006)
    assert grazing[0] == pytest.approx(sent_back(0.0, alpha, cosine), abs=0.006)


def test_mirror_loses_light():
    """A narrow lobe sends all back, and at n.wo the share that Schlick's term gives."""
    cosine = np.array([0.95, 0.7, 0.4])
    one, grazing = directional_albedo(cosine, np.full(3, 0.01), albedo_table())
    np.testing.assert_allclose(one, 1.0, atol=0.005)
    np.testing.assert_allclose(grazing, (1 - cosine) ** 5, atol=0.004)


def test_arguments_are_not_broadcast():
    one, grazing = directional_albedo(np.full((3, 1), 0.5), np.full(4, 0.3), albedo_table())
    assert one.shape == grazing.shape == (3, 4)
