"""Ranking of maps by how well each explains the photo of an object: analysis by synthesis, without the network's map.

A pixel of an object of uniform material shows a E(n) + b S(r), channel by channel: irradiance at its normal and, with
Schlick's Fresnel term, radiance blurred by the coat around the reflected ray. For every map, camera pitch, yaw and
coat, a and b >= 0 are fitted; the residual is compared in the logarithm, where exposure and the object's colour are
free. Errors of the normals change brightness far more than hue, so that the two are scored separately:

    misfit = NATS (ln(mean square of brightness + FLOOR) + HUE_WEIGHT ln(mean square of hue + FLOOR / 10))

This is a negative logarithm of probability: that of 2 NATS independent residuals whose variance is free is NATS
ln(mean square). Where the photo shows its background, the cost of match.background is added; and the camera's pitch has
a normal prior around the estimated one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import dot, normalize, reflect
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_solid_angles
from anyprobe.core.response import CLIPPED, inverse_response
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cosine_power, irradiance_map
from anyprobe.match import background
from anyprobe.match.background import CLIPPED_WEIGHT, FAINT_SEEN, YAWS, Background, map_from_camera_at, mean_squares
from anyprobe.paper.equations import schlick_weight
from anyprobe.render.surface import pixel_rays

MATCH_ROWS = 32
"""Rows of the maps that are compared."""
PIXELS, FINE_PIXELS = 96, 160
"""Number of object pixels compared, in the search and in its refinement."""
SHARPNESS = (2.0, 6.0, 20.0, 70.0)
"""Exponents of the blurs (light.filtering) that stand for coats of GGX alpha 0.5, 0.3, 0.17 and 0.1 or less."""
PITCHES_DEG = tuple(range(-5, 81, 12))
"""Camera pitches [degrees] that are tried, downwards."""
NATS = 2.0
"""Half the number of independent residuals of brightness: an object shows about as many shades as low orders of light.

With it the prior of the pitch, half the squared deviation, weighs what was best on left-out renders.
"""
STEEPNESS = (0.8, 1.0, 1.25)
"""Factors of the slant of estimated normals, which tend to be too flat or too steep as a whole."""
KEPT = 8
"""Number of places of each map that are refined."""
LEAST_FACING = 0.15
"""Smallest n.wo of a pixel that counts; estimated normals at the rim are poor."""
F0 = 0.04
"""Reflectance of a dielectric coat at normal incidence."""
FLOOR, HUE_WEIGHT = 0.003, 2.0
"""Parameters of the misfit above."""
GREY, GOLDEN_ANGLE = 0.5, np.pi * (3 - np.sqrt(5))
"""Albedo of the sphere that stands for a map, and the turn from one of its pixels to the next."""
BATCH = 64
"""Number of maps searched at once."""
TINT = 0.5
"""Share of the difference in ln colour between estimate and map that is applied: the estimate's own colour is off by as
much."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shown:
    """P pixels of an object.

    Attributes:
        radiance: [P, 3], linear.
        clipped: [P], whether the pixel is clipped.
        n, wo: [P, 3], unit normals and directions to the camera, in the camera's frame.
        behind: the photo's background; None where it is unknown.
    """

    radiance: np.ndarray
    clipped: np.ndarray
    n: np.ndarray
    wo: np.ndarray
    behind: Background | None = None

    def turned(self, rotation: np.ndarray) -> Shown:
        """Rotate the directions by [3, 3], from the camera's frame into another."""
        behind = None if self.behind is None else replace(self.behind, d=self.behind.d @ rotation.T)
        return replace(self, n=self.n @ rotation.T, wo=self.wo @ rotation.T, behind=behind)


