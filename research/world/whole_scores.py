"""What is said of an estimate for a whole photo: of its map, of three things it lights, of how hard its light is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Protocol

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x, rotation_z, world_from_camera
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.result import Light
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.light.filtering import blur_cap
from anyprobe.light.light_sources import LIKELY, NO_SOURCE, LightSource, find_sources
from anyprobe.render.surface import cover, frame_object, pixel_rays, see
from anyprobe_train.dataset.random_shapes import lathe
from anyprobe_train.evaluate.metrics import direction_error_deg, false_sources, gain_rmse, power_ratio_stops, rmse, ssim
from research.clustered import coverage, rank_correlation, with_error
from research.compare.three_spheres import clean_scores
from research.compare.transport import light, reflectance_matrix

PLACE_DEG, APART_DEG = 8.0, 16.0
"""Radius of a place whose share of the power is taken, and how far the second brightest place is off the first."""
SOFT = 0.08
"""Hardness below which there is no dominant light to find."""
MEANS = ("ldr_rmse", "gain_rmse", "ssim", "white", "chrome", "vase", "sources", "false_sources")
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


def relit(maps: Sequence[np.ndarray], photo: Judged) -> list[np.ndarray]:
    """The vase and its ground under maps [64, 128, 3] of the photo's camera: display values [P, 3]."""
    turn = world_from_photo(photo.pitch_deg, photo.roll_deg)
    turned = [np.maximum(rotate(np.asarray(one, np.float32), turn), 0) for one in maps]
    return [response(np.maximum(values, 0)) for values in light(stage()[0], turned)]


@dataclass(frozen=True, kw_only=True, slots=True)
class Answer:
    """A map [64, 128, 3], with its light sources as its user is told of them."""

    radiance: np.ndarray
    sources: Sequence[LightSource]

    @classmethod
    def of(cls, given: np.ndarray | Light) -> Answer:
        """Return the answer of an estimate, or of a map alone."""
        if isinstance(given, Light):
            return cls(radiance=given.radiance, sources=given.sources())
        return cls(radiance=given, sources=find_sources(given))

    @property
    def main(self) -> LightSource:
        """The dominant light."""
        return next(iter(self.sources), NO_SOURCE)


def sky_over_ground(radiance: np.ndarray, pitch_deg: float, roll_deg: float) -> float:
    """Return log2 of the mean luminance of a map [H, 2H, 3] above the horizon over that below it [stops]."""
    bright = luminance(np.asarray(radiance, np.float64)) * pixel_solid_angles(len(radiance))
    above = pixel_directions(len(radiance)) @ up_of(pitch_deg, roll_deg) > 0
    sky, ground = (max(float(bright[half].sum()), 1e-6) for half in (above, ~above))
    return float(np.log2(sky / ground))


class Judged(Protocol):
    """What is known of a photo: truth [64, 128, 3] in its camera's frame, and how far that looks down and is turned."""

    truth: np.ndarray
    pitch_deg: float
    roll_deg: float


def score(photo: Judged, rows: Mapping[str, np.ndarray | Light]) -> dict[str, dict[str, float]]:
    """Return figures of every row's map [64, 128, 3], or estimate, of one photo."""
    truth, answers = photo.truth, {name: Answer.of(one) for name, one in rows.items()}
    maps = [one.radiance for one in answers.values()]
    spheres = clean_scores(truth, maps)
    true_vase, *vases = relit([truth, *maps], photo)
    main, hard = Answer.of(truth).main, brightest_places(truth)
    posture = photo.pitch_deg, photo.roll_deg
    true_sky = sky_over_ground(truth, *posture)
    scores = {}
    for (name, answer), three, vase in zip(answers.items(), spheres, vases, strict=True):
        one = answer.radiance
        scores[name] = {
            "ldr_rmse": rmse(response(one), response(truth)),
            "gain_rmse": gain_rmse(one, truth),
            "ssim": ssim(response(one), response(truth)),
            "dominant_deg": direction_error_deg(answer.main.direction, main.direction),
            "said_deg": float(answer.main.error_deg),
            "dominant_color": direction_error_deg(answer.main.irradiance, main.irradiance),
            "power": power_ratio_stops(one, truth),
            "sky_ground": sky_over_ground(one, *posture) - true_sky,
            "sources": sum(source.exists >= LIKELY for source in answer.sources),
            "false_sources": false_sources(answer.sources, one, truth),
            "white": three["clean_diffuse_si_rmse"],
            "chrome": three["clean_mirror_si_rmse"],
            "vase": rmse(vase, true_vase),
            "hardness": float(brightest_places(one).sum()),
            "true_hardness": float(hard.sum()),
        }
    return scores


def summary(scores: Sequence[Mapping[str, float]], maps: Sequence[str]) -> dict[str, float]:
    """Return means, medians and shares of one row over photos, each with its standard error by map (NAME_error).

    maps: of each photo, its map's name.
    """
    column = {name: np.array([one[name] for one in scores], float) for name in scores[0]}
    deg, true_hard, hard = column["dominant_deg"], column["true_hardness"], column["hardness"]
    figures = {name: with_error(np.mean, maps, column[name]) for name in MEANS}
    figures |= {
        "dominant_deg": with_error(np.median, maps, deg),
        "dominant_deg_harder": with_error(partial(_of_hardest, share=1 / 2), maps, deg, true_hard),
        "dominant_deg_hardest": with_error(partial(_of_hardest, share=1 / 3), maps, deg, true_hard),
        "dominant_color": with_error(np.median, maps, column["dominant_color"]),
        "said_deg": with_error(np.median, maps, column["said_deg"]),
        "said_holds": with_error(coverage, maps, column["said_deg"], deg),
        "said_ranks": with_error(rank_correlation, maps, column["said_deg"], deg),
        "hardness_correlation": with_error(_correlation, maps, hard, true_hard),
    }
    for name in ("power", "sky_ground"):
        figures[f"{name}_abs"] = with_error(np.mean, maps, np.abs(column[name]))
        figures[f"{name}_median"] = with_error(np.median, maps, column[name])
    made = {f"{name}{end}": one for name, two in figures.items() for end, one in zip(("", "_error"), two, strict=True)}
    thirds = np.array_split(np.argsort(true_hard), 3)
    for third, which in zip(("soft", "middle", "hard"), thirds, strict=True):
        if len(which):
            made[f"hardness_{third}"] = float(np.median(hard[which]))
            made[f"true_hardness_{third}"] = float(np.median(true_hard[which]))
    soft = true_hard < SOFT
    made["hardness_below_08"] = float(np.median(hard[soft])) if soft.any() else float("nan")
    return made


def _of_hardest(deg: np.ndarray, true_hard: np.ndarray, share: float) -> float:
    """Median angle under the hardest lights, the share of all that is said."""
    return float(np.median(deg[true_hard >= np.quantile(true_hard, 1 - share)]))


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    return 0.0 if min(np.std(a), np.std(b)) < 1e-9 else float(np.corrcoef(a, b)[0, 1])
