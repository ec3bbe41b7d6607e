"""What is said of an estimate for a whole photo: of its map, of three things it lights, of how hard its light is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x, rotation_z, world_from_camera
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.evaluate.metrics import direction_error_deg, gain_rmse, power_ratio_stops, rmse, ssim
from anyprobe.light.dominant_light import find_dominant_light
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.light.filtering import blur_cap
from anyprobe.render.shapes import lathe
from anyprobe.render.surface import cover, frame_object, pixel_rays, see
from research.compare.three_spheres import clean_scores
from research.compare.transport import light, reflectance_matrix
from research.world.whole_photos import WholePhoto

PLACE_DEG, APART_DEG = 8.0, 16.0
"""Radius of a place whose share of the power is taken, and how far the second brightest place is off the first."""
STAGE_PX, STAGE_PITCH, STAGE_GRID, GROUND_REACH = 72, 0.45, 192, 6.0
GROUND_ALBEDO = 0.5
VASE = {"albedo": 0.5, "f0": 0.05, "alpha": 0.2}


def brightest_places(radiance: np.ndarray) -> np.ndarray:
    """Shares [2] of a map's power within PLACE_DEG of its brightest place and of the second, [H, 2H, 3]."""
    bright = luminance(np.asarray(radiance, np.float32))
    d, weights = pixel_directions(len(bright)), pixel_solid_angles(len(bright))
    blurred, power, shares = blur_cap(bright[..., None], np.radians(PLACE_DEG))[..., 0].copy(), bright * weights, []
    for _ in range(2):
        peak = d[np.unravel_index(np.argmax(blurred), blurred.shape)]
        cosine = d @ peak
        shares.append(power[cosine > np.cos(np.radians(PLACE_DEG))].sum() / max(power.sum(), 1e-12))
        blurred[cosine > np.cos(np.radians(APART_DEG))] = -1.0
    return np.array(shares)


def world_from_photo(pitch_deg: float, roll_deg: float) -> np.ndarray:
    """[3, 3] of a camera that looks down so far."""
    return rotation_x(-np.radians(pitch_deg)) @ rotation_z(np.radians(roll_deg))


@lru_cache(maxsize=1)
def stage() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A vase on grey ground, +Y up: its transport [P, 64 * 128], the vase's pixels and those that show anything."""
    mesh = lathe(np.random.default_rng(3), rows=80)
    camera = frame_object(mesh, world_from_camera(0.4, STAGE_PITCH), fov_deg=20.0, margin=2.2, size=STAGE_PX)
    surface = see(mesh, camera)
    vase = reflectance_matrix(
        surface.normals @ camera.world_from_camera.T.astype(np.float32),
        surface.wo @ camera.world_from_camera.T.astype(np.float32),
        MAP_HEIGHT,
        **VASE,
    )
    away = -pixel_rays(camera.tan_half, camera.size) @ camera.world_from_camera.T
    floor = mesh.positions[:, 1].min()
    distance = (floor - camera.position[1]) / np.minimum(away[..., 1], -1e-6)
    points = camera.position + distance[..., None] * away
    near = (away[..., 1] < 0) & (np.abs(points[..., [0, 2]]).max(axis=-1) < GROUND_REACH) & ~surface.mask
    ground = _shadowed_ground(mesh, floor, points[near])
    matrix = np.zeros((surface.mask.sum() + near.sum(), 2 * MAP_HEIGHT**2), np.float32)
    order = np.cumsum((surface.mask | near).ravel()).reshape(surface.mask.shape) - 1
    matrix[order[surface.mask]], matrix[order[near]] = vase, ground
    return matrix, surface.mask, surface.mask | near


