"""The main entry point: the light around the object of one photo."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, Unpack

import numpy as np

from anyprobe.errors import InputError
from anyprobe.estimate.mirror_ball import CHROME, Ball, find_ball, said_of_ball
from anyprobe.estimate.multiview import cut_photos, estimate_crops
from anyprobe.estimate.photo import Crop, Photo, crop_object, load_photo
from anyprobe.estimate.refine import (
    camera_map,
    check_use,
    estimate_origin,
    map_doubts,
    predict,
    shown_of,
    usable,
    well_exposed_fraction,
    with_estimated_ground,
    with_exposure_doubt,
    with_material,
    with_surroundings,
)
from anyprobe.estimate.result import Light
from anyprobe.estimate.runtime import Models, model_id
from anyprobe.given_material import Albedo, as_material
from anyprobe.inputs.description import shown_as
from anyprobe.inputs.hints import HintKeywords, Hints, combine
from anyprobe.inputs.settings import SETTINGS, Keywords, SettingKeywords, Settings
from anyprobe.masks.segmenters import load_segmenter
from anyprobe.pictures.images import ImageSource
from anyprobe.scatter.materials import Material, material_named


class Estimator:
    """Networks opened once, called like a function on many photos.

    >>> estimator = Estimator()                          # doctest: +SKIP
    >>> light = estimator("vase.png", mask="mask.png")   # doctest: +SKIP
    """

    @shown_as(Settings)
    def __init__(self, settings: Settings | str | None = None, **given: Unpack[SettingKeywords]) -> None:
        """Open the networks.

        Args:
            settings: all settings, or the model's name instead of `model`.
            given: fields of Settings by name; those that are not defaults replace the ones in `settings`.
        Raises:
            InputError, ModelError, MissingExtra: bad settings or models, in one line that says what to do.
        """
        if isinstance(settings, str):
            given["model"], settings = settings, None
        settings = replace(settings or Settings(), **Settings(**given).changes())
        self.models = Models(*settings.networks, settings.emitters)
        self.model_id = model_id(settings.model)
        self._set(settings)

    def __reduce__(self) -> tuple[type[Estimator], tuple[Settings]]:
        """Pickle the settings; other processes open the networks anew."""
        return Estimator, (self.settings,)

    def __repr__(self) -> str:
        settings = self.settings
        parts = [f"model={settings.model!r}", f"emitters={settings.emitters!r}"]
        return f"Estimator({', '.join(parts)})"

    def _set(self, settings: Settings) -> None:
        segmenter = settings.segmenter
        self.segmenter = load_segmenter(segmenter) if isinstance(segmenter, str) else segmenter
        self.settings = settings

    def with_settings(self, settings: Settings | None = None, **changes: Any) -> Estimator:
        """Return an estimator with other settings; the open networks are shared if model, threads and providers stay.

        Args:
            settings: all settings; None: the current ones.
            changes: fields of Settings to replace.
        """
        settings = replace(settings or self.settings, **changes)
        if settings.networks != self.settings.networks:
            return Estimator(settings)
        other = object.__new__(type(self))  # copy() would open the networks anew
        vars(other).update(vars(self))
        other.models = self.models.with_emitters(settings.emitters)
        other._set(settings)
        return other

    @shown_as(Hints)
    def __call__(self, source: ImageSource | Photo, hints: Hints | None = None, **given: Unpack[HintKeywords]) -> Light:
        """Estimate the light around the object of one photo.

        Args:
            source: path, bytes, Pillow image or array ([H, W, 3 or 4], uint8 or float in [0, 1]); or a Photo from
                load_photo, where its hints were given, except the material.
            hints: optional inputs about the object, the camera and the light.
            given: fields of Hints by name; these replace those in `hints`.
        Raises:
            InvalidPhoto, InvalidMask, InputError: bad input, in one line that says what to do.
        """
        start = time.perf_counter()
        hints = combine(hints, given)
        if not isinstance(source, Photo):
            return self.from_photo(load_photo(source, hints, segmenter=self.segmenter), start)
        late = [name for name, _ in hints.given() if name not in ("material", "albedo", "roughness")]
        if late:
            text = "expected with a picture, got it with a Photo, which is read already; give it to load_photo"
            raise InputError(text, subject=late)
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
        """Estimate one light from several photos of one object in one place; see multiview.estimate_crops.

        Args:
            photos: from load_photo, read in turn; their pixels are not kept.
            world_from_camera: [3, 3] of each.
            material: the object's, a name or a Material.
            albedo, roughness: the object's linear diffuse albedo, and its roughness as in glTF.
            start: time.perf_counter() when the first photo's loading began.
        """
        given = as_material(material, albedo, roughness)
        taken, spent, plate = cut_photos(photos, start)
        return replace(estimate_crops(self.from_crop, taken, world_from_camera, spent, given), plate=plate)

    def from_photo(
        self,
        photo: Photo,
        start: float | None = None,
        *,
        material: Material | None = None,
        plate: bool = True,
        crop: Crop | None = None,
    ) -> Light:
        """Estimate the light of a loaded Photo; see __call__.

        Args:
            start: time.perf_counter() when its loading began; the sidecar's seconds count from it.
            material: the object's, instead of the Photo's own.
            plate: whether the light keeps the photo beside its object, for its panorama.
            crop: of crop_object(photo), if it was cut out already.
        """
        start = time.perf_counter() if start is None else start
        light = self.from_crop(photo, crop_object(photo) if crop is None else crop, start, material=material)
        if material is None:
            light = self.unwrapped(light, find_ball(photo), start)
        if plate and photo.shows_place:
            light = replace(light, plate=photo.plate())
        return light

    def unwrapped(self, light: Light, ball: Ball | None, start: float | None = None) -> Light:
        """Replace the light of a mirror ball by the one unwrapped from its photo; else return it unchanged."""
        said = light.origin.object
        if ball is None or said is None or said["metal"] < ball.least_metal:
            return light
        found = self.from_crop(ball.photo, ball.crop, start, material=material_named(CHROME))
        return replace(found, warnings=(*found.warnings, said_of_ball(ball.photo.name)))

    def from_crop(
        self,
        photo: Photo,
        crop: Crop,
        start: float | None = None,
        *,
        material: Material | None = None,
        merged_surroundings: np.ndarray | None = None,
    ) -> Light:
        """Estimate the light of a cropped object without reading the photo's pixels; see __call__.

        merged_surroundings: [64, 128, 4 or 5] in the crop's frame, surroundings that other photos show too. They stay
            unchanged in the result; the network sees only the photo's own, as in training.
        """
        loaded = time.perf_counter()
        material = photo.material if material is None else as_material(material)
        crop, merged_surroundings = usable(self.models, photo, crop, merged_surroundings)
        check_use(self.models, crop, material, self.settings.looks)
        well_exposed = well_exposed_fraction(crop.image)
        known = crop.surroundings_map if merged_surroundings is None else merged_surroundings
        found = predict(self.models, crop, photo.ground, material, self.settings.looks)
        found = with_estimated_ground(found, crop)
        found = with_material(found, crop, material)
        found = with_exposure_doubt(found, well_exposed)
        found = with_surroundings(found, known, tint=material is None)
        estimated = time.perf_counter()
        radiance, confidence = camera_map(found.outputs, crop)
        seconds = {
            "load": round(loaded - (loaded if start is None else start), 4),
            "networks": round(estimated - loaded, 4),
            "rotate": round(time.perf_counter() - estimated, 4),
        }
        outputs = found.outputs
        return Light(
            radiance=radiance,
            confidence=confidence,
            well_exposed_fraction=well_exposed,
            warnings=photo.warnings + map_doubts(photo, radiance, found.ground, well_exposed),
            stages={
                "photo": crop.image,
                "irradiance": outputs.irradiance,
                "ldr": outputs.ldr,
                "ln_radiance": outputs.ln_radiance,
            },
            camera_from_crop=crop.camera_from_crop,
            find_shown=None if outputs.normals is None else partial(shown_of, crop, outputs.normals),
            origin=estimate_origin(photo, crop, found, seconds, self.settings, self.model_id),
            expected=outputs.expected,
        )


@lru_cache(maxsize=2)
def _shared(model: str, threads: int | None, providers: tuple[str, ...]) -> Estimator:
    return Estimator(model, threads=threads, providers=providers)


@shown_as(Hints, Settings)
def estimate(source: ImageSource | Photo, hints: Hints | None = None, **given: Unpack[Keywords]) -> Light:
    """Estimate the light around the object of one photo; the networks stay open for the next call.

    Args:
        source: path, bytes, Pillow image or array ([H, W, 3 or 4], uint8 or float in [0, 1]); or a Photo from
            load_photo.
        hints: optional inputs about the object, the camera and the light.
        given: fields of Hints, which replace those in `hints`, and of Settings, by name.
    Raises:
        AnyprobeError: bad input, in one line that says what to do.
    """
    asked: dict[str, Any] = {name: value for name, value in given.items() if name in SETTINGS}
    settings = Settings(**asked)
    hints = combine(hints, {name: value for name, value in given.items() if name not in SETTINGS})
    return _shared(*settings.networks).with_settings(settings)(source, hints)
