"""Scored methods: a model, the same with hints, two baselines without a network, and parts of the truth."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from importlib import resources

import numpy as np

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.resample import widest
from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.light_graph import Said, graph_inputs
from anyprobe.estimate.material_hint import use_material
from anyprobe.estimate.runtime import Models
from anyprobe.estimate.surroundings import LEAST_COVER
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.filtering import blur_cap
from anyprobe.maps.radiance import read_radiance
from anyprobe.masks.check import object_box
from anyprobe_train.dataset.pair import Pair, shot_of

GIVEN_HINTS = {
    "normals": {"normals"},
    "material": {"material"},
    "normals and material": {"normals", "material"},
    "surroundings": {"surroundings"},
    "all three": {"normals", "material", "surroundings"},
}
"""Hints given to a model beside the object's crop, by row name."""
GROW_PX = 4
"""Rim around the object that shows no surroundings [px of the crop]."""
PHONE_FOV_DEG = 65.0
PHONE_PX = (256, 192)
"""Width and height of the photo that shows a pair's surroundings [pixels]: a phone's, with the object in its middle."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """A method's estimate of a pair, in the crop's frame; None where it has none.

    ldr [64, 128, 3] display; radiance [64, 128, 3] exposure units; irradiance [128, 128, 3] display;
    confidence [64, 128] in [0, 1].
    """

    ldr: np.ndarray
    radiance: np.ndarray | None = None
    irradiance: np.ndarray | None = None
    confidence: np.ndarray | None = None

    @classmethod
    def of_map(cls, radiance: np.ndarray) -> Estimate:
        """Return the estimate that is a map [64, 128, 3] in exposure units."""
        return cls(ldr=response(radiance), radiance=radiance)

    @property
    def lights(self) -> np.ndarray:
        """Map that lights virtual objects [64, 128, 3]: radiance, else the LDR map through the inverse curve."""
        return inverse_response(self.ldr) if self.radiance is None else self.radiance


Method = Callable[[Pair], Estimate]


def model_methods(models: Models, name: str, hints: bool = False) -> dict[str, Method]:
    """Return the methods of a model by row: from the photo alone and, if asked, with each of GIVEN_HINTS."""

    def method(pair: Pair, hints: Collection[str] = frozenset()) -> Estimate:
        said = run_with_hints(models, pair, hints)
        return Estimate(
            ldr=response(said.radiance), radiance=said.radiance, irradiance=said.irradiance, confidence=said.confidence
        )

    rows = GIVEN_HINTS if hints else {}
    methods: dict[str, Method] = {name: method}
    return methods | {f"{name}, {what} given": partial(method, hints=hints) for what, hints in rows.items()}


def baselines() -> dict[str, Method]:
    """Return the mean training map, and the object taken for a chrome sphere."""
    return {
        "mean map": lambda pair: Estimate.of_map(mean_map()),
        "chrome sphere": lambda pair: Estimate.of_map(chrome_sphere(pair.crop)),
    }


BLURS_DEG = (15, 30)
"""Radii of the caps that the truth is averaged over, in rows that give figures a scale [degrees]."""


def truth_methods() -> dict[str, Method]:
    """Return references made of the truth: its mean colour everywhere, and the truth blurred.

    All are of display values, of which no flat colour has a lower RMSE than their mean.
    """

    def flat(pair: Pair) -> Estimate:
        ldr = response(pair.radiance)
        return Estimate(ldr=np.broadcast_to(ldr.mean(axis=(0, 1)), ldr.shape))

    def blurred(pair: Pair, radius_deg: float) -> Estimate:
        return Estimate(ldr=blur_cap(response(pair.radiance), np.radians(radius_deg)).clip(0.0, 1.0))

    rows: dict[str, Method] = {f"truth blurred by {deg} degrees": partial(blurred, radius_deg=deg) for deg in BLURS_DEG}
    return {"one flat colour": flat, **rows}


@lru_cache(maxsize=1)
def mean_map() -> np.ndarray:
    """Return the geometric mean [64, 128, 3] of the maps of training pairs, camera's frame, photo's exposure units.

    Written with the weights, from the pairs they were trained on.
    """
    return read_radiance(str(resources.files("anyprobe") / "weights" / "mean_map.exr"))


def chrome_sphere(photo: np.ndarray) -> np.ndarray:
    """Take the object for a chrome sphere and unwrap it: photo [S, S, 4] -> radiance [64, 128, 3].

    The sphere is as large as the longer side of the mask's bounding box. Where it has
    no pixel of the object the object's mean stands in.
    """
    mask = photo[..., 3] > 0.5
    left, top, right, bottom = object_box(photo[..., 3])
    centre, radius = ((left + right) / 2, (top + bottom) / 2), max(right - left, bottom - top) / 2
    radiance = inverse_response(photo[..., :3])
    d = pixel_directions(MAP_HEIGHT)
    n = normalize(d + np.array([0.0, 0.0, 1.0], np.float32))  # reflect(+Z, n) = d
    x = np.clip((centre[0] + n[..., 0] * radius).astype(int), 0, mask.shape[1] - 1)
    y = np.clip((centre[1] - n[..., 1] * radius).astype(int), 0, mask.shape[0] - 1)
    mean = radiance[mask].mean(axis=0)
    return np.where(mask[y, x][..., None], radiance[y, x], mean).astype(np.float32)


def run_with_hints(models: Models, pair: Pair, hints: Collection[str] = frozenset()) -> Said:
    """Run a model on a pair's object, cut out, with its true normals, true material or surroundings."""
    material = pair.material if "material" in hints else None
    mask = np.asarray(pair.crop[..., 3], np.float32)
    inputs = graph_inputs(
        pair.crop[..., :3] / np.maximum(mask[..., None], LEAST_COVER),
        mask,
        2.0 * float(np.degrees(np.arctan(pair.tan_half))),
        is_lens_known=True,
        cover=np.zeros_like(mask),
        normals=pair.normals if "normals" in hints else None,
        material=material,
        panorama=surroundings(pair) if "surroundings" in hints else None,
    )
    said = models(inputs)
    if material is None:
        return said
    refined, _ = use_material(said, material, "normals" in hints, is_above_white=False)
    if said.seen is None:
        return refined
    return replace(refined, radiance=refined.radiance + said.seen[..., 3:] * (said.radiance - refined.radiance))


def surroundings(pair: Pair) -> np.ndarray:
    """Return the part of a pair's map that a phone's photo shows beside the object, see estimate.surroundings."""
    width, height = PHONE_PX
    slope = np.tan(np.radians(PHONE_FOV_DEG) / 2)
    d = pixel_directions(MAP_HEIGHT)
    plane = d[..., :2] / np.maximum(-d[..., 2:], 0.05)
    inside = (d[..., 2] < -0.05) & (np.abs(plane[..., 0]) < slope) & (np.abs(plane[..., 1]) < slope * height / width)
    grown = widest(np.asarray(pair.crop[..., 3], np.float32), GROW_PX)
    place = np.round((0.5 + plane * (0.5, -0.5) / pair.tan_half) * len(grown) - 0.5).astype(int)
    on = ((place >= 0) & (place < len(grown))).all(axis=-1)
    column, row = np.moveaxis(np.clip(place, 0, len(grown) - 1), -1, 0)
    cover = (inside * (1.0 - on * grown[row, column]))[..., None]
    display = np.round(response(pair.radiance, shot_of(pair.recipe).curve).clip(0.0, 1.0) * 255) / 255
    return np.concatenate([display * cover, cover], axis=-1).astype(np.float32)
