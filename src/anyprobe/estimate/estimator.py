"""The main job: one photo in, the light around its object out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from inspect import getdoc
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.detail.plausible import DETAILS, ROWS, check_detail, check_rows
from anyprobe.errors import InputError
from anyprobe.estimate.material_prior import use_material
from anyprobe.estimate.multiview import cut_photos, estimate_crops
from anyprobe.estimate.normals_prior import NormalsSource
from anyprobe.estimate.photo import Crop, Photo, crop_object, load_photo
from anyprobe.estimate.result import Info, Light
from anyprobe.estimate.runtime import DEFAULT_ENGINE, DEFAULT_MODEL, LIFT_STAGES, MODE, PHOTO_SIZE, Models, model_id
from anyprobe.estimate.surroundings import SurroundingsSource, use_surroundings
from anyprobe.files.images import ImageSource
from anyprobe.light.environment import integral, rotate
from anyprobe.masks.depth import DepthSource
from anyprobe.masks.prompts import Clicks
from anyprobe.masks.segmenters import Segmenter, load_segmenter
from anyprobe.masks.sources import MaskSource
from anyprobe.scatter.materials import Albedo, Material, as_material

BLACK, WHITE, ENOUGH_EXPOSED = (contract("exposure")[name] for name in ("black", "white", "enough"))
"""Where less of the object than this is neither black nor clipped, confidence falls in proportion."""


class Estimator:
    """Networks opened once, called like a function on many photos.

    >>> estimator = Estimator()                          # doctest: +SKIP
    >>> light = estimator("vase.png", mask="mask.png")   # doctest: +SKIP
    """

    def __init__(
        self,
        model: str = DEFAULT_MODEL,
        *,
        threads: int | None = None,
        engine: str = DEFAULT_ENGINE,
        emitters: str = MODE,
        segmenter: str | Segmenter | None = None,
        detail: str = DETAILS[0],
        size: int = ROWS,
        detail_library: str | Path | None = None,
    ) -> None:
        """Open the networks.

        Args:
            model: name of a bundled one, "lift" or "paper", or a folder of graphs.
            threads: of the engine; None leaves the choice to it.
            engine: what runs the graphs: "onnxruntime", "openvino", "openvino-bf16" or "cuda".
            emitters: "mode", light sources at their most likely positions (sharp shadows and highlights), or
                "expected", the mean radiance over all positions (soft, and truer on matte objects).
            segmenter: what finds the object in photos without a mask, instead of the built-in network: a name of
                masks.segmenters ("rembg", "sam:FOLDER", a plug-in), or a Segmenter.
            detail: "none", or "plausible": the structure of a real-looking place, see Light.with_detail; of single
                photos, not of several together.
            size: rows of a map with detail: 64, 128, 256 or 512.
            detail_library: folder of maps that detail is from; None: our own.
        Raises:
            InputError, ModelError, MissingExtra: with one line that says what to do.
        """
        self.models = Models(model, threads, engine, emitters)
        self.model_id, self.emitters = model_id(model), emitters
        self._set(segmenter, detail, size, detail_library)

    def _set(
        self, segmenter: str | Segmenter | None, detail: str, size: int, detail_library: str | Path | None
    ) -> None:
        check_detail(detail)
        check_rows(size)
        self.segmenter = load_segmenter(segmenter) if isinstance(segmenter, str) else segmenter
        self.detail, self.size, self.detail_library = detail, size, detail_library

    def with_emitters(self, emitters: str) -> Estimator:
        """The same open networks with other emitters."""
        other = copy(self)
        other.models, other.emitters = self.models.with_emitters(emitters), emitters
        return other

    def __call__(
        self,
        source: ImageSource,
        *,
        mask: MaskSource | None = None,
        click: Clicks | None = None,
        exclude: Clicks | None = None,
        box: Sequence[float] | None = None,
        depth: DepthSource | None = None,
        near: float | None = None,
        far: float | None = None,
        fov_deg: float | None = None,
        normals: NormalsSource | None = None,
        material: Material | str | None = None,
        albedo: Albedo | None = None,
        roughness: float | None = None,
        surroundings: SurroundingsSource | None = None,
    ) -> Light:
        """The light around the object of one photo.

        Args:
            source: path, bytes, Pillow image or array ([H, W, 3 or 4], uint8 or float in [0, 1]).
            mask: picture of the photo's size, white on the object (path, bytes, Pillow image, array), or a function
                from the upright photo [H, W, 3] uint8 to its mask [H, W]. Without mask, depth, click or box the
                photo's alpha channel is taken, else the mask network's proposal.
            click, exclude: x, y in pixels of the upright photo on the object and beside it, one or several.
            box: x0, y0, x1, y1 around the object, likewise.
            depth: depth image of the same view; near, far: where to cut it, in its unit.
            fov_deg: field of view of the photo's longer side, in degrees; else from EXIF, else 65.
            normals: the object's normal map of the photo's size in the camera's frame (see
                normals_prior.read_normals), or "sphere".
            material: the object's: a Material, or "chrome", "gold", "plastic" or "matte". Level and colour of the
                light are fitted to it.
            albedo: linear, one number or three (0.18 for a grey card), of a matte object or of the named material.
            roughness: as in glTF, 0.1 to 1, likewise.
            surroundings: "photo", to use the photo's background; or a panorama in the camera's frame, transparent
                where unknown.
        Raises:
            InvalidPhoto, InvalidMask, InputError: with one line that says what to do.
        """
        start = time.perf_counter()
        material = as_material(material, albedo, roughness)
        photo = load_photo(
            source,
            mask=mask,
            click=click,
            exclude=exclude,
            box=box,
            depth=depth,
            near=near,
            far=far,
            fov_deg=fov_deg,
            normals=normals,
            surroundings=surroundings,
            segmenter=self.segmenter,
        )
        return self.from_photo(photo, start, material=material)

    def multiview(
        self,
        photos: Iterable[Photo],
        world_from_camera: Sequence[np.ndarray],
        *,
        material: Material | str | None = None,
        albedo: Albedo | None = None,
        roughness: float | None = None,
        start: float | None = None,
    ) -> Light:
        """One light of several photos of one object in one place; see multiview.estimate_crops.

        Args:
            photos: of load_photo, read in turn; their pixels are not kept.
            world_from_camera: [3, 3] of each.
            material, albedo, roughness: the object's, as above.
            start: of time.perf_counter, when the first photo's loading began.
        """
        given = as_material(material, albedo, roughness)
        taken, spent = cut_photos(photos, start)
        return estimate_crops(self.from_crop, taken, world_from_camera, spent, given)

    def from_photo(self, photo: Photo, start: float | None = None, *, material: Material | None = None) -> Light:
        """The same for a Photo that is loaded already.

        Args:
            start: of time.perf_counter, when its loading began; the sidecar's seconds count from it.
            material: the object's, if given.
        """
        start = time.perf_counter() if start is None else start
        light = self.from_crop(photo, crop_object(photo, PHOTO_SIZE), start, material=material)
        return light if self.detail == DETAILS[0] else self._with_detail(light, photo)

    def _with_detail(self, light: Light, photo: Photo) -> Light:
        """Of what is known of the surroundings too."""
        start = time.perf_counter()
        light = light.with_detail(library=self.detail_library, size=self.size, seen=photo.seen(self.size))
        seconds = {**light.info["seconds"], "detail": round(time.perf_counter() - start, 4)}
        return replace(light, info={**light.info, "seconds": seconds})

    def from_crop(
        self,
        photo: Photo,
        crop: Crop,
        start: float | None = None,
        *,
        material: Material | None = None,
        merged_surroundings: np.ndarray | None = None,
    ) -> Light:
        """The same for an object that is cut out already; the photo's pixels are not read.

        merged_surroundings: [64, 128, 4 or 5] in the crop's frame, surroundings that other photos show too. They stay
            in the result as they are; the network sees the photo's own alone, as in training.
        """
        loaded = time.perf_counter()
        start = loaded if start is None else start
        material = as_material(material)
        self._check_use(crop, material)
        outputs = self.models(crop.image, crop.tan_half, crop.normals, crop.surroundings_map, material)
        known: dict[str, Any] = {"normals": crop.normals is not None}
        if material is not None:
            outputs, done = use_material(outputs, crop.image, crop.tan_half, material, crop.normals)
            known |= done
        exposed = _well_exposed(crop.image)
        if outputs.confidence is not None:
            outputs = replace(outputs, confidence=outputs.confidence * min(1.0, exposed / ENOUGH_EXPOSED))
        surroundings_map = crop.surroundings_map if merged_surroundings is None else merged_surroundings
        if surroundings_map is not None:
            outputs = use_surroundings(outputs, surroundings_map, tint=material is None)
            known["surroundings"] = round(float(integral(surroundings_map[..., 3:])[0] / (4 * np.pi)), 4)
        estimated, sure = time.perf_counter(), photo.mask_confidence
        confidence = outputs.confidence
        if confidence is None:
            confidence = np.full(outputs.radiance.shape[:2], exposed, np.float32)
        found = rotate(np.dstack([outputs.radiance, confidence]), crop.camera_from_crop)
        return Light(
            radiance=np.maximum(found[..., :3], 0.0),
            confidence=found[..., 3].clip(0.0, 1.0),
            well_exposed_fraction=exposed,
            warnings=photo.warnings,
            stages={
                "photo": crop.image,
                "irradiance": outputs.irradiance,
                "ldr": outputs.ldr,
                "ln_radiance": outputs.ln_radiance,
            },
            camera_from_crop=crop.camera_from_crop,
            info={
                "photo": photo.name,
                "model": self.model_id,
                "emitters": self.emitters,
                **({} if photo.exposure is None else {"exposure": float(f"{photo.exposure:.6g}")}),
                "long_fov_deg": round(float(photo.long_fov_deg), 3),
                "fov_source": photo.fov_source,
                "mask": {"source": photo.mask_source, "confidence": sure and round(sure, 4)},
                "priors": known,
                **_said(outputs.posterior),
                "crop": {"center_px": list(crop.center_px), "side_px": crop.side_px},
                "seconds": {
                    "load": round(loaded - start, 4),
                    "networks": round(estimated - loaded, 4),
                    "rotate": round(time.perf_counter() - estimated, 4),
                },
            },
        )

    def _check_use(self, crop: Crop, material: Material | None) -> None:
        """Only the model that lifts pixels can use what is known."""
        known = (("normals", crop.normals), ("surroundings", crop.surroundings_map), ("material", material))
        given = [name for name, value in known if value is not None]
        if given and self.models.stages != LIFT_STAGES:
            raise InputError(
                f"{' and '.join(given)}: expected a model that takes them, got {self.models.name}; use {DEFAULT_MODEL}"
            )
        if material is not None and not self.models.takes_material:
            raise InputError(
                f"material: expected a graph of contract 3, which takes it, got {self.models.name} of an older one; "
                f"use {DEFAULT_MODEL}"
            )


def _well_exposed(image: np.ndarray) -> float:
    """Share of the object's pixels of a crop [S, S, 4] that are neither black nor clipped."""
    object_pixels = image[image[..., 3] > 0.5]
    if not len(object_pixels):
        return 0.0
    display = luminance(object_pixels[:, :3] / object_pixels[:, 3:])
    return float(((display > BLACK) & (display < WHITE)).mean())


