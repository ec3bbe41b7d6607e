"""Shading by importance sampling against closed forms and an independent integral of the BRDF."""

import numpy as np
import pytest
from support.shading_terms import brdf
from support.warps import square_to_ggx_normal

from anyprobe.core.frames import normalize, reflect, rotation_x, rotation_y, rotation_z, world_from_local
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.sampling import hammersley
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import lobe_lod, shade, shade_diffuse, shade_specular
from anyprobe.scatter.materials import Material

ALPHAS = (0.01, 0.05, 0.3, 0.6, 1.0)
VIEWS_DEG = (0.0, 30.0, 60.0, 80.0, 89.0)
WHITE = np.ones((8, 16, 3), np.float32)


def views(degrees=VIEWS_DEG, n=(0.48, 0.6, 0.64)):
    """One normal seen from several angles: n, wo [P, 3]."""
    n = np.broadcast_to(np.asarray(n, np.float64), (len(degrees), 3))
    side = normalize(np.cross(n, [0.0, 1.0, 0.0]))
    angle = np.radians(np.asarray(degrees))[:, None]
    return n.astype(np.float32), (np.cos(angle) * n + np.sin(angle) * side).astype(np.float32)


def smooth_radiance(d):
    """A few cosines of direction, all positive, no symmetry: [..., 3] -> [..., 3]."""
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([1.5 + x + 0.4 * y * z, 1.2 - 0.7 * z + 0.3 * x * y, 1.0 + 0.6 * y - 0.3 * x * z], axis=-1)


def smooth_pyramid(height=64, side=128, turn=None):
    """The smooth map, or the one seen after the world is turned."""
    d = pixel_directions(height)
    d = d if turn is None else d @ turn
    return build_pyramid(smooth_radiance(d).astype(np.float32), side=side)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_constant_light_depends_on_alpha_or_view(alpha):
    """Samples under the horizon are left out of Eq. 5's mean, not counted as black."""
    n, wo = views()
    pyramid = build_pyramid(0.7 * WHITE, side=16)
    irradiance, _, _ = shade_specular(pyramid, n, wo, alpha, hammersley(64))
    np.testing.assert_allclose(irradiance, 0.7, rtol=1e-6)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_irradiance_times_brdf_is_not_the_radiance(alpha):
    """Under constant light c, Eq. 4 is the product of Eq. 5: S1(c) = irradiance * S1(1)."""
    n, wo = views()
    irradiance, s1, ss = shade_specular(build_pyramid(2.5 * WHITE, side=16), n, wo, alpha, hammersley(64))
    _, s1_white, ss_white = shade_specular(build_pyramid(WHITE, side=16), n, wo, alpha, hammersley(64))
    np.testing.assert_allclose(s1, irradiance * s1_white, rtol=1e-5)
    np.testing.assert_allclose(ss, irradiance * ss_white, rtol=1e-5)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_white_furnace_glows(alpha):
    """f0 = 1 sends back at most what arrives, and a smooth surface all of it."""
    n, wo = views((0.0, 20.0, 40.0, 60.0, 75.0, 85.0, 89.0))
    _, s1, ss = shade_specular(build_pyramid(WHITE, side=4), n, wo, alpha, hammersley(4096))
    assert (s1 < 1 + 1e-3).all()
    assert (ss <= s1 + 1e-6).all()
    assert (s1 > 0.3).all()
    if alpha == 0.01:
        np.testing.assert_allclose(s1[:5], 1.0, atol=2e-3)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_white_plastic_glows(alpha):
    """Lo <= 1 up to 45 degrees; beyond, Eq. 2's own kd = 1 - F(wo.h) gives more (see test_microfacet)."""
    n, wo = views((0.0, 20.0, 45.0))
    plastic = Material(albedo=np.ones(3), f0=np.full(3, 0.04), alpha=alpha)
    shading = shade(build_pyramid(WHITE, side=4), n, wo, alpha, hammersley(4096))
    assert (shading.radiance(plastic) < 1.003).all()
    assert (shading.radiance(plastic) > 0.95).all()


def test_mirror_limit_looks_elsewhere():
    """alpha 0.01: irradiance, and S1, are the map at reflect(wo, n)."""
    rng = np.random.default_rng(0)
    n = normalize(rng.normal(size=(60, 3)))
    wo = normalize(n + 0.8 * normalize(rng.normal(size=(60, 3))))
    pyramid = smooth_pyramid()
    irradiance, s1, _ = shade_specular(pyramid, n.astype(np.float32), wo.astype(np.float32), 0.01, hammersley(64))
    mirrored = smooth_radiance(reflect(wo, n))
    np.testing.assert_allclose(irradiance, mirrored, rtol=0.01)
    np.testing.assert_allclose(s1, mirrored, rtol=0.015)


