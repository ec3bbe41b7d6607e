"""Surfaces given another shape: still surfaces, still seen, still in their frames."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.render.surface import pixel_rays  # noqa: E402
from anyprobe_train.dataset.shape_augment import draw_reshaping, reshape  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402

SIZE, TAN_HALF = 64, 0.4


@pytest.fixture(scope="module")
def surfaces():
    return build_surfaces([], SurfaceConfig(views=1, procedural=3, figures=1, size=SIZE))


def both(surfaces):
    return torch.from_numpy(surfaces.normals).float(), torch.from_numpy(surfaces.tan_half)


def sphere_rho(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """ln depth of a sphere that more than fills the picture: radius 2 around (0.1, -0.1, -3)."""
    ray, centre = np.stack([x, y, -np.ones_like(x)], axis=-1), np.array([0.1, -0.1, -3.0])
    a, b = (ray**2).sum(axis=-1), ray @ centre
    return np.log((b - np.sqrt(b**2 - a * (centre @ centre - 4.0))) / a)


def normals_of(rho, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Normals of the points exp(rho) (x, y, -1), by differences of the points themselves."""

    def point(x, y):
        return np.exp(rho(x, y))[..., None] * np.stack([x, y, -np.ones_like(x)], axis=-1)

    step = 1e-5
    n = np.cross(point(x + step, y) - point(x - step, y), point(x, y + step) - point(x, y - step))
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def test_what_comes_out_are_the_normals_of_the_surface_whose_depth_was_changed():
    """Against points in space: rolled, drawn out, deeper and with waves."""
    x = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * TAN_HALF
    x, y = np.meshgrid(x, -x)
    before = torch.from_numpy(normals_of(sphere_rho, x, y).astype(np.float32)).permute(2, 0, 1)[None]
    change = draw_reshaping(np.ones((1, SIZE, SIZE), bool), np.random.default_rng(1))
    change = replace(  # a part of the picture, so that nothing comes from outside it
        change, old_from_new=change.old_from_new * 0.4, offset=torch.tensor([[0.1, -0.15]])
    )
    linear, offset = change.old_from_new[0].double().numpy(), change.offset[0].double().numpy() * TAN_HALF
    steeper = float(change.deeper[0]) / np.sqrt(np.linalg.det(linear))  # the picture is larger, slopes are not

    def rho(x, y):
        old = np.stack([x, y], axis=-1) @ linear.T + offset
        result = steeper * sphere_rho(old[..., 0], old[..., 1])
        for (slope, speed), phase in zip(change.waves[0].double().numpy(), change.phases[0].numpy(), strict=True):
            angle = np.stack([x, y], axis=-1) @ speed / TAN_HALF + phase
            # slope lies along speed, so that it is the gradient of this sine
            result = result + np.sin(angle) * (slope @ speed) / (speed @ speed) * TAN_HALF
        return result

    after = reshape(before, torch.tensor([TAN_HALF]), change)[0].permute(1, 2, 0).numpy()
    cosine = (after * normals_of(rho, x, y)).sum(axis=-1)
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 0.2
    unwaved = reshape(before, torch.tensor([TAN_HALF]), replace(change, waves=change.waves * 0))
    assert (unwaved[0].permute(1, 2, 0).numpy() * after).sum(axis=-1).min() < 0.99


def test_every_point_is_unit_and_seen_and_the_object_fills_its_picture(surfaces):
    normals, tan_half = both(surfaces)
    masks = normals.abs().sum(dim=1).numpy() > 0
    result = reshape(normals, tan_half, draw_reshaping(masks, np.random.default_rng(2)))
    for n, t in zip(result.permute(0, 2, 3, 1).numpy(), tan_half.numpy(), strict=True):
        mask = np.abs(n).sum(axis=-1) > 0
        assert np.allclose(np.linalg.norm(n[mask], axis=-1), 1.0, atol=1e-5)
        assert (n * pixel_rays(float(t), SIZE))[mask].sum(axis=-1).min() > 0
        row, column = np.nonzero(mask)
        extent = max(np.ptp(row), np.ptp(column)) + 1
        assert SIZE / 1.2 - 2 <= extent <= SIZE / 1.04 + 2
        for place in (row, column):
            assert abs(place.max() + place.min() + 1 - SIZE) <= 3
