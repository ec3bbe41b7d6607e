"""Mitsuba 3 on what the pictures are made of: the frames, the camera, Eq. 2; and the judge itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.chi2 import assert_follows_pdf
from support.judged import MATERIALS, SIZE, Sight, object_of
from support.mitsuba_scenes import (
    camera_rays,
    environment,
    mitsuba_scene,
    paper_bsdf,
    perfect_metal,
    pixel_centres,
    render,
    trace,
)
from support.shading_terms import brdf

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.sampling import hammersley
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import shade
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import pixel_rays, see
from anyprobe.scatter.materials import Material

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("mi")]


def interaction(mi, wi: np.ndarray):
    """A point with n = +Z seen from wi [N, 3]."""
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(*np.asarray(wi, np.float32).T)
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.n = mi.Normal3f(0, 0, 1)
    return si


def pairs(rng: np.random.Generator, count: int = 20_000) -> np.ndarray:
    """[2, count, 3] directions above the horizon, a twentieth and more."""
    d = normalize(rng.normal(size=(2, 4 * count, 3)) * [1, 1, 0.7])
    d = d[:, (d[..., 2] > 0.05).all(axis=0)]
    assert d.shape[1] > count / 2
    return d


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_paper_bsdf_is_not_mitsubas(mi, rng, alpha):
    """With F = 1, no base and the product of the G1, the judge's own Eq. 2 is roughconductor."""
    wi, wo = pairs(rng)
    black = Material(albedo=np.zeros(3), f0=np.ones(3), alpha=alpha)
    paper = mi.load_dict(paper_bsdf(black, correlated=False))
    store = mi.load_dict(perfect_metal(alpha))
    si, ctx, toward = interaction(mi, wi), mi.BSDFContext(), mi.Vector3f(*wo.T.astype(np.float32))
    ours, theirs = (np.array(b.eval(ctx, si, toward)).T for b in (paper, store))
    np.testing.assert_allclose(ours, theirs, rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize("name", MATERIALS)
def test_our_brdf_is_another_function(mi, rng, name):
    """scatter.materials.evaluate, direction by direction."""
    wi, wo = pairs(rng)
    bsdf = mi.load_dict(paper_bsdf(MATERIALS[name]))
    toward = mi.Vector3f(*wo.T.astype(np.float32))
    theirs = np.array(bsdf.eval(mi.BSDFContext(), interaction(mi, wi), toward)).T / wo[:, 2:]
    ours = brdf(MATERIALS[name], wi, wo, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("cosine", [0.95, 0.3])
@pytest.mark.parametrize("name", ["plastic-0.5", "metal-0.3"])
def test_paper_bsdf_samples_another_density(mi, rng, name, cosine):
    bsdf, ctx = mi.load_dict(paper_bsdf(MATERIALS[name])), mi.BSDFContext()
    si = interaction(mi, np.array([[np.sqrt(1 - cosine**2), 0.0, cosine]]))

    def sample(u):
        choice, point = rng.random(len(u)).astype(np.float32), u.astype(np.float32)
        bs, _ = bsdf.sample(ctx, si, mi.Float(choice), mi.Point2f(*point.T))
        return np.array(bs.wo).T[np.array(bs.pdf) > 0]

    def pdf(d):
        flat = mi.Vector3f(*d.reshape(-1, 3).T.astype(np.float32))
        return np.array(bsdf.pdf(ctx, si, flat)).reshape(d.shape[:-1])

    assert_follows_pdf(sample, pdf, rng, num_tests=4)


def test_map_is_turned_mirrored_or_shifted(mi, rng):
    """Random texels, read in random directions by both."""
    from support.mitsuba_plugins import environment_radiance

    radiance = rng.random((16, 32, 3)).astype(np.float32)
    d = normalize(rng.normal(size=(5000, 3)))
    theirs = environment_radiance(mi.load_dict(environment(radiance)), mi.Vector3f(*d.T.astype(np.float32)))
    np.testing.assert_allclose(bilinear(radiance, direction_to_uv(d)), np.array(theirs).T, atol=2e-5)


@pytest.mark.parametrize("shape", ["sphere", "rounded", "vase"])
def test_camera_looks_along_other_rays(shape):
    mesh, camera = object_of(shape)
    scene = mitsuba_scene(mesh, camera, np.ones((4, 8, 3), np.float32), perfect_metal(0.3))
    origin, direction = camera_rays(scene, pixel_centres(SIZE))
    wo = pixel_rays(camera.tan_half, SIZE).reshape(-1, 3) @ camera.world_from_camera.T
    np.testing.assert_allclose(direction, -wo, atol=1e-6)
    off_axis = np.cross(origin - camera.position, direction)
    np.testing.assert_allclose(off_axis, 0, atol=1e-6)


def test_film_is_flipped():
    """Mitsuba's own film, a whole pixel wide: it is lit where our rasteriser sees the tilted vase."""
    mesh, camera = object_of("vase")
    scene = mitsuba_scene(mesh, camera, np.ones((4, 8, 3), np.float32), perfect_metal(0.3))
    lit = render(scene, spp=64).max(axis=-1) > 0
    mask = see(mesh, camera).mask
    assert (mask & ~lit).sum() <= 0.01 * mask.sum()
    assert (lit & ~mask).sum() < 4 * SIZE, "more than the silhouette's half-covered pixels"


@pytest.mark.parametrize(("row", "column"), [(4, 3), (10, 29), (8, 0), (8, 31), (2, 20), (12, 24)])
def test_bright_texel_is_mirrored_elsewhere(row, column):
    """One texel of light in a mirror sphere: our alpha 0.01, production settings; their smooth conductor."""
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[row, column] = 1.0
    mesh, camera = sphere(), replace(object_of("sphere")[1], size=64)
    scene = mitsuba_scene(mesh, camera, radiance, {"type": "conductor", "material": "none"})
    sight = Sight(mesh, camera, scene)
    ours = shade(build_pyramid(radiance), sight.n, sight.wo, 0.01, hammersley(64)).specular[:, 0]
    theirs = trace(scene, sight.at, 4, 0)[0].mean(axis=1)[:, 0]
    assert theirs.max() > 0.5
    np.testing.assert_allclose(ours, theirs, atol=0.15)
    pixels = np.argwhere(sight.mask)
    centre = [(w[:, None] * pixels).sum(axis=0) / w.sum() for w in (ours, theirs)]
    assert np.linalg.norm(centre[0] - centre[1]) < 0.1, centre
