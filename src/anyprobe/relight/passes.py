"""A relit photo as separate passes for compositors: the photo, the shadow that multiplies it, and the object over
it."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.core.color import COLORSPACES, from_rec709
from anyprobe.files.atomic import atomic_path
from anyprobe.maps.exr import write_channels
from anyprobe.maps.radiance import HALF_MAX
from anyprobe.relight.insert import Stage, mean_radiance, transmittance
from anyprobe.relight.shadow import GroundShadow
from anyprobe.scatter.materials import Material

EVEN_ROWS = 32
"""Rows of the uniform map for the occlusion pass."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Passes:
    """Passes in linear Rec. 709 and the photo's exposure units, float32.

    plate: [H, W, 3], the photo. shadow: [H, W, 3], factor of the plate. occlusion: [H, W], the same under
    uniform light. object: [H, W, 4], premultiplied by its alpha.
    """

    plate: np.ndarray
    shadow: np.ndarray
    occlusion: np.ndarray
    object: np.ndarray

    def composed(self) -> np.ndarray:
        """Compute plate * shadow with the object over it, [H, W, 3]."""
        return self.plate * self.shadow * (1 - self.object[..., 3:]) + self.object[..., :3]


def passes_of(stage: Stage, radiance: np.ndarray, material: str | Material) -> Passes:
    """Render the passes of stage.relit with the same arguments."""
    photo, spot = stage.photo, stage.placement
    drawn = stage.draw(radiance, material)
    shadow = stage.shadow(radiance).with_light(mean_radiance(drawn))
    shown, color, coverage = stage.window.shown(drawn, photo.mask, stage.is_behind())
    premultiplied = np.zeros((*photo.mask.shape, 4), np.float32)
    premultiplied[shown] = np.concatenate([color * coverage, coverage], axis=-1)
    even_light = np.ones((EVEN_ROWS, 2 * EVEN_ROWS, 3), np.float32)
    even = GroundShadow(spot.mesh, spot.foot, spot.radius, stage.view.up, even_light)
    plate, occlusion = photo.linear(...).astype(np.float32), _multiplier(stage, even)[..., 0]
    return Passes(plate=plate, shadow=_multiplier(stage, shadow), occlusion=occlusion, object=premultiplied)


def _multiplier(stage: Stage, shadow: GroundShadow) -> np.ndarray:
    """Return a shadow's transmittance for each pixel of the photo, [H, W, 3]."""
    factor = np.ones((*stage.photo.mask.shape, 3), np.float32)
    for strip in stage.view.strips(stage.view.part_around(shadow.foot, shadow.reach)):
        lost = 1.0 - transmittance(stage.view, shadow, strip)
        factor[strip] = 1.0 - lost * (1.0 - stage.photo.mask[strip][..., None])
    return factor


def write_passes(path: Path, passes: Passes, colorspace: str, own: np.ndarray | None = None) -> None:
    """Write an .exr, atomically: 16-bit floats, or 32 where those do not hold its values.

    Its channels are R, G, B, A of the composite, plate.*, object.*, shadow.* and occlusion.Y, light in the primaries of
    one of COLORSPACES. The shadow is recomputed from both plates, so that the passes compose in those too.

    own: [H, W, 3], the photo in the file's primaries with all its colours, if available, which becomes the plate.
    """
    plate, dark = (from_rec709(light, colorspace) for light in (passes.plate, passes.plate * passes.shadow))
    factor = np.where(plate > 1e-6, dark / np.maximum(plate, 1e-6), passes.shadow)
    plate, light = plate if own is None else own, from_rec709(passes.object[..., :3], colorspace)
    premultiplied = np.concatenate([light, passes.object[..., 3:]], axis=-1)
    composed = replace(passes, plate=plate, shadow=factor, object=premultiplied).composed()
    layers = {"A": np.ones(plate.shape[:2], np.float32), "occlusion.Y": passes.occlusion}
    layers["object.A"] = passes.object[..., 3]
    for k, name in enumerate("RGB"):
        layers[name] = composed[..., k]
        layers |= {f"plate.{name}": plate[..., k], f"object.{name}": light[..., k], f"shadow.{name}": factor[..., k]}
    half = all(np.abs(values).max() <= HALF_MAX for values in layers.values())
    half = half and (own is None or np.array_equal(own, own.astype(np.float16)))
    channels = {name: values.astype(np.float16 if half else np.float32) for name, values in layers.items()}
    with atomic_path(path) as temporary:
        write_channels(temporary, channels, {"chromaticities": COLORSPACES[colorspace]}, latlong=False)
