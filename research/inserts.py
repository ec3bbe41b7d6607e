"""Inserted objects beside path tracing: 20 inserts of four meshes, each into a rendered photo whose light is known.

python -m research.inserts DATA --kept DIR [-o sheet.png]

A clay pebble stands on a plane under a real map; Mitsuba draws it without and with a second object beside it. Into the
first picture relight inserts the same mesh at the same place, lit by the same map. All of it is done twice with other
random numbers: figures are roots of the mean product of both differences of display values, in which the noise of path
tracing cancels: over what either picture changes, over the object's pixels, and over the others. The pebble's own
pixels are left out: nothing inserted changes them. No blur, no grain. Single bright pixels of the path-traced picture,
caustics of few paths, count as the median around them.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.files.objects import open_object, read_mesh
from anyprobe.light.environment import reduced, rotate
from anyprobe.maps.radiance import read_radiance
from anyprobe.pictures.images import write_png
from anyprobe.relight.camera_look import DRAWN_BLUR, CameraLook
from anyprobe.relight.ground_view import View
from anyprobe.relight.insert import Arrangement, Stage, within
from anyprobe.relight.shadow import sky_irradiance
from anyprobe.render.mesh import Mesh
from anyprobe.scatter.materials import Material, material_named
from research.path_traced import _environment, _shape, open_mitsuba

WIDTH, HEIGHT, FOV_DEG = 256, 192, 50.0
PATHS, MAX_DEPTH, MAP_ROWS = 144, 6, 256
BRIGHTNESS = 0.25
"""Mean luminance of the photo."""
FIREFLY = 0.04
"""How much brighter than all eight around it a path-traced pixel must be, in display values, to be noise."""
CHANGED = 1.5 / 255
"""Smallest difference of display values that counts as a change."""
REAL_AT, AT, HALF_PLANE = (75.0, 139.0), (170.0, 146.0), 60.0
MESHES = ("horse", "teapot", "lionstatue", "duck")
MATERIALS = ("matte", "plastic", "gold", "chrome", "plaster")
CLAY = Material(albedo=np.array([0.55, 0.35, 0.25]), f0=np.full(3, 0.04), alpha=0.6)


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """A map of DATA/hdri/test, turned; the plane's material; the camera's pitch [degrees]."""

    map: str
    yaw_deg: float
    ground: Material
    pitch_deg: float = 22.0


def plain(albedo: float, f0: float = 0.0, alpha: float = 1.0) -> Material:
    """A grey material."""
    return Material(albedo=np.full(3, albedo), f0=np.full(3, f0), alpha=alpha)


SETTINGS = (
    Setting(map="comfy_cafe", yaw_deg=0, ground=plain(0.45)),
    Setting(map="sunny_vondelpark", yaw_deg=100, ground=plain(0.3)),
    Setting(map="small_hangar_01", yaw_deg=200, ground=plain(0.6), pitch_deg=30.0),
    Setting(map="pink_sunrise", yaw_deg=300, ground=plain(0.2), pitch_deg=15.0),
    Setting(map="studio_garden", yaw_deg=45, ground=plain(0.3, 0.05, 0.05)),
)


def main(
    data: Annotated[Path, Parameter(help="Folder with hdri/test and meshes/test.")],
    /,
    *,
    kept: Annotated[Path, Parameter(help="Folder where path-traced pictures are kept.")],
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="Sheet: photo, path-traced, inserted.")] = None,
) -> None:
    """Print a line for each insert, then the figures of all."""
    rows, found = [], []
    for k, setting in enumerate(SETTINGS):
        light = light_of(data, setting)
        for j, name in enumerate(MESHES):
            mesh, material = read_mesh(data / "meshes" / "test" / f"{name}.ply"), MATERIALS[(j + k) % len(MATERIALS)]
            pictures, figures = insert(setting, light, mesh, material, kept / setting.map, name, turn_deg=40.0 * k)
            found.append(figures)
            rows.append(np.concatenate(pictures, axis=1))
            print(f"{setting.map:18} {name:11} {material:8} " + " ".join(f"{one:.4f}" for one in figures), flush=True)
    *errors, seconds = np.sqrt(np.square(found).mean(axis=0))
    print("all: changed {:.4f}, object {:.4f}, others {:.4f}".format(*errors) + f", {seconds:.2f} s of a core each")
    if out is not None:
        write_png(out, to_bytes(np.clip(np.concatenate(rows), 0, 1)))


def insert(
    setting: Setting, light: np.ndarray, mesh: Mesh, material: str, kept: Path, name: str, turn_deg: float = 0.0
) -> tuple[list[np.ndarray], list[float]]:
    """Insert a mesh into the setting's photo.

    Args:
        light: [H, 2H, 3], camera frame. kept: folder of path-traced pictures; name: of the inserted one's file.
    Returns:
        The photo, the path-traced and the inserted picture, display values [HEIGHT, WIDTH, 3]. The three figures of
        this module, and the seconds of a core that the insertion took.
    """
    kept.mkdir(parents=True, exist_ok=True)
    (photo, truth, ours, stage, seconds), again = (
        _inserted(setting, light, mesh, material, kept, name, turn_deg, seed) for seed in (0, 1)
    )
    products = (truth - ours) * (again[1] - again[2])
    changed = np.maximum(np.abs(truth - photo.rgb), np.abs(ours - photo.rgb)).max(axis=-1) > CHANGED
    return [photo.rgb, truth, ours], [*_differences(products.mean(axis=-1), changed, photo, stage), seconds]


def _inserted(
    setting: Setting, light: np.ndarray, mesh: Mesh, material: str, kept: Path, name: str, turn_deg: float, seed: int
) -> tuple[Photo, np.ndarray, np.ndarray, Stage, float]:
    """Return the photo, the path-traced and the inserted picture, the stage, and the seconds of a core it took."""
    view = _view(setting)
    things = {"real": (_standing(open_object("pebble"), view, REAL_AT), CLAY)}
    plate, mask = _traced(kept / f"photo_{seed}.npz", view, light, setting, things, seed)
    gain = np.float32(BRIGHTNESS / luminance(plate).mean())
    photo = load_photo(to_bytes(response(plate * gain)), mask=mask, fov_deg=FOV_DEG)
    photo = replace(photo, rgb=response(plate * gain).astype(np.float32))
    surroundings = _with_plane(light, view, setting.ground) * gain
    started = time.process_time()
    stage = Stage(photo, mesh, Arrangement(size=1.0, at=AT, turn_deg=turn_deg, pitch_deg=setting.pitch_deg))
    stage.look = CameraLook(blur=DRAWN_BLUR, grain=0.0)
    ours = stage.relit(surroundings, material)
    seconds = time.process_time() - started
    things["inserted"] = stage.placement.mesh, material_named(material)
    traced, _ = _traced(kept / f"{name}_{seed}.npz", view, light, setting, things, seed)
    return photo, _without_fireflies(response(traced * gain)), ours, stage, seconds


def _differences(products: np.ndarray, changed: np.ndarray, photo: Photo, stage: Stage) -> list[float]:
    """Return roots of means over changed pixels, the object's, and the other changed ones."""
    free = photo.mask < 0.5
    window, on = stage.window, np.zeros(photo.mask.shape, bool)
    drawn = stage.draw(np.ones((8, 16, 3), np.float32), "matte")[..., 3] > 0.5
    shown = window.part(*photo.mask.shape)
    on[shown] = drawn[within(shown, (slice(window.top, HEIGHT), slice(window.left, WIDTH)))]
    parts = (changed | on, on, changed & ~on)
    return [float(np.sqrt(max(products[part & free].mean(), 0.0))) for part in parts]