def _said(posterior: dict[str, float] | None) -> Info:
    """What a model says of the object and of its own errors, in stops and degrees; None where it does not."""
    if posterior is None:
        return {"object": None, "uncertainty": None}
    stop = math.log(2.0)
    return {
        "object": {
            "metal": round(posterior["metal"], 3),
            "reflectance": [round(posterior[name], 3) for name in ("red", "green", "blue")],
            "reflectance_stops": round(posterior["reflectance_error"] / stop, 2),
        },
        "uncertainty": {
            "level_stops": round(posterior["level_error"] / stop, 2),
            "color_deg": round(posterior["color_error"], 1),
        },
    }


@lru_cache(maxsize=2)
def _shared(model: str, threads: int | None, engine: str) -> Estimator:
    return Estimator(model, threads=threads, engine=engine)


def estimate(
    source: ImageSource,
    *,
    mask: MaskSource | None = None,
    click: Clicks | None = None,
    exclude: Clicks | None = None,
    box: Sequence[float] | None = None,
    depth: DepthSource | None = None,
    near: float | None = None,
    far: float | None = None,
    fov_deg: float | None = None,
    normals: NormalsSource | None = None,
    material: Material | str | None = None,
    albedo: Albedo | None = None,
    roughness: float | None = None,
    surroundings: SurroundingsSource | None = None,
    model: str = DEFAULT_MODEL,
    threads: int | None = None,
    engine: str = DEFAULT_ENGINE,
    emitters: str = MODE,
    segmenter: str | Segmenter | None = None,
    detail: str = DETAILS[0],
    size: int = ROWS,
    detail_library: str | Path | None = None,
) -> Light:
    """The light around the object of one photo; an Estimator used once (its networks are kept for the next call)."""
    estimator = _shared(model, threads, engine).with_emitters(emitters)
    estimator._set(segmenter, detail, size, detail_library)
    return estimator(
        source,
        mask=mask,
        click=click,
        exclude=exclude,
        box=box,
        depth=depth,
        near=near,
        far=far,
        fov_deg=fov_deg,
        normals=normals,
        material=material,
        albedo=albedo,
        roughness=roughness,
        surroundings=surroundings,
    )


def _arguments(function: Callable) -> str:
    """The lines of a docstring below "Args:", without what is raised."""
    return str(getdoc(function)).partition("Args:\n")[2].partition("Raises:")[0]


if estimate.__doc__:  # -OO drops docstrings
    estimate.__doc__ += f"\n\nArgs:\n{_arguments(Estimator.__call__)}{_arguments(Estimator.__init__)}"
    estimate.__doc__ += "Raises:\n    AnyprobeError: with one line that says what to do."
