"""Mitsuba judges the ground of the training pairs: its radiance and the shadow that an object casts on it."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.frames import world_from_camera  # noqa: E402
from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.dataset.ground_plane import Grounds, Stand, light_directions, make_scenes  # noqa: E402
from anyprobe.dataset.surfaces import even_points  # noqa: E402
from anyprobe.relight.path_traced import _environment, _mi_rays, open_mitsuba  # noqa: E402
from anyprobe.render.shapes import draw_shape  # noqa: E402
from anyprobe.render.surface import frame_object, pixel_rays, see  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("mi")]
ALBEDO, SIDE, PATHS = 0.5, 48, 256


def plain_ground(albedo: float) -> Grounds:
    """Endless and of one colour."""
    zero = torch.zeros(1, 1)
    return Grounds(
        albedo=torch.full((1, 3), albedo),
        waves=torch.zeros(1, 1, 2),
        phases=zero,
        amplitudes=torch.zeros(1, 1, 3),
        middle=torch.zeros(1, 2),
        half_sides=torch.full((1, 2), 1e6),
        turn=zero[0],
    )


def lit_map(softness: float) -> np.ndarray:
    """[128, 256, 3]: an even sky and a coloured light source at a height of 40 degrees, off to one side."""
    d = pixel_directions(128)
    source = np.array([0.6, np.sin(np.radians(40.0)), -0.4])
    source /= np.linalg.norm(source)
    lobe = np.exp((d @ source - 1) / (1 - np.cos(softness)))[..., None] * np.float32([1.0, 0.8, 0.6])
    return (0.3 + lobe * 3.0 / (1 - np.cos(softness))).astype(np.float32)


@pytest.mark.parametrize("softness_deg", [2.0, 20.0])
def test_shadow_lies_elsewhere_or_is_of_another_depth(softness_deg):
    mi = open_mitsuba()
    mesh = draw_shape(np.random.default_rng(5))
    camera = frame_object(mesh, world_from_camera(0.7, np.radians(30.0)), fov_deg=20.0, margin=1.1)
    radiance = lit_map(np.radians(softness_deg))
    turn = camera.world_from_camera
    directions, weights = light_directions(radiance, 1024, np.random.default_rng(0))
    stand = Stand(
        ground=plain_ground(ALBEDO),
        map_from_camera=turn,
        base=torch.from_numpy(radiance[::2, ::2].copy()),
        directions=directions,
        weights=weights,
    )
    points = torch.from_numpy(even_points(mesh, 2048) @ turn.astype(np.float32))[None]
    center = torch.from_numpy((-camera.position @ turn).astype(np.float32))[None]
    rays = -pixel_rays(3 * camera.tan_half, SIDE)
    ours = make_scenes([stand], points, center).see(torch.from_numpy(rays)[None])[0].permute(1, 2, 0).numpy()

    floor = float(mesh.positions[:, 1].min())
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0] * 3}}
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(black)
    solid = mi.Mesh("solid", len(mesh.positions), len(mesh.faces), props=properties)
    parameters = mi.traverse(solid)
    parameters["vertex_positions"] = mesh.positions.ravel().astype(np.float32)
    parameters["faces"] = mesh.faces.ravel().astype(np.uint32)
    parameters.update()
    up = mi.ScalarTransform4f().translate([0, floor, 0]).rotate([1, 0, 0], -90).scale([200, 200, 1])
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [ALBEDO] * 3}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "light": _environment(mi, radiance),
            "solid": solid,
            "ground": {"type": "rectangle", "to_world": up, "bsdf": grey},
        }
    )
    world = (rays.reshape(-1, 3) @ turn.T).astype(np.float32)
    tracer = mi.load_dict({"type": "path", "max_depth": 2})
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    total = 0.0
    for seed in range(PATHS // 16):
        some = np.repeat(world, 16, axis=0)
        sampler.seed(seed, len(some))
        color, _, _ = tracer.sample(scene, sampler, _mi_rays(mi, camera.position, some))
        total = total + np.array(color).T.reshape(len(world), 16, 3).mean(axis=1)
    theirs = (total / (PATHS // 16)).reshape(SIDE, SIDE, 3)

    wide = see(
        mesh, type(camera)(world_from_camera=turn, position=camera.position, tan_half=3 * camera.tan_half, size=SIDE)
    )
    ground = ~wide.mask & ((rays @ turn.T)[..., 1] < -0.05)
    shadow = theirs[..., 1] < 0.8 * np.median(theirs[ground][:, 1])
    assert (shadow & ground).sum() > 20
    off = (ours - theirs)[ground] / theirs[ground].mean()
    assert np.abs(off).mean() < 0.05
    assert abs(off.mean()) < 0.02
    # cells of a twelfth of the object are rounded off
    assert abs(off[shadow[ground]].mean()) < 0.08
