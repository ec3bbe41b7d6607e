"""Mirror (noun): polished metal of known shape is a classical light probe: what it shows is measured, not guessed."""

from __future__ import annotations

import numpy as np
from PIL import Image

from anyprobe.core.frames import dot, normalize, reflect
from anyprobe.core.latlong import bilinear, corners, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response
from anyprobe.render.surface import pixel_rays
from anyprobe.scatter.brdf import Material
from anyprobe.scatter.microfacet import schlick_weight

SMOOTH = 0.1
"""Largest alpha of a mirror: its lobe is a pixel or three of the map wide."""
STEEP = 0.2
"""Least n.wo of a pixel that counts: at the rim one pixel mirrors a tenth of the sphere."""
BURNT = 0.97
"""Display value from which on a pixel says only how bright its light is at least."""
LEVELS = 3
"""Maps of 64, 32 and 16 rows that pixels fall into: where they lie far apart, a coarse one joins them."""
ENOUGH = 0.5
"""Pixels that a place of a map must have seen for the measured light to count half."""
MEASURED = 0.65
"""How likely a display value that is measured whole is within 0.1 of the truth, on training maps and shapes: a camera's
curve is not known, and its normals are told by a pixel in two."""
ODDS = 10.0
"""How much likelier light above white is in a place that is burnt out than in one that is not seen."""


def is_mirror(material: Material) -> bool:
    """A metal smooth enough to show its surroundings."""
    return not np.any(material.albedo) and material.alpha <= SMOOTH


def measure(
    radiance: np.ndarray, image: np.ndarray, normals: np.ndarray, tan_half: float, material: Material
) -> tuple[np.ndarray, np.ndarray]:
    """Replace what the object mirrors of a map by what its photo shows of it.

    A mirror shows F(n.wo) L(2 (n.wo) n - wo), with Schlick's F. Pixels fall into maps of several sizes; the finest that
    has seen enough of a place tells it, the given map what none has seen. A burnt-out pixel tells where light above
    white may come from but not how much there is: that is the given map's.

    Args:
        radiance: [H, 2H, 3], the map in the crop's frame and the photo's exposure units.
        image: [S, S, 4], the crop: display RGB times mask, and mask.
        normals: [S / 2, S / 2, 3] the true ones in the crop's frame, unit or zero.
        tan_half: of half the angle that the crop's side takes in.
        material: the mirror.
    Returns:
        the map [H, 2H, 3] float32, and the share [H, 2H] of each of its pixels that was measured.
    """
    height = radiance.shape[0]
    n, known = _twice(normals)
    wo = pixel_rays(tan_half, len(image))
    seen = known & (image[..., 3] > 0.99) & (dot(n, wo)[..., 0] > STEEP)
    n, wo, display = n[seen], wo[seen], image[seen][:, :3]
    fresnel = material.f0 + (1.0 - material.f0) * schlick_weight(dot(n, wo))
    light = inverse_response(np.minimum(display, BURNT)) / fresnel
    burnt = display.max(axis=-1, keepdims=True) >= BURNT
    uv, at = direction_to_uv(reflect(wo, n)), direction_to_uv(pixel_directions(height))
    result, unseen = np.minimum(radiance, 1.0).astype(np.float64), np.ones((height, 2 * height, 1))
    for level in reversed(range(LEVELS)):
        sums, count = _gather(light, uv, height >> level)
        share = count / (count + ENOUGH)
        told = np.concatenate([share * sums / np.maximum(count, 1e-6), share], axis=-1)
        told = told if level == 0 else bilinear(told, at)
        result = result * (1.0 - told[..., 3:]) + told[..., :3]
        unseen = unseen * (1.0 - told[..., 3:])
    place, count = _gather(burnt.repeat(3, axis=1), uv, height)
    place = place[..., :1] / (count + ENOUGH)
    result = result + _above_white(np.maximum(radiance - 1.0, 0.0), place, unseen)
    return result.astype(np.float32), 1.0 - unseen[..., 0]


def _above_white(above: np.ndarray, burnt: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Light `above` white [H, 2H, 3] moved to where it can be: shares [H, 2H, 1] of places burnt out, and not seen.

    One half of its flux is shared among all burnt-out places: a lamp and a white wall burn out alike. The other goes to
    those where `above` has its own. Where nothing is burnt out, what nobody has seen of it stays.
    """
    if not burnt.any():
        return above * unseen
    areas = pixel_solid_angles(len(above))[..., None]
    one, flux = above.mean(axis=-1, keepdims=True), (above * areas).sum(axis=(0, 1))
    alike = flux.mean() / (burnt * areas).sum()
    share = ODDS * burnt * (one + alike) + unseen * one
    return share * flux / max((share * areas).sum(), 1e-12)


def _twice(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals at twice the size by bilinear interpolation, and where all that they are made of are known."""
    side = 2 * len(normals)
    planes = [Image.fromarray(np.ascontiguousarray(normals[..., k], np.float32)) for k in range(3)]
    mixed = np.stack([plane.resize((side, side), Image.Resampling.BILINEAR) for plane in planes], axis=-1)
    return normalize(mixed), np.linalg.norm(mixed, axis=-1) > 0.9


def _gather(values: np.ndarray, uv: np.ndarray, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums [H, 2H, 3] and counts [H, 2H, 1] of values [P, 3], shared among the four pixels around each uv [P, 2]."""
    width = 2 * height
    column = np.mod(uv[:, 0] * width - 0.5, width)
    row = np.clip(uv[:, 1] * height - 0.5, 0.0, height - 1.001)
    sums = np.zeros((height * (width + 1) + 1, 4))
    stacked = np.concatenate([values, np.ones_like(values[:, :1])], axis=1)
    for index, share in corners(column, row, width + 1):
        np.add.at(sums, index, stacked * share[:, None])
    wide = sums[:-1].reshape(height, width + 1, 4)
    wide[:, 0] += wide[:, width]  # one column further is the first again
    return wide[:, :width, :3], wide[:, :width, 3:]
