"""The main entry point: the light around the object of one photo."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, Unpack

import numpy as np

from anyprobe.errors import InputError
from anyprobe.estimate import refine
from anyprobe.estimate.extract import CHROME, METAL, Extract, extract_of, extracts_of, said_of_ball
from anyprobe.estimate.multiview import estimate_views
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.runtime import Models, model_id
from anyprobe.inputs.description import shown_as
from anyprobe.inputs.hints import HintKeywords, Hints, combine
from anyprobe.inputs.settings import SETTINGS, Keywords, SettingKeywords, Settings
from anyprobe.masks.networks import load_network
from anyprobe.pictures.images import ImageSource
from anyprobe.scatter.materials import Albedo, Material, as_material, material_input, material_named


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
        self.models = Models(*settings.networks)
        self.model_id = model_id(settings.model)
        self._set(settings)

    def __reduce__(self) -> tuple[type[Estimator], tuple[Settings]]:
        """Pickle the settings; other processes open the networks anew."""
        return Estimator, (self.settings,)

    def __repr__(self) -> str:
        return f"Estimator(model={self.settings.model!r})"

    def _set(self, settings: Settings) -> None:
        segmenter = settings.segmenter
        self.segmenter = load_network(segmenter) if isinstance(segmenter, str) else segmenter
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
        hints = combine(hints, given)
        if not isinstance(source, Photo):
            return self.from_photo(load_photo(source, hints, segmenter=self.segmenter))
        late = [name for name, _ in hints.given() if name not in ("material", "albedo", "roughness")]
        if late:
            text = "expected with a picture, got it with a Photo, which is read already; give it to load_photo"
            raise InputError(text, subject=late)
        return self.from_photo(source, material=hints.surface())

    def multiview(
        self,
        photos: Iterable[Photo],
        world_from_camera: Sequence[np.ndarray],
        *,
        material: Material | str | None = None,
        albedo: Albedo | None = None,
        roughness: float | None = None,
    ) -> Light:
        """Estimate one light from several photos of one object in one place; see multiview.fuse_lights.

        Args:
            photos: from load_photo, read in turn; surroundings from a file are of the first one's frame.
            world_from_camera: [3, 3] of each.
            material: the object's, a name or a Material.
            albedo: the object's linear diffuse albedo.
            roughness: the object's, as in glTF.
        """
        given = as_material(material, albedo, roughness)
        return estimate_views(partial(self.from_extract, material=given), extracts_of(photos), world_from_camera)

    def from_photo(self, photo: Photo, *, material: Material | None = None, plate: bool = True) -> Light:
        """Estimate the light of a loaded Photo; see __call__.

        Args:
            material: the object's, instead of the Photo's own.
            plate: whether the light keeps the photo beside its object, for its panorama.
        """
        return self.from_extract(extract_of(photo, may_be_ball=material is None, with_plate=plate), material)

    def from_extract(self, extract: Extract, material: Material | None = None) -> Light:
        """Estimate the light of one photo by its extract; material: the object's, instead of the photo's own."""
        start = time.perf_counter()
        photo, inputs = extract.photo, extract.inputs
        if material is not None:
            photo, inputs = replace(photo, material=material), {**inputs, "material": material_input(material)[None]}
        refine.check_hints(self.models, photo)
        found = refine.predict(self.models, photo, inputs)
        found = refine.with_background_doubt(found, photo, inputs)
        found = refine.with_estimated_ground(found, photo)
        found = refine.with_material(found, photo)
        said, exposed, ball = found.said, refine.exposed_fraction(found.said), extract.ball
        if ball is not None and said.object_material is not None and said.object_material[0] >= METAL:
            load_s = extract.load_s + time.perf_counter() - start
            unwrapped = replace(ball, plate=extract.plate, load_s=load_s)
            light = self.from_extract(unwrapped, material_named(CHROME))
            return replace(light, warnings=(*light.warnings, said_of_ball(photo.name)))
        seconds = {"load": round(extract.load_s, 4), "networks": round(time.perf_counter() - start, 4)}
        doubts = (*found.doubts, *refine.map_doubts(photo, said.radiance, found.ground, exposed))
        return Light(
            radiance=said.radiance,
            confidence=said.confidence,
            well_exposed_fraction=exposed,
            warnings=photo.warnings + doubts,
            stages={"photo": said.image} | ({} if said.irradiance is None else {"irradiance": said.irradiance}),
            camera_from_crop=said.camera_from_crop,
            find_shown=None if said.object_normals is None else partial(refine.shown_of, said),
            origin=refine.estimate_origin(photo, found, seconds, self.model_id),
            seen=said.seen,
            said_error_deg=None if said.errors is None else float(said.errors[0]),
            said_sources=None if said.sources is None else said.sources[:, :4],
            soft=None if said.soft is None else float(said.soft[0]),
            outdoors=None if said.outdoors is None else float(said.outdoors[0]),
            plate=None if said.is_placeless else extract.plate,
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