def shown_by(
    image: np.ndarray,
    normals: np.ndarray,
    tan_half: float,
    camera_from_crop: np.ndarray,
    behind: Background | None = None,
) -> Shown | None:
    """Sample pixels spread over the object of a crop; None where too few have a normal.

    Args:
        image: [2 S, 2 S, 4] display RGB times mask, and mask. normals: [S, S, 3] in the crop's frame, unit or zero.
        tan_half: tangent of half the crop's field of view.
    """
    side = len(normals)
    small = image.reshape(side, 2, side, 2, 4).mean(axis=(1, 3))
    wo = pixel_rays(tan_half, side)
    length = np.linalg.norm(normals, axis=-1)
    n = normals / np.maximum(length, 1e-6)[..., None]
    rows, columns = np.nonzero((small[..., 3] > 0.95) & (length > 0.5) & (dot(n, wo)[..., 0] > LEAST_FACING))
    if len(rows) < PIXELS // 4:
        return None
    chosen = np.random.default_rng(0).permutation(len(rows))[:FINE_PIXELS]
    rows, columns = rows[chosen], columns[chosen]
    display = small[rows, columns, :3] / small[rows, columns, 3:]
    n, wo = (directions[rows, columns] @ camera_from_crop.T for directions in (n, wo))
    return Shown(radiance=inverse_response(display), clipped=display.max(axis=-1) >= CLIPPED, n=n, wo=wo, behind=behind)


def shown_under(radiance: np.ndarray) -> Shown:
    """Return what a sphere of grey plastic shows of a map [H, 2H, 3] in the camera's frame, where there is no photo."""
    number = np.arange(FINE_PIXELS) + 0.5
    facing = LEAST_FACING + (1 - LEAST_FACING) * number / FINE_PIXELS
    across, turn = np.sqrt(1 - facing**2), GOLDEN_ANGLE * number
    n = np.stack([across * np.cos(turn), across * np.sin(turn), facing], axis=-1)
    wo = np.broadcast_to(np.array([0.0, 0.0, 1.0]), n.shape)
    small = reduced(radiance, 2 * MATCH_ROWS)
    matt = bilinear(irradiance_map(small) / np.pi, direction_to_uv(n))
    coat = bilinear(blur_cosine_power(small, SHARPNESS[-2]), direction_to_uv(reflect(wo, n)))
    lit = GREY * matt + coat * schlick_coat(n, wo)
    return Shown(radiance=np.maximum(lit, 0.0), clipped=np.zeros(len(n), bool), n=n, wo=wo)


def light_of(radiance: np.ndarray) -> tuple[np.ndarray, float]:
    """Reduce a map [H, 2H, 3] for comparison, to [32, 64, 3] float32 of mean 1, and return its mean."""
    small = reduced(radiance, MATCH_ROWS)
    weights = pixel_solid_angles(len(small))[..., None] / (4 * np.pi)
    level = max(float((small * weights).sum() / 3), 1e-12)
    return small / np.float32(level), level


