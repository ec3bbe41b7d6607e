"""The second stage: what it learns from, and what it does with points of a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.sampling import hammersley  # noqa: E402
from anyprobe.learning.dataset.asset_store import own_map  # noqa: E402
from anyprobe.light.environment import shrink  # noqa: E402
from anyprobe.light.harmonics import sh_basis  # noqa: E402
from anyprobe.render.integrate import shade, shading_pyramid  # noqa: E402
from anyprobe.render.reflectance import reflectance_normals  # noqa: E402
from research.harmonics import real_basis  # noqa: E402
from research.second_stage.first_stage import SIZE, SeenSurfaces  # noqa: E402
from research.second_stage.net import SecondStage  # noqa: E402
from research.second_stage.reflectance_pairs import ReflectanceConfig, ReflectanceSource  # noqa: E402
from research.second_stage.reflectance_tables import ALPHAS, ROWS, reflectance_matrices  # noqa: E402
from research.second_stage.train import SecondConfig, train  # noqa: E402

SIDE = 10


@pytest.fixture(scope="module")
def matrices() -> np.ndarray:
    return reflectance_matrices(SIDE)


@pytest.fixture(scope="module")
def spheres() -> SeenSurfaces:
    """Four spheres, estimated a little askew."""
    x = (np.arange(SIZE) + 0.5) / SIZE * 2.2 - 1.1
    right, up = np.meshgrid(x, -x)
    inside = np.hypot(right, up) < 0.98
    z = np.sqrt(np.clip(1 - right**2 - up**2, 0.0, 1.0))
    true = np.where(inside, np.stack([right, up, z]), 0.0)[None].repeat(4, axis=0)
    askew = true + np.array([0.2, 0.0, 0.3])[:, None, None]
    return SeenSurfaces(
        true=true.astype(np.float16),
        estimated=(askew / np.linalg.norm(askew, axis=1, keepdims=True)).astype(np.float16),
        mask=inside[None].repeat(4, axis=0).astype(np.float16),
        tan_half=np.full(4, 0.1, np.float32),
        root_alpha=np.sqrt(np.array([0.05, 0.2, 0.5, 0.9], np.float32)),
        estimated_root_alpha=np.sqrt(np.array([0.07, 0.2, 0.4, 0.9], np.float32)),
        metal=np.array([True, False, True, False]),
    )


def source(matrices, spheres, maps=None, **settings) -> ReflectanceSource:
    maps = torch.rand(3, 3, 64, 128, generator=torch.Generator().manual_seed(1)) if maps is None else maps
    config = ReflectanceConfig(batch=8, fresh=4, period=2, pool=2, seed=3)
    return ReflectanceSource(maps, matrices, spheres, replace(config, **settings))


def test_a_table_with_terms_swapped_or_without_the_cosine(matrices):
    light = own_map(1, 3).radiance
    x = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    disc = np.hypot(*np.meshgrid(x, x)) < 1
    n = reflectance_normals(SIDE)[disc]
    wide = shading_pyramid(light)
    for k, alpha in enumerate(ALPHAS):
        pyramid = wide if alpha > 0.3 else shading_pyramid(light, alpha)
        wo = np.tile(np.float32([0, 0, 1]), (len(n), 1))
        terms = shade(pyramid, n, wo, np.float32(alpha), hammersley(256), wide=wide)
        for number, expected in ((2 * k, terms.specular), (2 * k + 1, terms.grazing), (-1, terms.diffuse)):
            found = matrices[number][disc.ravel()] @ shrink(light, ROWS).reshape(-1, 3)
            wrong = np.abs(found - expected) / (np.abs(expected) + 1e-3)
            assert np.median(wrong) < 0.03, (alpha, number)


def test_an_object_brighter_or_darker_than_the_even_light_it_reflects(matrices, spheres):
    even = torch.ones(1, 3, 64, 128)
    batch = source(matrices, spheres, even, errors=0.0, blends=0.0, seed=5).batch(0)
    f0, albedo = batch.true_material[:, 1:4], batch.true_material[:, 4:7]
    fresnel = f0 + (1 - f0) / 21
    reflected = fresnel + (1 - fresnel) * albedo
    middle = batch.photo[:, :, SIZE // 2 - 3 : SIZE // 2 + 3, SIZE // 2 - 3 : SIZE // 2 + 3].mean(dim=(2, 3))
    level = batch.radiance.mean(dim=(2, 3))
    expected = (reflected * level).clip(max=1.0) ** 0.9
    expected = 1.6 * expected / (expected + 0.6)
    assert (middle - expected).abs().median() < 0.06


def test_a_batch_that_depends_on_those_before_it(matrices, spheres):
    one, other = (source(matrices, spheres) for _ in range(2))
    for step in range(5):
        last = one.batch(step)
    again = other.batch(4)
    assert torch.equal(last.photo, again.photo)
    assert torch.equal(last.radiance, again.radiance)


def test_normals_given_that_are_the_estimated_ones(matrices, spheres):
    given = source(matrices, spheres, normals=1.0).batch(0)
    estimated = source(matrices, spheres, normals=0.0).batch(0)
    true = torch.from_numpy(spheres.true[:1].astype(np.float32))
    inside = true.abs().amax(dim=1) > 0.25
    along = [(one.normals * true).sum(dim=1)[inside.expand(8, -1, -1)].mean() for one in (given, estimated)]
    assert along[0] > 0.99 > along[1]
    assert given.given.all()
    assert not estimated.given.any()


def test_a_given_material_that_does_not_settle_the_level(matrices, spheres):
    batch = source(matrices, spheres).batch(0)
    net = SecondStage(width=16, blocks=1).eval()
    torch.nn.init.zeros_(net.last.weight)
    inputs = list(batch.inputs())
    dark, bright = torch.zeros(8, 8), torch.zeros(8, 8)
    dark[:, 0], bright[:, 0] = 1.0, 1.0
    dark[:, 1:4], bright[:, 1:4] = 0.4, 0.8
    levels = []
    for material in (dark, bright):
        inputs[6] = material
        levels.append(net(*inputs).ln_shown.mean().item())
    reflected = [f0 + (1 - f0) / 21 for f0 in (0.4, 0.8)]
    assert levels[0] - levels[1] == pytest.approx(np.log(reflected[1] / reflected[0]), abs=1e-4)


def test_harmonics_that_are_not_orthonormal_or_not_about_the_vertical():
    d = np.random.default_rng(0).normal(size=(400, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    found = real_basis(d, 2)
    span, *_ = np.linalg.lstsq(found[:, 1:4], sh_basis(d)[:, 1:4], rcond=None)
    assert np.allclose(found[:, 1:4] @ span, sh_basis(d)[:, 1:4], atol=1e-6)
    assert np.allclose(np.abs(found[:, 2]), np.abs(sh_basis(d)[:, 1]), atol=1e-6)  # of m = 0: y


def test_a_run_that_goes_on_with_other_weights_than_one_that_was_not_stopped(matrices, spheres, tmp_path):
    small = SecondConfig(steps=4, width=16, blocks=1, pairs=ReflectanceConfig(batch=4, fresh=2, period=2, pool=2))
    maps = torch.rand(2, 3, 64, 128, generator=torch.Generator().manual_seed(1)).numpy()
    nets = []
    for name, stops in (("whole", (None,)), ("parts", (2, None))):
        folder = tmp_path / name
        folder.mkdir()
        np.save(folder / "maps.npy", maps)
        np.save(folder / "matrices.npy", matrices)
        spheres.save(folder / "first_stage.npz")
        for stop in stops:
            path = train(small, tmp_path, folder, stop)
        nets.append(torch.load(path, weights_only=True)["net"])
    assert all(torch.equal(one, other) for one, other in zip(*(net.values() for net in nets), strict=True))