@pytest.mark.parametrize("material", ["metal", "plastic"])
@pytest.mark.parametrize("alpha", [0.15, 0.4, 1.0])
def test_samples_disagree_with_the_brdf(alpha, material):
    """sum over 2 x 96^2 directions of f_r(wo, wi) L(wi) (n.wi) dw, by brdf.evaluate alone.

    The independent path: no sampling, no density, no split into S1, Ss, Dd.
    """
    m = (
        Material(albedo=np.zeros(3), f0=np.array([1.0, 0.77, 0.34]), alpha=alpha)
        if material == "metal"
        else Material(albedo=np.array([0.7, 0.4, 0.1]), f0=np.full(3, 0.06), alpha=alpha)
    )
    n, wo = views((0.0, 40.0, 70.0))
    wi = pixel_directions(96).astype(np.float64)
    n64, wo64 = n.astype(np.float64)[:, None, None], wo.astype(np.float64)[:, None, None]
    cosine = np.maximum((wi * n64).sum(axis=-1, keepdims=True), 0)
    f = brdf(m, wo64 + 0 * wi, wi + 0 * wo64, n64 + 0 * wi)
    expected = np.einsum("phwc,hw->pc", f * cosine * smooth_radiance(wi), np.repeat(pixel_solid_angles(96), 192, 1))
    got = shade(smooth_pyramid(), n, wo, alpha, hammersley(1024)).radiance(m)
    np.testing.assert_allclose(got, expected, rtol=0.02)


def test_diffuse_term_alone_disagrees():
    """Dd = integral of (1 - s) L (n.wi) dwi / pi, s at the half vector of wo and wi."""
    n, wo = views((0.0, 50.0, 85.0))
    wi = pixel_directions(96).astype(np.float64)
    expected = []
    for one_n, one_wo in zip(n.astype(np.float64), wo.astype(np.float64), strict=True):
        s = (1 - np.clip((normalize(one_wo + wi) * one_wo).sum(axis=-1), 0, 1)) ** 5
        weight = (1 - s) * np.maximum(wi @ one_n, 0) / np.pi * pixel_solid_angles(96)
        expected.append(np.einsum("hw,hwc->c", weight, smooth_radiance(wi)))
    got = shade_diffuse(smooth_pyramid(), n, wo, hammersley(1024))
    np.testing.assert_allclose(got, expected, rtol=0.01)


def test_turned_world_looks_different():
    """Map, normals and eye turned together: the same radiance, up to sampling."""
    rng = np.random.default_rng(1)
    n = normalize(rng.normal(size=(12, 3)))
    wo = normalize(n + 0.7 * normalize(rng.normal(size=(12, 3))))
    turn = rotation_y(0.9) @ rotation_x(-0.7) @ rotation_z(0.4)
    u = hammersley(1024)
    still = shade(smooth_pyramid(), n, wo, 0.4, u)
    turned = shade(smooth_pyramid(turn=turn), n @ turn.T, wo @ turn.T, 0.4, u)
    for name in ("irradiance", "specular", "grazing", "diffuse"):
        np.testing.assert_allclose(getattr(turned, name), getattr(still, name), rtol=0.02, atol=1e-3, err_msg=name)


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_light_from_under_the_table(alpha):
    """A floor of light 30 degrees and more below the horizon reaches nothing that faces up."""
    floor = np.zeros((64, 128, 3), np.float32)
    floor[43:] = 1
    n, wo = views((0.0, 45.0, 75.0), n=normalize(np.array([0.0, 1.0, 0.05])))
    shading = shade(build_pyramid(floor, side=64), n, wo, alpha, hammersley(1024))
    for term in (shading.irradiance, shading.specular, shading.grazing, shading.diffuse):
        assert np.abs(term).max() < 6e-3  # what the coarse levels smear; a lost horizon gives 0.1


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_irradiance_is_not_the_mean_over_the_papers_samples(alpha):
    """Eq. 5: h with density D (n.h), wi = reflect(wo, h), the plain mean of what is above the horizon."""
    n, wo = views((0.0, 45.0, 80.0))
    got, _, _ = shade_specular(smooth_pyramid(), n, wo, alpha, hammersley(1024))
    for p in range(len(n)):
        h = world_from_local(square_to_ggx_normal(hammersley(1 << 14), alpha), n[p])
        facing = h @ wo[p] > 0
        wi = reflect(wo[p][None], h[facing])
        above = wi @ n[p] > 0
        np.testing.assert_allclose(got[p], smooth_radiance(wi[above]).mean(axis=0), rtol=0.01)


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.8])
def test_few_samples_miss_the_sun(alpha):
    """One pixel of sun: 64 samples come within 25 % RMS of 8192, by reading coarser levels.

    At level 0 alone the error is 80 to 110 %: most points miss the sun, few see it double.
    """
    sun = np.full((64, 128, 3), 0.2, np.float32)
    sun[12, 80] = 500
    pyramid = build_pyramid(sun, side=128)
    n = normalize(np.random.default_rng(2).normal(size=(100, 3)) + [0, 0, 1.5]).astype(np.float32)
    n = n[n[:, 2] > 0.3]
    wo = np.broadcast_to(np.array([0, 0, 1], np.float32), n.shape)
    few, _, _ = shade_specular(pyramid, n, wo, alpha, hammersley(64))
    many, _, _ = shade_specular(pyramid, n, wo, alpha, hammersley(8192))
    assert np.sqrt(np.mean((few - many) ** 2)) < 0.25 * many.mean()
    assert abs(few.mean() - many.mean()) < 0.07 * many.mean()


