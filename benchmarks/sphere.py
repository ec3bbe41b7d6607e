"""The scene of the equal-error part: a unit sphere in perspective, its materials and its two lights."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.errors import InputError
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.catalog import load_maps
from anyprobe_train.dataset.distributions import f0_from_ior
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import sky

SIZE = 128
"""Of the picture, in pixels; --size changes it for a dry run."""
FOV_DEG = 30.0
"""Angle that the sphere fills."""
MARGIN = 1.1
"""Side of the picture over the sphere's width there, as anyprobe frames its crops."""
ALPHAS = (0.05, 0.1, 0.3, 0.5, 1.0)
KINDS = ("conductor", "plastic")
IOR = 1.5
ALBEDO = (0.6, 0.35, 0.15)
BRIGHT_PIXELS = 200
OWN_MAPS = 9
SUN = 1000.0
"""Peak over mean luminance from which an outdoor map is called sunny."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Light:
    """A map [H, 2H, 3] of mean luminance 1; place is "indoor" or "sunny"."""

    place: str
    name: str
    radiance: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class View:
    """The camera on the sphere, in the map's frame.

    rotation [3, 3] = world from camera; position [3]; tan_half: tangent of half the field of view.
    n, wo [P, 3]: of the pixel centres that the sphere covers, row by row, world frame.
    mask [S, S]: those pixels. inner [P]: those that the sphere covers wholly.
    """

    rotation: np.ndarray
    position: np.ndarray
    tan_half: float
    n: np.ndarray
    wo: np.ndarray
    mask: np.ndarray
    inner: np.ndarray


def material(kind: str, alpha: float) -> Material:
    """A conductor with F = 1, or a coloured plastic of index IOR."""
    albedo, f0 = (np.zeros(3), 1.0) if kind == "conductor" else (np.array(ALBEDO), f0_from_ior(IOR))
    return Material(albedo=albedo.astype(np.float32), f0=np.full(3, f0, np.float32), alpha=alpha)


def bright_share(radiance: np.ndarray) -> float:
    """Share of all light that comes from the BRIGHT_PIXELS that send most."""
    power = np.sort((luminance(radiance) * pixel_solid_angles(radiance.shape[0])).ravel())[::-1]
    return float(power[:BRIGHT_PIXELS].sum() / power.sum())


def choose_lights(data: Path | None) -> list[Light]:
    """An indoor and a sunny map: the medians by bright_share of data/hdri/test, else of our own."""
    if data is None:
        indoor = {f"own room {seed}": room(np.random.default_rng(seed)) for seed in range(OWN_MAPS)}
        sunny = {f"own sky {seed}": sky(np.random.default_rng(seed)) for seed in range(OWN_MAPS)}
    else:
        folder = data / "hdri" / "test"
        maps, night = load_maps(folder), _not_by_day(folder)
        indoor = {asset.name: asset.radiance for asset in maps if asset.indoor}
        sunny = {m.name: m.radiance for m in maps if not m.indoor and m.name not in night}
    sunny = {name: radiance for name, radiance in sunny.items() if luminance(radiance).max() > SUN}
    if not indoor or not sunny:
        raise InputError(
            f"{data}/hdri/test: expected indoor and sunny outdoor maps (manifest.csv, column category), got "
            f"{len(indoor)} and {len(sunny)}; leave --data out to use maps of our own"
        )
    return [_median(indoor, "indoor"), _median(sunny, "sunny")]


def _median(maps: dict[str, np.ndarray], place: str) -> Light:
    name = sorted(maps, key=lambda name: bright_share(maps[name]))[len(maps) // 2]
    return Light(place=place, name=name, radiance=maps[name])


def _not_by_day(folder: Path) -> set[str]:
    """Names of the maps whose manifest says another time than day."""
    for manifest in (folder / "manifest.csv", folder.parent / "manifest.csv"):
        if manifest.is_file():
            with manifest.open(newline="", encoding="utf-8") as stream:
                rows = list(csv.DictReader(stream))
            return {Path(row["file"]).stem for row in rows if row.get("time", "day") not in ("", "day")}
    return set()


def choose_view(radiance: np.ndarray, size: int) -> View:
    """Look down 15 degrees, with the map's brightest direction 60 degrees to the right behind the camera."""
    weight = luminance(radiance) * pixel_solid_angles(radiance.shape[0])
    toward = pixel_directions(radiance.shape[0]).reshape(-1, 3)[weight.argmax()]
    yaw = np.arctan2(toward[0], toward[2]) - np.radians(60.0)
    rotation = world_from_camera(yaw, np.radians(15.0))
    distance = 1.0 / np.sin(np.radians(FOV_DEG) / 2)
    tan_half = MARGIN * np.tan(np.radians(FOV_DEG) / 2)
    n, wo, mask = sphere_points(tan_half, distance, size)
    edge = (np.arange(size + 1) / size * 2 - 1) * tan_half  # a pixel is inside if its corners are
    corner = np.hypot(*np.meshgrid(edge, edge)) < np.tan(np.radians(FOV_DEG) / 2)
    covered = corner[1:, 1:] & corner[1:, :-1] & corner[:-1, 1:] & corner[:-1, :-1]
    return View(
        rotation=rotation,
        position=rotation @ np.array([0.0, 0.0, distance]),
        tan_half=float(tan_half),
        n=(n @ rotation.T).astype(np.float32),
        wo=(wo @ rotation.T).astype(np.float32),
        mask=mask,
        inner=covered[mask],
    )


def sphere_points(
    tan_half: float, distance: float, size: int, offset: tuple[float, float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """n, wo [P, 3] in the camera's frame and mask [S, S] of the pixels whose centre + offset meets the sphere.

    offset: (right, down) in pixels.
    """
    x = ((np.arange(size) + 0.5)[None, :] + offset[0]) / size * 2 - 1
    y = ((np.arange(size) + 0.5)[:, None] + offset[1]) / size * 2 - 1
    ray = np.stack(np.broadcast_arrays(x * tan_half, -y * tan_half, -1.0), axis=-1)
    ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    # |o + t d| = 1 with o = (0, 0, distance)
    half_b = ray[..., 2] * distance
    discriminant = half_b**2 - (distance**2 - 1.0)
    mask = discriminant > 0
    t = -half_b - np.sqrt(np.where(mask, discriminant, 0.0))
    n = t[..., None] * ray + np.array([0.0, 0.0, distance])
    return n[mask], -ray[mask], mask
