"""Everything that is said of one estimate: the paper's Table 1 (Sect. 4.1), Figs. 13-14 (Sect. 4.2), and the field's.

All methods of a pair are scored together, since a transport matrix costs as much for one map
as for ten.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from anyprobe.core.frames import reflect, world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import response
from anyprobe.light.environment import MAP_HEIGHT, integral
from anyprobe.light.harmonics import COSINE_LOBE, project
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.paper.chain import LN_SCALE
from anyprobe.render.spheres import sphere_normals
from anyprobe.render.surface import Surface, frame_object, see
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.dataset.random_shapes import lathe
from anyprobe_train.evaluate.methods import Estimate
from anyprobe_train.evaluate.metrics import (
    color_angle_deg,
    direction_error_deg,
    power_ratio_stops,
    psnr,
    rmse,
    si_rmse,
    ssim,
)
from research.compare.lights import find_lights, matched_lights_deg, peak_direction
from research.compare.three_spheres import clean_scores, field_scores
from research.compare.transport import array_of_spheres, light, reflectance_matrix

SPHERE_SIZE = 64
VIRTUAL_SIZE = 96
VIRTUAL = {"albedo": 0.5, "f0": 0.05, "alpha": 0.2}
"""The virtual object's grey plastic."""


def ln_unit(radiance: np.ndarray) -> np.ndarray:
    """ln radiance with LN_SCALE, -7 to 9, brought to 0 to 1 and clipped."""
    low, high = LN_SCALE
    ln = np.log(np.clip(radiance, np.exp(low), np.exp(high)))
    return (ln - low) / (high - low)


def tone(radiance: np.ndarray) -> np.ndarray:
    """Reinhard's L / (1 + L), then the 2.2th root: what SSIM of HDR maps sees. [0, 1)."""
    radiance = np.maximum(radiance, 0.0)
    return (radiance / (1.0 + radiance)) ** (1 / 2.2)