def _without_fireflies(picture: np.ndarray) -> np.ndarray:
    """Return display values [H, W, 3] whose single bright pixels are the median of those around."""
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    steps = [(row, column) for row in range(3) for column in range(3) if (row, column) != (1, 1)]
    around = np.stack([padded[row : row + HEIGHT, column : column + WIDTH] for row, column in steps])
    return np.where(picture > around.max(axis=0) + FIREFLY, np.median(around, axis=0), picture)


def _view(setting: Setting) -> View:
    focal = max(WIDTH, HEIGHT) / 2 / np.tan(np.radians(FOV_DEG) / 2)
    return View(width=WIDTH, height=HEIGHT, focal=float(focal), up=up_of(setting.pitch_deg))


def light_of(data: Path, setting: Setting) -> np.ndarray:
    """Return the map [MAP_ROWS, 2 MAP_ROWS, 3] in the camera's frame."""
    radiance = read_radiance(data / "hdri" / "test" / f"{setting.map}.exr")
    radiance = reduced(radiance, MAP_ROWS) if len(radiance) > MAP_ROWS else radiance
    turn = rotation_x(np.radians(setting.pitch_deg)) @ rotation_y(np.radians(setting.yaw_deg))
    return np.maximum(rotate(radiance, turn), 0.0).astype(np.float32)


