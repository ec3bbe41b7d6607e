"""Use of a given material, which determines what a photo alone cannot: the colour and level of the light.

A matte red sphere in white light looks like a white one in red light, and a bright sphere in weak light like a dark one
in strong light. The network receives the material; its estimate is then moved halfway, in the logarithm, to the
level and colour at which the object, rendered with it, is as bright as its photo. A mirror of known shape is measured.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.core import Float
from anyprobe.core.contract import contract
from anyprobe.core.frames import dot, normalize, reflect
from anyprobe.core.latlong import bilinear, corners, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.resample import resample
from anyprobe.core.response import CLIPPED, inverse_response, response
from anyprobe.core.sampling import hammersley
from anyprobe.errors import InputError
from anyprobe.estimate.light_graph import Said
from anyprobe.estimate.sidecar import json_numbers
from anyprobe.light.environment import rotate
from anyprobe.notices import give, leave_out
from anyprobe.paper.equations import schlick_weight
from anyprobe.render.integrate import PATCHES, shade, shading_pyramid
from anyprobe.render.surface import pixel_rays
from anyprobe.scatter.materials import Material

_MIRROR = contract("mirror")

SMOOTH = 0.1
"""Largest alpha of a mirror: its lobe is one to three pixels of the map wide."""
MIRROR_STEEP: float = _MIRROR["steep"]
"""Smallest n.wo of a pixel that counts: at the rim one pixel mirrors a tenth of the sphere."""
LEVELS: int = _MIRROR["levels"]
"""Number of maps, of 64, 32 and 16 rows, that pixels are collected in: a coarse one joins pixels that lie far apart."""
MOST_STERADIANS = 0.1
"""Largest solid angle [sr] that a mirror's pixel may show: more is an error of its normals."""
ENOUGH: float = _MIRROR["enough"]
"""Number of pixels in a place of a map at which the measured light counts half."""
MEASURED_CONFIDENCE: float = _MIRROR["confidence"]
"""Probability that a measured display value is within 0.1 of the truth, on training maps and shapes: the camera's curve
is unknown, and its normals are estimated at every second pixel."""
ODDS: float = _MIRROR["odds"]
"""Ratio by which light above white is likelier in a clipped place than in one that is not seen."""


def is_mirror(material: Material) -> bool:
    """Return whether a material is a metal smooth enough to show its surroundings."""
    return not np.any(material.albedo) and material.alpha <= SMOOTH