def best_places(
    shown: Shown, lights: np.ndarray, pitch_deg: float | None = None, *, error_deg: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Find the best place of each map of [N, 32, 64, 3], see light_of: map_from_camera [N, 3, 3] and misfit [N].

    Args:
        pitch_deg, error_deg: camera pitch downwards and its standard deviation, 0: exact; None: unknown. A search that
            is refined by three quarters of their distance reaches 1.75 standard deviations.
    """
    near = (0.0,) if pitch_deg is None or not error_deg else (-error_deg, 0.0, error_deg)
    pitches = np.array(PITCHES_DEG if pitch_deg is None else [pitch_deg + one for one in near], np.float64)

    def price(pitch: np.ndarray) -> np.ndarray:
        """Return the negative logarithm of a normal distribution's density over its largest."""
        return 0.0 * pitch if pitch_deg is None or not error_deg else 0.5 * ((pitch - pitch_deg) / error_deg) ** 2

    found = [_places(shown, lights[start : start + BATCH], pitches, price) for start in range(0, len(lights), BATCH)]
    turns, misfits = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return turns, misfits


def gain_of(shown: Shown, estimate: np.ndarray, light: np.ndarray, map_from_camera: np.ndarray) -> np.ndarray:
    """Return the gain [3] at which a map lights the object's pixels as brightly as an estimate [H, 2H, 3] does.

    Where the photo shows the background: the gain halfway, in the logarithm, to the background's brightness.

    light: [H, 2H, 3] of the map, see light_of, in its own frame.
    """
    own, theirs = (
        bilinear(irradiance_map(reduced(radiance, MATCH_ROWS)), direction_to_uv(n)).mean(axis=0)
        for radiance, n in ((estimate, shown.n), (light, shown.n @ map_from_camera.T))
    )
    level = luminance(own) / max(float(luminance(theirs)), 1e-12)
    tint = np.maximum(own, 1e-12) / np.maximum(theirs * level, 1e-12)
    behind = None if shown.behind is None else shown.behind.level_of(light, map_from_camera)
    return (level if behind is None else np.sqrt(level * behind)) * tint**TINT


def _places(
    shown: Shown, lights: np.ndarray, pitches: np.ndarray, price: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    def more(index: np.ndarray, yaw: np.ndarray, pitch: np.ndarray) -> np.ndarray:
        """Return what a place's pitch and background add to its misfit."""
        behind = 0.0 if shown.behind is None else shown.behind.at_turns(lights, index, _turns(yaw, pitch))
        return price(pitch) + behind

    matt = (irradiance_map(lights) / np.pi).astype(np.float32)
    coats = [blur_cosine_power(lights, sharpness).astype(np.float32) for sharpness in SHARPNESS]
    misfit = np.stack([_search(shown, matt, coats, pitch) for pitch in pitches])  # [pitches, coats, N, yaws]
    if shown.behind is not None:
        misfit += np.stack([shown.behind.at_yaws(lights, pitch) for pitch in pitches])[:, None]
    misfit += price(pitches)[:, None, None, None]
    best = np.argpartition(misfit.transpose(2, 0, 3, 1).reshape(len(lights), -1), KEPT, axis=1)[:, :KEPT]
    at_pitch, at_yaw, coat = np.unravel_index(best.ravel(), (len(pitches), YAWS, 2 * len(SHARPNESS)))
    pitch, yaw = pitches[at_pitch], at_yaw * (2 * np.pi / YAWS)
    index = np.repeat(np.arange(len(lights)), KEPT)
    cost, steep = _compared(shown, matt, coats, index, pitch, yaw, coat)
    cost = cost + more(index, yaw, pitch)
    reach = np.diff(pitches).min() / 2 if len(pitches) > 1 else 0.0
    around = np.array([(0, 0), (0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)])
    around = around if reach else around[:3]
    for share in (1.0, 0.5):
        chosen = cost.reshape(len(lights), -1).argmin(axis=1) + np.arange(len(lights)) * (len(cost) // len(lights))
        index, pitch, yaw, coat, steep = (values[chosen] for values in (index, pitch, yaw, coat, steep))
        steps = around * share
        pitch = (pitch[:, None] + reach * steps[:, 0]).ravel()
        yaw = (yaw[:, None] + np.pi / YAWS * steps[:, 1]).ravel()
        index, coat, steep = (np.repeat(values, len(steps)) for values in (index, coat, steep))
        cost, steep = _compared(shown, matt, coats, index, pitch, yaw, coat, steep)
        cost = cost + more(index, yaw, pitch)
    table = cost.reshape(len(lights), -1)
    chosen = table.argmin(axis=1) + np.arange(len(lights)) * table.shape[1]
    return _turns(yaw[chosen], pitch[chosen]), table.min(axis=1)


def _turns(yaw: np.ndarray, pitch_deg: np.ndarray) -> np.ndarray:
    """Return map_from_camera of M places, [M, 3, 3]."""
    return np.stack([map_from_camera_at(*place) for place in zip(yaw, pitch_deg, strict=True)])


def _search(shown: Shown, matt: np.ndarray, coats: list[np.ndarray], pitch_deg: float) -> np.ndarray:
    """Return the misfit of every coat, map and yaw, [2 coats, N, YAWS]: each coat with and without a matt base."""
    few = slice(None, PIXELS)
    n, wo = (vectors[few] @ map_from_camera_at(0.0, pitch_deg).T for vectors in (shown.n, shown.wo))
    coat = schlick_coat(n, wo).astype(np.float32)
    at_n, at_r = (background.nearest_pixels(d, MATCH_ROWS) for d in (n, reflect(wo, n)))
    measured = _Measured(shown, few)
    e = background.seen_at_yaws(matt, at_n)
    cost = []
    for blurred in coats:
        s = background.seen_at_yaws(blurred, at_r)
        cost += [measured.misfit(e, s * coat), measured.misfit(None, s)]
    return np.stack(cost).reshape(len(cost), len(matt), YAWS)


def schlick_coat(n: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Compute the Fresnel term [P, 1] of a dielectric coat at each pixel."""
    return F0 + (1.0 - F0) * schlick_weight(np.maximum(dot(n, wo), 0.0))


def _compared(
    shown: Shown,
    matt: np.ndarray,
    coats: list[np.ndarray],
    index: np.ndarray,
    pitch_deg: np.ndarray,
    yaw: np.ndarray,
    coat: np.ndarray,
    steep: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least misfit of each of M places [M], interpolated between pixels, and its steepness factor.

    steep: factors to use instead of searching them.
    """
    turns = _turns(yaw, pitch_deg).astype(np.float32)
    measured, best, found = _Measured(shown, slice(None)), np.full(len(index), np.inf), np.ones(len(index))
    for factor in STEEPNESS:
        for number in range(2 * len(coats)):
            which = np.nonzero((coat == number) & (True if steep is None else steep == factor))[0]
            for part in np.array_split(which, max(1, len(which) // 256)) if len(which) else ():
                along = dot(shown.n, shown.wo) * shown.wo
                n = normalize(along + factor * (shown.n - along))  # its component across the line of sight scaled
                turn = turns[part].transpose(0, 2, 1)
                s = background.seen_along(coats[number // 2], index[part], reflect(shown.wo, n) @ turn)
                if number % 2:
                    cost = measured.misfit(None, s)
                else:
                    e = background.seen_along(matt, index[part], n @ turn)
                    cost = measured.misfit(e, s * schlick_coat(n, shown.wo))
                better = cost < best[part]
                best[part[better]], found[part[better]] = cost[better], factor
    return best, found


class _Measured:
    """Pixels of a photo prepared for comparison."""

    def __init__(self, shown: Shown, few: slice) -> None:
        radiance, clipped = shown.radiance[few].astype(np.float32), shown.clipped[few]
        mean = np.maximum(radiance.mean(axis=0), 1e-2 * radiance.mean() + 1e-6)  # for a channel that is 0 everywhere
        weight = np.where(clipped[:, None], CLIPPED_WEIGHT, 1.0) / (radiance + 2 * FAINT_SEEN * mean) ** 2
        self.weight = (weight / weight.sum(axis=0)).astype(np.float32)
        self.radiance, self.dark, self.clipped = radiance, (FAINT_SEEN * mean).astype(np.float32), clipped
        self.log = np.log(radiance + self.dark)
        share = np.where(clipped, CLIPPED_WEIGHT, 1.0)
        self.share = (share / share.sum()).astype(np.float32)

    def misfit(self, e: np.ndarray | None, s: np.ndarray) -> np.ndarray:
        """Return the misfit [M] of a e + b s, [M, P, 3] each, with the best a and b >= 0 of each channel."""
        drawn = self._fitted(e, s.astype(np.float32))
        drawn += self.dark
        rest = np.log(drawn, out=drawn)
        rest -= self.log
        if self.clipped.any():
            rest[:, self.clipped] = np.minimum(rest[:, self.clipped], 0.0)
        rest -= np.einsum("mpc,p->mc", rest, self.share)[:, None]
        brightness, hue = mean_squares(rest, self.share)
        return NATS * (np.log(brightness + FLOOR) + HUE_WEIGHT * np.log(hue + FLOOR / 10))

    def _fitted(self, e: np.ndarray | None, s: np.ndarray) -> np.ndarray:
        w, i = self.weight, self.radiance
        ss, is_ = np.einsum("mpc,mpc,pc->mc", s, s, w), np.einsum("mpc,pc->mc", s, w * i)
        alone = is_ / np.maximum(ss, 1e-12)
        if e is None:
            return s * alone[:, None]
        ee, ie = np.einsum("mpc,mpc,pc->mc", e, e, w), np.einsum("mpc,pc->mc", e, w * i)
        es = np.einsum("mpc,mpc,pc->mc", e, s, w)
        det = np.maximum(ee * ss - es**2, 1e-6 * ee * ss + 1e-20)
        a, b = (ie * ss - is_ * es) / det, (is_ * ee - ie * es) / det
        only_e = ie**2 * ss >= is_**2 * ee
        outside = (a < 0) | (b < 0)
        a = np.where(outside, np.where(only_e, ie / np.maximum(ee, 1e-12), 0.0), a)
        b = np.where(outside, np.where(only_e, 0.0, alone), b)
        return (a[:, None] * e + b[:, None] * s).astype(np.float32)
