"""The main job: one photo in, the light around its object out."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.detail.background import background_of
from anyprobe.detail.likeness import MATCH_ROWS, Shown, shown_by
from anyprobe.detail.plausible import DETAILS, ROWS, check_detail, check_rows
from anyprobe.errors import InputError
from anyprobe.estimate.doubts import ground_doubts, light_doubts
from anyprobe.estimate.ground import ground_by_posture
from anyprobe.estimate.material_hint import use_material
from anyprobe.estimate.mirror_ball import CHROME, is_mirror_ball, said_of_ball
from anyprobe.estimate.multiview import cut_photos, estimate_crops
from anyprobe.estimate.normals_hint import normals_from_outline
from anyprobe.estimate.photo import Crop, Photo, crop_object, load_photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.runtime import DEFAULT_ENGINE, DEFAULT_MODEL, MODE, PHOTO_SIZE, Models, model_id
from anyprobe.estimate.sidecar import Info
from anyprobe.estimate.surroundings import radiance_of, use_surroundings
from anyprobe.files.images import ImageSource
from anyprobe.given_material import Albedo, as_material
from anyprobe.hints import Hints, HintsDict, as_hints, spread
from anyprobe.light.environment import integral, rotate
from anyprobe.masks.segmenters import SegmenterSource, load_segmenter
from anyprobe.scatter.materials import Material, material_named

BLACK, WHITE, ENOUGH_EXPOSED = (contract("exposure")[name] for name in ("black", "white", "enough"))
"""Where less of the object than this is neither black nor clipped, confidence falls in proportion."""


class SettingsDict(TypedDict, total=False):
    """Settings as keywords."""

    model: str
    threads: int | None
    engine: str
    emitters: str
    segmenter: SegmenterSource | None
    detail: str
    size: int
    detail_library: str | Path | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """How lights are estimated, whatever the photo.

    Attributes:
        model: name of a bundled one, "lift" or "paper", or a folder of graphs.
        threads: of the engine; None leaves the choice to it.
        engine: what runs the graphs: "onnxruntime", "openvino", "openvino-bf16" or "cuda".
        emitters: "mode", light sources at their most likely positions (sharp shadows and highlights), or "expected",
            the mean radiance over all positions (soft, and truer on matte objects).
        segmenter: what finds the object in photos without a mask, instead of the built-in network: a name of
            masks.segmenters ("rembg", "sam:FOLDER", a plug-in), or a Segmenter.
        detail: "none", or "plausible": the structure of a real-looking place, see Light.with_detail; of single photos,
            not of several together.
        size: rows of a map with detail: 64, 128, 256 or 512.
        detail_library: folder of maps that detail is from; None: our own.
    Raises:
        InputError: another detail or size.
    """

    model: str = DEFAULT_MODEL
    threads: int | None = None
    engine: str = DEFAULT_ENGINE
    emitters: str = MODE
    segmenter: SegmenterSource | None = None
    detail: str = DETAILS[0]
    size: int = ROWS
    detail_library: str | Path | None = None

    def __post_init__(self) -> None:
        check_detail(self.detail)
        check_rows(self.size)
        if self.threads is not None and self.threads < 1:
            raise InputError(f"threads: expected 1 or more, got {self.threads}; leave it out to use all cores")

    @property
    def networks(self) -> tuple[str, int | None, str]:
        """What the networks are opened by."""
        return self.model, self.threads, self.engine


class Estimator:
    """Networks opened once, called like a function on many photos.

    >>> estimator = Estimator()                          # doctest: +SKIP
    >>> light = estimator("vase.png", mask="mask.png")   # doctest: +SKIP
    """

    @spread(Settings)
    def __init__(self, settings: Settings | str | None = None, **more: Unpack[SettingsDict]) -> None:
        """Open the networks.

        Args:
            settings: see Settings, or the model's name; or by keyword.
        Raises:
            InputError, ModelError, MissingExtra: with one line that says what to do.
        """
        if isinstance(settings, str):
            settings = Settings(model=settings)
        settings = replace(settings or Settings(), **more)
        self.models = Models(*settings.networks, settings.emitters)
        self.model_id = model_id(settings.model)
        self._set(settings)

    def __reduce__(self) -> tuple[type[Estimator], tuple[Settings]]:
        """Other processes open the networks anew."""
        return Estimator, (self.settings,)

    def __repr__(self) -> str:
        settings = self.settings
        parts = [f"model={settings.model!r}", f"engine={settings.engine!r}", f"emitters={settings.emitters!r}"]
        parts += [f"detail={settings.detail!r}"] if settings.detail != DETAILS[0] else []
        return f"Estimator({', '.join(parts)})"

    def _set(self, settings: Settings) -> None:
        segmenter = settings.segmenter
        self.segmenter = load_segmenter(segmenter) if isinstance(segmenter, str) else segmenter
        self.settings = settings

    @spread(Settings)
    def with_settings(self, **more: Unpack[SettingsDict]) -> Estimator:
        """One with other settings; the open networks are shared where model, threads and engine stay."""
        settings = replace(self.settings, **more)
        if settings.networks != self.settings.networks:
            return Estimator(settings)
        other = object.__new__(type(self))  # copy() would open the networks anew
        vars(other).update(vars(self))
        other.models = self.models.with_emitters(settings.emitters)
        other._set(settings)
        return other

    @spread(Hints)
    def __call__(self, source: ImageSource | Photo, hints: Hints | None = None, **more: Unpack[HintsDict]) -> Light:
        """The light around the object of one photo.

        Args:
            source: path, bytes, Pillow image or array ([H, W, 3 or 4], uint8 or float in [0, 1]); or a Photo of
                load_photo, whose hints were given there, but for the material.
            hints: what is given of the object, the camera and the light, see Hints; or by keyword.
        Raises:
            InvalidPhoto, InvalidMask, InputError: with one line that says what to do.
        """
        start = time.perf_counter()
        hints = as_hints(hints, more)
        if not isinstance(source, Photo):
            return self.from_photo(load_photo(source, hints, segmenter=self.segmenter), start)
        late = [name for name, _ in hints.given() if name not in ("material", "albedo", "roughness")]
        if late:
            raise InputError(
                f"{' and '.join(late)}: expected with a picture, got it with a Photo, which is read already; "
                "give it to load_photo"
            )
        return self.from_photo(source, start, material=hints.surface())

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
            material: the object's, instead of the Photo's own.
        """
        start = time.perf_counter() if start is None else start
        light = self.from_crop(photo, crop_object(photo, PHOTO_SIZE), start, material=material)
        if material is None and photo.material is None and photo.normals is None and self.models.lifts:
            light = self._unwrapped(light, photo, start)
        if photo.use_background:
            light = replace(light, plate=photo.plate())
        return light if self.settings.detail == DETAILS[0] else self._with_detail(light, photo)

    def _unwrapped(self, light: Light, photo: Photo, start: float) -> Light:
        """The light of a mirror ball, of a photo of one; else as it is."""
        said = light.info.get("object")
        if said is None or not is_mirror_ball(photo, said["metal"]):
            return light
        ball = replace(photo, normals=normals_from_outline(photo.mask, photo.long_fov_deg))
        found = self.from_crop(ball, crop_object(ball, PHOTO_SIZE), start, material=material_named(CHROME))
        return replace(found, warnings=(*found.warnings, said_of_ball(photo.name)))

    def _with_detail(self, light: Light, photo: Photo) -> Light:
        """Of what is known of the surroundings too."""
        start = time.perf_counter()
        size = self.settings.size
        light = light.with_detail(library=self.settings.detail_library, size=size, seen=photo.seen(size))
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
        material = photo.material if material is None else as_material(material)
        if photo.use_background and not photo.asked_background and not self.models.lifts:
            crop, merged_surroundings = replace(crop, surroundings_map=None), None  # that nobody asked for
        if photo.normals_from_depth and not self.models.lifts:
            crop = replace(crop, normals=None)  # likewise
        self._check_use(crop, material)
        ground, up = photo.ground, None
        if ground is not None and ground.is_known:
            up = crop.camera_from_crop.T @ ground.up
        outputs = self.models(
            crop.image, crop.tan_half, crop.normals, crop.surroundings_map, material, crop.context, up
        )
        if ground is not None and up is None and outputs.posture is not None:
            ground = ground_by_posture(ground, outputs.posture, crop.camera_from_crop)
        used: dict[str, Any] = {"normals": crop.normals is not None}
        if material is not None:
            outputs, done = use_material(outputs, crop.image, crop.tan_half, material, crop.normals, crop.radiance)
            used |= done
        exposed = _well_exposed(crop.image)
        if outputs.confidence is not None:
            outputs = replace(outputs, confidence=outputs.confidence * min(1.0, exposed / ENOUGH_EXPOSED))
        surroundings_map = crop.surroundings_map if merged_surroundings is None else merged_surroundings
        if surroundings_map is not None:
            outputs = use_surroundings(outputs, surroundings_map, tint=material is None)
            used["surroundings"] = round(float(integral(surroundings_map[..., 3:])[0] / (4 * np.pi)), 4)
        estimated, sure = time.perf_counter(), photo.mask_confidence
        known = [outputs.radiance] if outputs.confidence is None else [outputs.radiance, outputs.confidence]
        found = rotate(np.dstack(known), crop.camera_from_crop)
        radiance = np.maximum(found[..., :3], 0.0)
        doubts = ground_doubts(ground, photo.name)
        if exposed >= ENOUGH_EXPOSED:  # else that is said already
            doubts += light_doubts(radiance, ground, photo.pitch_deg, photo.name)
        return Light(
            radiance=radiance,
            confidence=None if outputs.confidence is None else found[..., 3].clip(0.0, 1.0),
            well_exposed_fraction=exposed,
            warnings=photo.warnings + doubts,
            stages={
                "photo": crop.image,
                "irradiance": outputs.irradiance,
                "ldr": outputs.ldr,
                "ln_radiance": outputs.ln_radiance,
            },
            camera_from_crop=crop.camera_from_crop,
            find_shown=None if outputs.normals is None else partial(_shown, crop, outputs.normals),
            info={
                "photo": photo.name,
                "model": self.model_id,
                "emitters": self.settings.emitters,
                **({} if photo.exposure is None else {"exposure": float(f"{photo.exposure:.6g}")}),
                "long_fov_deg": round(float(photo.long_fov_deg), 3),
                "fov_source": photo.fov_source,
                **({} if photo.pitch_deg is None else {"pitch_deg": round(float(photo.pitch_deg), 3)}),
                **({} if ground is None else {"ground": ground.info()}),
                "mask": {"source": photo.mask_source, "confidence": sure and round(sure, 4)},
                "hints": used,
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
        """Only the model that lifts pixels takes hints."""
        hints = (("normals", crop.normals), ("surroundings", crop.surroundings_map), ("material", material))
        given = [name for name, value in hints if value is not None]
        if given and not self.models.lifts:
            raise InputError(
                f"{' and '.join(given)}: expected a model that takes them, got {self.models.name}; use {DEFAULT_MODEL}"
            )


def _shown(crop: Crop, normals: np.ndarray) -> Shown | None:
    """What the photo shows of an object of these normals [64, 64, 3] in the crop's frame, and beside it."""
    behind = None
    if crop.surroundings_map is not None:
        behind = background_of(*radiance_of(crop.surroundings_map), crop.camera_from_crop, MATCH_ROWS)
    return shown_by(crop.image, normals, crop.tan_half, crop.camera_from_crop, behind)


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


class EstimateDict(HintsDict, SettingsDict, total=False):
    """What estimate takes by keyword."""


@spread(Hints, Settings)
def estimate(source: ImageSource | Photo, hints: Hints | None = None, **more: Unpack[EstimateDict]) -> Light:
    """The light around the object of one photo; the networks stay open for the next call.

    Args:
        source: path, bytes, Pillow image or array ([H, W, 3 or 4], uint8 or float in [0, 1]); or a Photo of load_photo.
        hints: what is given of the object, the camera and the light, see Hints: mask=, click=, material= and so on.
        more: the same by keyword, and how to estimate, see Settings: model=, emitters=, detail= and so on.
    Raises:
        AnyprobeError: with one line that says what to do.
    """
    how = {name: value for name, value in more.items() if name in SettingsDict.__annotations__}
    hints = as_hints(hints, {name: value for name, value in more.items() if name not in how})
    settings = Settings(**how)  # type: ignore[arg-type]
    return _shared(*settings.networks).with_settings(**how)(source, hints)  # type: ignore[arg-type]