def _with_plane(light: np.ndarray, view: View, ground: Material) -> np.ndarray:
    """Return the map with the plane's radiance below the horizon."""
    below = pixel_directions(len(light)) @ view.up < 0
    result = light.copy()
    result[below] = ground.albedo * sky_irradiance(light, view.up) / np.pi
    return result


def _standing(mesh: Mesh, view: View, at: tuple[float, float]) -> Mesh:
    """Stand a mesh on the plane, a third of the camera's distance high."""
    foot, turn = view.on_ground(*at), rotation_x(np.arctan2(view.up[2], view.up[1]))
    positions = mesh.positions - [0, mesh.positions[:, 1].min(), 0]
    scale = 0.3 * -foot[2] / np.ptp(positions[:, 1])
    return Mesh(
        positions=scale * positions @ turn.T + foot,
        faces=mesh.faces,
        normals=(mesh.normals @ turn.T).astype(np.float32),
    )


def _traced(
    path: Path, view: View, light: np.ndarray, setting: Setting, things: dict[str, tuple[Mesh, Material]], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a path-traced picture [H, W, 3] and the mask [H, W] of the real object, made once and kept in a file."""
    if path.is_file():
        with np.load(path) as file:
            return file["picture"], file["mask"]
    mi = open_mitsuba()
    to_world = mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, -1], up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}
    sensor = {"type": "perspective", "fov": FOV_DEG, "fov_axis": "x", "to_world": to_world, "film": film,
              "near_clip": 1e-3, "sampler": {"type": "multijitter", "sample_count": PATHS}}  # fmt: skip
    side = np.linalg.qr(np.stack([view.up, [1.0, 0, 0], [0, 0, 1.0]], axis=1))[0][:, 1:]
    corners = HALF_PLANE * np.array([x * side[:, 0] + z * side[:, 1] for x, z in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    front = np.cross(corners[1] - corners[0], corners[2] - corners[0]) @ view.up
    faces = faces if front > 0 else faces[:, ::-1]
    plane = Mesh(positions=corners - view.up, faces=faces, normals=np.broadcast_to(view.up, (2, 3, 3)))
    shapes = {name: _shape(mi, mesh, material) for name, (mesh, material) in things.items()}
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": MAX_DEPTH}, "sensor": sensor,
             "light": _environment(mi, light), "plane": _shape(mi, plane, setting.ground), **shapes}  # fmt: skip
    picture = np.array(mi.render(mi.load_dict(scene), seed=seed))[..., :3]
    depth = {"type": "aov", "aovs": "d:depth"}
    alone = {"type": "scene", "integrator": depth, "sensor": sensor, "real": shapes["real"]}
    mask = (np.array(mi.render(mi.load_dict(alone)))[..., -1] > 0).astype(np.float32)
    np.savez(path, picture=np.nan_to_num(picture), mask=mask)
    return np.nan_to_num(picture), mask


if __name__ == "__main__":
    run_command(main)
