"""Training pairs: repeatable, consistent with the per-point renderer, and what the conventions say."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.frames import world_from_camera  # noqa: E402
from anyprobe.core.response import MEAN_CURVE, inverse_response  # noqa: E402
from anyprobe.core.sampling import hammersley  # noqa: E402
from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.material import METALS, SPECULAR_BELOW, draw_alpha, draw_material  # noqa: E402
from anyprobe.dataset.pairs import PairConfig, PairSource  # noqa: E402
from anyprobe.dataset.procedural_light import draw_map, room, sky, studio  # noqa: E402
from anyprobe.dataset.surfaces import NUM_ELEVATIONS, SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe.light.octahedral import build_pyramid  # noqa: E402
from anyprobe.render.integrate import shade  # noqa: E402
from anyprobe.render.reflectance import normal_to_reflectance_xy, reflectance_normals, straight_on_normal  # noqa: E402
from anyprobe.render.shapes import sphere  # noqa: E402
from anyprobe.render.surface import frame_object, see  # noqa: E402


@pytest.fixture(scope="module")
def maps():
    rng = np.random.default_rng(3)
    return [draw_map(rng, height=64)[0] for _ in range(3)]


@pytest.fixture(scope="module")
def surfaces():
    return build_surfaces([], SurfaceConfig(views=1, procedural=2))


def make_source(maps, surfaces, seed=0):
    config = PairConfig(batch=4, seed=seed, group=2, pool=2, reuse=4)
    return PairSource(Illuminator(maps, compiled=False), surfaces, config)


def test_a_batch_depends_on_its_number_alone(maps, surfaces):
    """The resumed run must see the pairs it would have seen."""
    straight = make_source(maps, surfaces)
    for step in range(3):
        straight.batch(step)
    went_on, resumed = straight.batch(3), make_source(maps, surfaces).batch(3)
    for name in ("photo", "irradiance", "ldr", "ln_radiance"):
        assert torch.equal(getattr(went_on, name), getattr(resumed, name))
    assert not torch.equal(went_on.photo, make_source(maps, surfaces, seed=1).batch(3).photo)


def test_targets_are_the_mean_curve_of_one_radiance(maps, surfaces):
    batch = make_source(maps, surfaces).batch(0)
    assert batch.photo.shape == (4, 4, 128, 128)
    assert batch.ldr.shape == batch.ln_radiance.shape == (4, 3, 64, 128)
    unclipped = (batch.ldr < 0.98) & (batch.ldr > 0.05)
    from_ldr = torch.log(inverse_response(batch.ldr, MEAN_CURVE))
    assert (from_ldr - batch.ln_radiance)[unclipped].abs().max() < 1e-2
    outside = batch.photo[:, 3:] == 0
    assert (batch.photo[:, :3] * outside).abs().max() == 0


def test_a_lookup_agrees_with_shading_every_point(maps):
    """Reflectance maps stand for per-point shading: a perspective ball both ways."""
    pyramid = build_pyramid(maps[0])
    rotation = world_from_camera(0.7, 0.3)
    camera = frame_object(sphere(), rotation, fov_deg=25.0)
    surface = see(sphere(), camera)
    turn = camera.world_from_camera.T.astype(np.float32)
    for alpha in (0.08, 0.4, 0.9):
        point = shade(pyramid, surface.normals @ turn, surface.wo @ turn, alpha, hammersley(96))
        lit = Illuminator([maps[0]], compiled=False)
        terms = lit.light(lit.pyramids[0], camera.world_from_camera, alpha, 0).terms
        n, wo = torch.from_numpy(surface.normals), torch.from_numpy(surface.wo)
        inner = (n * wo).sum(1) > 0.3  # the rim's few pixels turn too fast for any map

        def read(image, normals):
            xy = normal_to_reflectance_xy(normals)[None, None]
            return torch.nn.functional.grid_sample(image[None], xy, align_corners=False)[0, :, 0].T

        for name, value in (
            ("irradiance", read(terms[:3], straight_on_normal(n, wo))),
            ("specular", read(terms[3:6], straight_on_normal(n, wo))),
            ("diffuse", read(terms[9:], n)),
        ):
            expected = torch.from_numpy(np.asarray(getattr(point, name), np.float32))
            error = ((value - expected)[inner] ** 2).mean().sqrt() / (expected[inner] ** 2).mean().sqrt()
            assert error < 0.12, f"{name} alpha {alpha}: {error:.3f}"


def test_reflectance_map_finds_its_own_normals():
    n = reflectance_normals(32)
    x = (np.arange(32) + 0.5) / 16 - 1
    right, down = np.meshgrid(x, x)
    inside = np.hypot(right, down) < 0.98
    np.testing.assert_allclose(
        normal_to_reflectance_xy(n)[inside], np.stack([right, down], -1)[inside], atol=1e-4
    )


def test_materials_are_what_the_conventions_say(rng):
    alphas = np.array([draw_alpha(rng) for _ in range(2000)])
    assert alphas.min() >= 0.01
    assert alphas.max() <= 1
    assert 0.45 < (alphas < SPECULAR_BELOW).mean() < 0.55
    metals = 0
    for _ in range(300):
        material = draw_material(rng, 0.3)
        assert (material.albedo >= 0).all()
        assert (material.f0 <= 1).all()
        if (material.albedo == 0).all():
            metals += 1
            assert material.f0.max() > 0.3
        else:
            assert np.ptp(material.f0) == 0
            assert 0.016 < material.f0[0] < 0.083
    assert 0.3 < metals / 300 < 0.5
    assert len(METALS) == 7


def test_surfaces_face_the_eye_and_fill_the_window(surfaces):
    assert set(surfaces.elevation) == set(range(NUM_ELEVATIONS))
    normals = surfaces.normals.astype(np.float32)
    mask = np.abs(normals).sum(axis=1) > 0
    length = np.sqrt((normals**2).sum(axis=1))[mask]
    np.testing.assert_allclose(length, 1.0, atol=2e-3)
    for one in mask:
        rows, columns = np.nonzero(one)
        assert 0.78 < max(np.ptp(rows), np.ptp(columns)) / 128 < 1.0


@pytest.mark.parametrize("family", [sky, room, studio])
def test_own_maps_are_usable_light(family):
    for seed in range(4):
        radiance = family(np.random.default_rng(seed), height=32)
        assert radiance.shape == (32, 64, 3)
        assert np.isfinite(radiance).all()
        assert radiance.min() >= 0
        assert radiance.max() > 1.5 * radiance.mean()