def test_eye_at_ninety_degrees_gives_nan():
    n, wo = views((90.0, 90.5, 100.0))
    shading = shade(smooth_pyramid(16, 16), n, wo, 0.3, hammersley(32))
    for term in (shading.irradiance, shading.specular, shading.grazing, shading.diffuse):
        assert np.isfinite(term).all()


def test_alpha_per_point_is_mixed_up():
    n, wo = views((10.0, 50.0))
    pyramid, u = smooth_pyramid(16, 32), hammersley(64)
    both = shade_specular(pyramid, n, wo, np.array([[0.1], [0.7]], np.float32), u)
    for p, alpha in enumerate((0.1, 0.7)):
        alone = shade_specular(pyramid, n[p : p + 1], wo[p : p + 1], alpha, u)
        for a, b in zip(both, alone, strict=True):
            np.testing.assert_allclose(a[p], b[0], rtol=1e-4)


def test_material_mixes_the_wrong_terms():
    """Lo = f0 S1 + (1 - f0) (Ss + albedo Dd), by three materials that single a term out."""
    n, wo = views()
    shading = shade(smooth_pyramid(16, 32), n, wo, 0.3, hammersley(64))
    black, white = np.zeros(3), np.ones(3)
    of = lambda f0, albedo: shading.radiance(Material(albedo=albedo, f0=f0, alpha=0.3))  # noqa: E731
    np.testing.assert_allclose(of(white, white), shading.specular)
    np.testing.assert_allclose(of(black, black), shading.grazing)
    np.testing.assert_allclose(of(black, white), shading.grazing + shading.diffuse)


def test_torch_shades_differently():
    torch = pytest.importorskip("torch", reason="torch is an extra")
    radiance = smooth_radiance(pixel_directions(16)).astype(np.float32)
    n, wo = views((0.0, 30.0, 60.0, 80.0))
    u = hammersley(64)
    for alpha in (0.05, 0.3, 1.0):
        a = shade(build_pyramid(radiance, side=32), n, wo, alpha, u)
        pyramid = build_pyramid(torch.asarray(radiance), side=32)
        b = shade(pyramid, torch.asarray(n), torch.asarray(wo), alpha, torch.asarray(u))
        for name in ("irradiance", "specular", "grazing", "diffuse"):
            np.testing.assert_allclose(getattr(b, name).numpy(), getattr(a, name), rtol=2e-3, err_msg=name)


def test_gradient_is_nan_or_another_function():
    """S1 is linear in the texels: finite gradients, and sum of gradient times texel is S1 itself."""
    torch = pytest.importorskip("torch", reason="torch is an extra")
    from dataclasses import replace

    pyramid = build_pyramid(torch.asarray(smooth_radiance(pixel_directions(16)).astype(np.float32)), side=32)
    texels = pyramid.texels.clone().requires_grad_()
    n, wo = map(torch.asarray, views())
    u = torch.asarray(hammersley(64))
    for term in range(3):
        value = shade_specular(replace(pyramid, texels=texels), n, wo, 0.3, u)[term].sum()
        (gradient,) = torch.autograd.grad(value, texels)
        assert torch.isfinite(gradient).all()
        assert (gradient >= 0).all()
        np.testing.assert_allclose(float((gradient * texels).sum().detach()), float(value.detach()), rtol=1e-4)


@pytest.mark.parametrize(("texels", "level"), [(1, 0), (4, 1), (16, 2)])
def test_a_sample_reads_the_level_whose_texel_is_as_large_as_what_it_stands_for(texels, level):
    pyramid = build_pyramid(np.ones((32, 64, 3), np.float32))
    solid_angle = texels * 4 * np.pi / pyramid.side**2
    assert lobe_lod(np.array([1 / (8 * solid_angle)]), 8, pyramid)[0] == pytest.approx(level)