def irradiance_scores(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Of the irradiance image [128, 128, 3], the whole picture as in the paper."""
    return _three("irradiance", estimate, truth)


def ldr_scores(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Of LDR maps [64, 128, 3], every pixel alike; and RMSE of the half that faces the object's
    seen side (+Z, behind the camera) and of the half behind it."""
    seen = pixel_directions(truth.shape[0])[..., 2] > 0
    return {
        **_three("ldr", estimate, truth),
        "ldr_rmse_seen": rmse(estimate[seen], truth[seen]),
        "ldr_rmse_unseen": rmse(estimate[~seen], truth[~seen]),
    }


def hdr_scores(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Of radiance maps: PSNR and RMSE of ln_unit, SSIM of tone."""
    a, b = ln_unit(estimate), ln_unit(truth)
    return {"hdr_psnr": psnr(a, b), "hdr_rmse": rmse(a, b), "hdr_ssim": ssim(tone(estimate), tone(truth))}


def mirror_sphere(ldr: np.ndarray, size: int = SPHERE_SIZE) -> np.ndarray:
    """The map [H, 2H, 3] as a mirror sphere, black around it: [size, size, 3]."""
    normals, mask = sphere_normals(size)
    toward = np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape)
    picture = np.zeros((size, size, 3), np.float32)
    picture[mask] = bilinear(ldr, direction_to_uv(reflect(toward, normals)))
    return picture


def sphere_scores(ldr: np.ndarray, true_ldr: np.ndarray) -> dict[str, float]:
    """Fig. 13: the LDR maps as mirror spheres; PSNR and RMSE inside the sphere, SSIM of the picture."""
    mask = sphere_normals(SPHERE_SIZE)[1]
    a, b = mirror_sphere(ldr), mirror_sphere(true_ldr)
    return {"sphere_psnr": psnr(a[mask], b[mask]), "sphere_rmse": rmse(a[mask], b[mask]), "sphere_ssim": ssim(a, b)}


@lru_cache(maxsize=1)
def virtual_object() -> tuple[Surface, np.ndarray]:
    """A vase of our own and its transport [P, 64 * 128]: grey plastic, no shadow on itself."""
    mesh = lathe(np.random.default_rng(3), rows=80)
    camera = frame_object(mesh, world_from_camera(0.4, 0.2), fov_deg=20.0, size=VIRTUAL_SIZE)
    surface = see(mesh, camera)
    return surface, reflectance_matrix(surface.normals, surface.wo, MAP_HEIGHT, **VIRTUAL)


def relit(maps: list[np.ndarray]) -> list[np.ndarray]:
    """The virtual object under maps [64, 128, 3]: display pictures [96, 96, 3], black around it."""
    surface, matrix = virtual_object()
    pictures = []
    for values in light(matrix, maps):
        picture = np.zeros((VIRTUAL_SIZE, VIRTUAL_SIZE, 3), np.float32)
        picture[surface.mask] = response(values)
        pictures.append(picture)
    return pictures


def relight_scores(maps: list[np.ndarray]) -> list[dict[str, float]]:
    """Fig. 14: RMSE of the virtual object's display values; the first map is the truth."""
    mask = virtual_object()[0].mask
    truth, *guessed = relit(maps)
    return [{"relight_rmse": rmse(picture[mask], truth[mask])} for picture in guessed]


def sh_irradiance_error(p: np.ndarray, g: np.ndarray) -> float:
    """RMS over all normals of |E_p(n) - E_g(n)| / RMS of |E_g(n)|, E of order 2 (by Parseval)."""
    lobe = COSINE_LOBE[:, None]
    difference, truth = lobe * (project(p) - project(g)), lobe * project(g)
    return float(np.sqrt((difference**2).sum() / max((truth**2).sum(), 1e-12)))


def total_power_stops(p: np.ndarray, g: np.ndarray) -> dict[str, float]:
    """|log2| of the ratio of total power: of luminance and of each channel."""
    row = {"total_power_stops": abs(power_ratio_stops(p, g))}
    power_p, power_g = integral(p.astype(np.float64)), integral(g.astype(np.float64))
    for k, channel in enumerate("rgb"):
        row[f"power_{channel}_stops"] = float(abs(np.log2(max(power_p[k], 1e-9) / max(power_g[k], 1e-9))))
    return row


def sphere_array_scores(maps: list[np.ndarray]) -> list[dict[str, float]]:
    """Nine spheres on a plane, linear, whole picture: RMSE, si-RMSE, colour angle, PSNR (peak of both)."""
    truth, *guessed = array_of_spheres(maps)
    everywhere = np.ones(truth.shape[:2], bool)
    result = []
    for picture in guessed:
        result.append(
            {
                "array_rmse": rmse(picture, truth),
                "array_si_rmse": si_rmse(picture, truth, everywhere),
                "array_angle_deg": color_angle_deg(picture, truth, (picture.any(-1) & truth.any(-1))),
                "array_psnr": psnr(picture, truth, max(float(picture.max()), float(truth.max()), 1e-9)),
            }
        )
    return result


@dataclass(frozen=True, kw_only=True, slots=True)
class Lights:
    """Directions of a map's lights: peak and main [3]; matched and published, lists of find_lights."""

    peak: np.ndarray
    main: np.ndarray
    matched: list[np.ndarray]
    published: list[np.ndarray]

    @classmethod
    def of(cls, radiance: np.ndarray) -> Lights:
        """Of a map [H, 2H, 3]."""
        return cls(
            peak=peak_direction(radiance),
            main=find_dominant_light(radiance).direction,
            matched=find_lights(radiance),
            published=find_lights(radiance, published=True),
        )


def light_scores(p: Lights, g: Lights) -> dict[str, float]:
    """Angles [degrees] between peaks, dominant lights, and matched lights by luminance and as published."""
    row = {
        "peak_deg": direction_error_deg(p.peak, g.peak),
        "dominant_light_deg": direction_error_deg(p.main, g.main),
        "lights_deg": matched_lights_deg(p.matched, g.matched),
        "lights_published_deg": matched_lights_deg(p.published, g.published),
    }
    return {name: value for name, value in row.items() if value is not None}


def score_pair(pair: Pair, estimates: Mapping[str, Estimate]) -> dict[str, dict[str, float]]:
    """Every figure of every method on one pair; a figure that a method cannot have is absent.

    Pictures of virtual things are lit by Estimate.lights, so that methods without HDR maps have them too.
    """
    true_ldr = response(pair.radiance)
    rows: dict[str, dict[str, float]] = {}
    for name, one in estimates.items():
        rows[name] = ldr_scores(one.ldr, true_ldr) | sphere_scores(one.ldr, true_ldr)
        if one.irradiance is not None:
            truth, there = pair.irradiance / 255.0, pair.normals.any(axis=-1)
            rows[name] |= irradiance_scores(one.irradiance, truth)
            rows[name]["irradiance_rmse_object"] = rmse(one.irradiance[there], truth[there])
    maps = [pair.radiance, *(one.lights for one in estimates.values())]
    together = zip(
        estimates,
        field_scores(pair.radiance, maps[1:]),
        clean_scores(pair.radiance, maps[1:]),
        sphere_array_scores(maps),
        relight_scores(maps),
        strict=True,
    )
    for name, *parts in together:
        for part in parts:
            rows[name] |= part
    true_lights = Lights.of(pair.radiance)
    for name, one in estimates.items():
        if one.radiance is None:
            continue
        rows[name] |= light_scores(Lights.of(one.radiance), true_lights)
        rows[name] |= hdr_scores(one.radiance, pair.radiance) | total_power_stops(one.radiance, pair.radiance)
        rows[name]["sh9_irradiance"] = sh_irradiance_error(one.radiance, pair.radiance)
    return rows


def _three(prefix: str, a: np.ndarray, b: np.ndarray) -> dict[str, float]:
    return {f"{prefix}_psnr": psnr(a, b), f"{prefix}_rmse": rmse(a, b), f"{prefix}_ssim": ssim(a, b)}
