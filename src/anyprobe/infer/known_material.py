"""Known (adjective): a material that somebody tells, which settles what a photo alone cannot.

A photo of a dull red ball in white light is that of a dull white ball in red light, and a bright ball in weak light
that of a dark one in strong light. The networks decide by what is likely; a known material decides it.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.core.sampling import hammersley
from anyprobe.infer.fitted import fit_map
from anyprobe.infer.mirror import MEASURED, is_mirror, measure
from anyprobe.infer.runtime import Outputs
from anyprobe.render.integrate import PATCHES, shade, shading_pyramid
from anyprobe.render.surface import pixel_rays
from anyprobe.scatter.brdf import Material

MAX_STOPS = 3.0
"""Largest gain or loss of a channel: more is not the material's doing."""
MAX_POINTS = 400
NUM_SAMPLES = 64
INSIDE = 0.99
"""Coverage from which on a pixel is the object's alone."""


def use_material(
    outputs: Outputs, image: np.ndarray, tan_half: float, material: Material, known_normals: np.ndarray | None
) -> tuple[Outputs, dict]:
    """A model's answer, made to fit a material that is known.

    A mirror whose normals are known too is measured where they are (infer.mirror); all else gets fit_gain's gain, and
    then what fit_map finds in the object's shading.

    Args:
        outputs, image, tan_half: of a crop, see infer.runtime.Models.
        known_normals: [64, 64, 3] as they were told, zero where they were not; None where nothing was.
    Returns:
        the answer, and what was done, for the sidecar.
    """
    done = {name: _list(getattr(material, name)) for name in ("albedo", "f0")} | {
        "alpha": float(material.alpha)
    }
    if known_normals is not None and is_mirror(material):
        radiance, seen = measure(outputs.radiance, image, known_normals, tan_half, material)
        confidence = outputs.confidence
        if confidence is not None:
            confidence = (confidence + seen * (MEASURED - confidence)).astype(np.float32)
        return outputs.with_map(radiance, confidence), {"material": done, "measured": True}
    gain = fit_gain(outputs.radiance, image, outputs.normals, tan_half, material)
    told = np.zeros_like(outputs.normals) if known_normals is None else known_normals
    known = np.linalg.norm(told, axis=-1) > 0.5
    radiance = fit_map(outputs.radiance * gain, image, outputs.normals, tan_half, material, known)
    return outputs.with_map(radiance, outputs.confidence), {"material": done, "gain": _list(gain)}


def _list(values: np.ndarray) -> list[float]:
    return np.round(np.asarray(values, np.float64), 5).tolist()


def fit_gain(
    radiance: np.ndarray, image: np.ndarray, normals: np.ndarray, tan_half: float, material: Material
) -> np.ndarray:
    """The gain of each channel at which the object, rendered with the map, is as bright as its photo.

    Compared by the mean display value: where the light is placed wrongly, single pixels say nothing.

    Args:
        radiance: [H, 2H, 3], the map in the crop's frame.
        image: [S, S, 4], the crop: display RGB times mask, and mask.
        normals: [S / k, S / k, 3] in the crop's frame, unit, for a whole number k.
        tan_half: of half the angle that the crop's side takes in.
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
    shading = shade(pyramid, n, wo, np.float32(material.alpha), hammersley(NUM_SAMPLES), wide=wide)
    seen = shading.radiance(material)
    target = small[at][:, :3].mean(axis=0)
    low, high = np.full(3, -MAX_STOPS), np.full(3, MAX_STOPS)
    for _ in range(24):
        middle = (low + high) / 2
        darker = response(seen * np.exp2(middle)).clip(max=1.0).mean(axis=0) < target
        low, high = np.where(darker, middle, low), np.where(darker, high, middle)
    return np.exp2((low + high) / 2).astype(np.float32)