def measure(
    radiance: Float[np.ndarray, "H 2*H 3"],
    image: Float[np.ndarray, "S S 4"],
    normals: Float[np.ndarray, "S//2 S//2 3"],
    tan_half: float,
    material: Material,
    mirrored: Float[np.ndarray, "S S 3"] | None = None,
    map_from_crop: Float[np.ndarray, "3 3"] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Replace the part of a map that the object mirrors by what its photo shows.

    A mirror shows F(n.wo) L(2 (n.wo) n - wo), with Schlick's F. Pixels fall into maps of several sizes; the finest that
    covers a direction well provides it, and the given map the rest. A clipped pixel marks where light above
    white may come from but not how much: that is taken from the given map. Where the photo holds radiance above white,
    it is measured too: each pixel's power, over the solid angle that it mirrors, goes to where it comes from.

    Args:
        radiance: [H, 2H, 3], the map in the photo's exposure units.
        image: [S, S, 4], the crop: display RGB times mask, and mask.
        normals: [S / 2, S / 2, 3] the true ones in the crop's frame, unit or zero.
        tan_half: tangent of half the crop's field of view.
        material: the mirror.
        mirrored: [S, S, 3], the crop's radiance times mask, of photos that hold it above white.
        map_from_crop: [3, 3]; None: the map is in the crop's frame.
    Returns:
        the map [H, 2H, 3] float32, and the measured share [H, 2H] of each of its pixels.
    """
    height = radiance.shape[0]
    n, known = _twice(normals)
    wo = pixel_rays(tan_half, len(image))
    seen = known & (image[..., 3] > INSIDE) & (dot(n, wo)[..., 0] > MIRROR_STEEP)
    wi = reflect(wo, n)
    angles = None if mirrored is None else _solid_angles(wi, known)[seen]
    n, wo, wi, display = n[seen], wo[seen], wi[seen], image[seen][:, :3]
    fresnel = material.f0 + (1.0 - material.f0) * schlick_weight(dot(n, wo))
    light = inverse_response(np.minimum(display, CLIPPED)) / fresnel
    clipped = display.max(axis=-1, keepdims=True) >= CLIPPED
    emitted = None
    if mirrored is not None:
        whole = mirrored[seen] / fresnel
        clipped, light, emitted = np.zeros_like(clipped), np.minimum(whole, 1.0), np.maximum(whole - 1.0, 0.0)
    wi = wi if map_from_crop is None else wi @ map_from_crop.T
    uv, at = direction_to_uv(wi), direction_to_uv(pixel_directions(height))
    result, unseen = np.minimum(radiance, 1.0).astype(np.float64), np.ones((height, 2 * height, 1))
    for level in reversed(range(LEVELS)):
        sums, count = _gather(light, uv, height >> level)
        share = count / (count + ENOUGH)
        given = np.concatenate([share * sums / np.maximum(count, 1e-6), share], axis=-1)
        given = given if level == 0 else bilinear(given, at)
        result = result * (1.0 - given[..., 3:]) + given[..., :3]
        unseen = unseen * (1.0 - given[..., 3:])
    place, count = _gather(clipped.repeat(3, axis=1), uv, height)
    place = place[..., :1] / (count + ENOUGH)
    result = result + _above_white(np.maximum(radiance - 1.0, 0.0), place, unseen)
    if emitted is not None and angles is not None:
        result = result + _laid_down(emitted, angles, uv, height)
    return result.astype(np.float32), 1.0 - unseen[..., 0]


def _above_white(above: np.ndarray, clipped: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Redistribute the light `above` white [H, 2H, 3] over shares [H, 2H, 1] of clipped and of unseen places.

    Half of its power is spread over all clipped places: an emitter and a white wall clip alike. The other half goes
    to those where `above` has its own. Where nothing is clipped, its unseen part stays.
    """
    if not clipped.any():
        return above * unseen
    areas = pixel_solid_angles(len(above))[..., None]
    one, power = above.mean(axis=-1, keepdims=True), (above * areas).sum(axis=(0, 1))
    alike = power.mean() / (clipped * areas).sum()
    share = ODDS * clipped * (one + alike) + unseen * one
    return share * power / max((share * areas).sum(), 1e-12)


def _solid_angles(wi: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the solid angle [sr] that each pixel of a mirror shows, [S, S, 1], by its neighbours' directions [S, S,
    3]."""

    def steps(wi: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Return the mean way to the pixels above and below that are known too."""
        both = (known[1:] & known[:-1])[..., None].astype(np.float32)
        way, count = (np.pad(one, ((1, 1), (0, 0), (0, 0))) for one in (np.diff(wi, axis=0) * both, both))
        return (way[:-1] + way[1:]) / np.maximum(count[:-1] + count[1:], 1.0)

    down, across = steps(wi, known), steps(wi.swapaxes(0, 1), known.T).swapaxes(0, 1)
    return np.minimum(np.linalg.norm(np.cross(down, across), axis=-1, keepdims=True), MOST_STERADIANS)


def _laid_down(emitted: np.ndarray, angles: np.ndarray, uv: np.ndarray, height: int) -> np.ndarray:
    """Accumulate the power of radiance [P, 3] over solid angles [P, 1] at uv [P, 2] into a map [H, 2H, 3].

    A pixel that shows more than one of the map's goes into a coarser map, so that no gaps appear between neighbours.
    """
    result, at = np.zeros((height, 2 * height, 3)), direction_to_uv(pixel_directions(height))
    areas = pixel_solid_angles(height)[..., None]
    level_of = np.clip(np.ceil(np.log2(np.maximum(angles[:, 0] / float(areas.max()), 1e-6)) / 2), 0, LEVELS - 1)
    for level in range(LEVELS):
        chosen = level_of == level
        power = (emitted * angles)[chosen]
        if not power.any():
            continue
        sums, _ = _gather(power, uv[chosen], height >> level)
        found = sums / pixel_solid_angles(height >> level)[..., None]
        if level:
            found = bilinear(found, at)
            found *= power.sum(axis=0) / np.maximum((found * areas).sum(axis=(0, 1)), 1e-12)
        result += found
    return result


def _twice(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Double the size of normals by bilinear interpolation; also return where all sources are known."""
    side = 2 * len(normals)
    mixed = resample(normals, (side, side), smooth=True)
    return normalize(mixed), np.linalg.norm(mixed, axis=-1) > 0.9


def _gather(values: np.ndarray, uv: np.ndarray, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Splat values [P, 3] onto the four pixels around each uv [P, 2]: sums [H, 2H, 3] and counts [H, 2H, 1]."""
    width = 2 * height
    column = np.mod(uv[:, 0] * width - 0.5, width)
    row = np.clip(uv[:, 1] * height - 0.5, 0.0, height - 1.001)
    sums = np.zeros((height * (width + 1) + 1, 4))
    stacked = np.concatenate([values, np.ones_like(values[:, :1])], axis=1)
    for index, share in corners(column, row, width + 1):
        np.add.at(sums, index, stacked * share[:, None])
    wide = sums[:-1].reshape(height, width + 1, 4)
    wide[:, 0] += wide[:, width]  # the column after the last is the first again
    return wide[:, :width, :3], wide[:, :width, 3:]


INSIDE = 0.99
"""Smallest coverage of a pixel that is the object's alone."""
MAX_STOPS = 3.0
"""Largest gain or loss of a channel [stops]: more is not caused by the material."""
MAX_POINTS, NUM_SAMPLES = 400, 64
"""Largest number of object points, evenly spread, and samples of each."""
TRUST = 0.5
"""Share of the gain that is applied, in the logarithm; the best of 0, 0.5 and 1 on the left-out part of the world test
set (research.limits)."""


def use_material(
    said: Said, material: Material, has_normals: bool, is_above_white: bool, worth: float = 1.0
) -> tuple[Said, dict]:
    """Adapt what the networks say to a known material.

    A mirror is measured where its normals are given too; everything else gets TRUST of fit_gain's gain.

    Args:
        has_normals: whether said.object_normals are given rather than estimated.
        is_above_white: whether the photo holds radiance above white.
        worth: factor of the confidence, by how well the object is exposed.
    Returns:
        the same with another map and confidence, and a record for the sidecar.
    """
    colors = {name: json_numbers(getattr(material, name), 5) for name in ("albedo", "f0")}
    done = {**colors, "alpha": float(material.alpha)}
    normals, turn = said.object_normals, said.camera_from_crop
    if normals is None:
        text = "expected a model that estimates normals, got one that does not"
        raise InputError(text, subject="material", remedy=(*give(model="lift"), *leave_out("material")))
    if has_normals and is_mirror(material):
        mirrored = _mirrored(said.crop) if is_above_white else None
        radiance, seen = measure(said.radiance, said.image, normals, said.tan_half, material, mirrored, turn)
        confidence = said.confidence
        if confidence is not None:
            confidence = (confidence + seen * (worth * MEASURED_CONFIDENCE - confidence)).astype(np.float32)
        how = {"material": done, "measured": True, "above_white": is_above_white}
        return replace(said, radiance=radiance, confidence=confidence), how
    gain = fit_gain(rotate(said.radiance, turn.T), said.image, normals, said.tan_half, material) ** TRUST
    return replace(said, radiance=said.radiance * gain), {"material": done, "gain": json_numbers(gain, 5)}


def _mirrored(crop: Float[np.ndarray, "S S 4"]) -> Float[np.ndarray, "S S 3"]:
    """Return the radiance times mask of a crop that holds it above white."""
    mask = crop[..., 3:]
    shown = crop[..., :3] / np.maximum(mask, 1e-3)
    return mask * np.where(shown > 1, shown, inverse_response(np.minimum(shown, 1.0)))


def fit_gain(
    radiance: Float[np.ndarray, "H 2*H 3"],
    image: Float[np.ndarray, "S S 4"],
    normals: Float[np.ndarray, "N N 3"],
    tan_half: float,
    material: Material,
) -> Float[np.ndarray, " 3"]:
    """Return the gain of each channel at which the object, rendered with the map, is as bright as its photo.

    Compared by the mean display value: where the light is misplaced, single pixels carry no information.

    Args:
        radiance: [H, 2H, 3], the map in the crop's frame.
        image: [S, S, 4], the crop: display RGB times mask, and mask.
        normals: [S / k, S / k, 3] in the crop's frame, unit, for a whole number k.
        tan_half: tangent of half the crop's field of view.
        material: of the object.
    Returns:
        [3] float32, within MAX_STOPS; ones where no pixel is the object's alone.
    """
    size = len(normals)
    small = image.reshape(size, len(image) // size, size, -1, 4).mean(axis=(1, 3))
    inside = np.argwhere((small[..., 3] > INSIDE) & (np.linalg.norm(normals, axis=-1) > 0.5))
    if len(inside) == 0:
        return np.ones(3, np.float32)
    chosen = inside[np.unique(np.linspace(0, len(inside) - 1, MAX_POINTS).astype(int))]
    at = tuple(chosen.T)
    n, wo = (np.asarray(v[at], np.float32) for v in (normals, pixel_rays(tan_half, size)))
    wide = shading_pyramid(radiance)
    pyramid = wide if material.alpha >= PATCHES[0][0] else shading_pyramid(radiance, material.alpha)
    seen = shade(pyramid, n, wo, np.float32(material.alpha), hammersley(NUM_SAMPLES), wide=wide).radiance(material)
    target = small[at][:, :3].mean(axis=0)
    low, high = np.full(3, -MAX_STOPS), np.full(3, MAX_STOPS)
    for _ in range(24):
        middle = (low + high) / 2
        darker = response(seen * np.exp2(middle)).clip(max=1.0).mean(axis=0) < target
        low, high = np.where(darker, middle, low), np.where(darker, high, middle)
    return np.exp2((low + high) / 2).astype(np.float32)