def _shadowed_ground(mesh, floor: float, points: np.ndarray) -> np.ndarray:
    """Transport [P, 64 * 128] of Lambert ground points [P, 3] that the mesh hides the sky from."""
    # it is a body of rotation: one shadow for each elevation of the light, turned with it
    d = pixel_directions(MAP_HEIGHT).astype(np.float64)
    weights = pixel_solid_angles(MAP_HEIGHT)
    matrix = np.zeros((len(points), MAP_HEIGHT, 2 * MAP_HEIGHT), np.float32)
    height = mesh.positions[:, 1] - floor
    for row in range(MAP_HEIGHT // 2):
        rise, along = d[row, 0, 1], np.linalg.norm(d[row, 0, [0, 2]])
        landed = mesh.positions[:, [0, 2]] - np.stack([height * along / rise, np.zeros_like(height)], axis=-1)
        hidden = np.zeros(STAGE_GRID**2, bool)
        hidden[cover(((landed / GROUND_REACH + 1) * STAGE_GRID / 2)[mesh.faces], STAGE_GRID)[2]] = True
        hidden = hidden.reshape(STAGE_GRID, STAGE_GRID)
        x, z = (d[row, :, axis][None] / along for axis in (0, 2))
        turned = points[:, 0:1] * x + points[:, 2:3] * z, points[:, 2:3] * x - points[:, 0:1] * z
        column, line = (((one / GROUND_REACH + 1) * STAGE_GRID / 2).astype(int) for one in turned)
        inside = (np.minimum(column, line) >= 0) & (np.maximum(column, line) < STAGE_GRID)
        lit = ~(inside & hidden[line.clip(0, STAGE_GRID - 1), column.clip(0, STAGE_GRID - 1)])
        matrix[:, row] = GROUND_ALBEDO / np.pi * weights[row] * rise * lit
    return matrix.reshape(len(points), -1)


def relit(maps: Sequence[np.ndarray], photo: WholePhoto) -> list[np.ndarray]:
    """The vase and its ground under maps [64, 128, 3] of the photo's camera: display values [P, 3]."""
    turn = world_from_photo(photo.pitch_deg, photo.roll_deg)
    turned = [np.maximum(rotate(np.asarray(one, np.float32), turn), 0) for one in maps]
    return [response(np.maximum(values, 0)) for values in light(stage()[0], turned)]


def score(photo: WholePhoto, maps: Mapping[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Figures of every row's map [64, 128, 3] on one photo."""
    truth, names = photo.truth, list(maps)
    spheres = clean_scores(truth, [maps[name] for name in names])
    true_vase, *vases = relit([truth, *(maps[name] for name in names)], photo)
    main, hard = find_dominant_light(truth).direction, brightest_places(truth)
    rows = {}
    for name, three, vase in zip(names, spheres, vases, strict=True):
        one = maps[name]
        places = brightest_places(one)
        rows[name] = {
            "ldr_rmse": rmse(response(one), response(truth)),
            "gain_rmse": gain_rmse(one, truth),
            "ssim": ssim(response(one), response(truth)),
            "dominant_deg": direction_error_deg(find_dominant_light(one).direction, main),
            "power": power_ratio_stops(one, truth),
            "white": three["clean_diffuse_si_rmse"],
            "chrome": three["clean_mirror_si_rmse"],
            "vase": rmse(vase, true_vase),
            "hardness": float(places.sum()),
            "true_hardness": float(hard.sum()),
        }
    return rows


def summary(scores: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Means, medians and standard errors of one row over photos."""
    columns = {name: np.array([one[name] for one in scores]) for name in scores[0]}
    made: dict[str, float] = {}
    for name in ("ldr_rmse", "gain_rmse", "ssim", "white", "chrome", "vase"):
        made |= _with_error(name, columns[name], np.mean)
    made |= _with_error("dominant_deg", columns["dominant_deg"], np.median)
    true_hard, hard = columns["true_hardness"], columns["hardness"]
    made |= _with_error("dominant_deg_harder", columns["dominant_deg"][true_hard >= np.median(true_hard)], np.median)
    made |= _with_error("power_abs", np.abs(columns["power"]), np.mean)
    made |= _with_error("power_median", columns["power"], np.median)
    constant = np.std(hard) < 1e-9
    made["hardness_correlation"] = 0.0 if constant else float(np.corrcoef(hard, true_hard)[0, 1])
    thirds = np.array_split(np.argsort(true_hard), 3)
    for third, which in zip(("soft", "middle", "hard"), thirds, strict=True):
        made[f"hardness_{third}"] = float(np.median(hard[which]))
        made[f"true_hardness_{third}"] = float(np.median(true_hard[which]))
    soft = true_hard < 0.08
    made["hardness_below_08"] = float(np.median(hard[soft])) if soft.any() else float("nan")
    return made


def _with_error(name: str, values: np.ndarray, of) -> dict[str, float]:
    """A figure and its standard error by 400 bootstrap samples."""
    rng = np.random.default_rng(0)
    drawn = [of(values[rng.integers(len(values), size=len(values))]) for _ in range(400)]
    return {name: float(of(values)), f"{name}_error": float(np.std(drawn))}
