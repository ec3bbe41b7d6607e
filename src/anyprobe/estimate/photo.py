"""The photo with its object, and what the networks are given of it."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from anyprobe.core.camera import ASSUMED_LONG_FOV_DEG, PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.core.response import inverse_response
from anyprobe.errors import InvalidMask
from anyprobe.estimate.doubts import all_around_doubts, exposure_doubts, grey_doubts, scale_doubts
from anyprobe.estimate.ground import NOTED, Ground, estimate_ground
from anyprobe.estimate.light_graph import graph_inputs
from anyprobe.estimate.sun_hint import place_of_sun
from anyprobe.estimate.surroundings import GivenPanorama, PhotoBackground, asked_surroundings, read_given_normals
from anyprobe.inputs.description import shown_as
from anyprobe.inputs.hints import HintKeywords, Hints, combine
from anyprobe.masks.find import find_mask
from anyprobe.masks.networks import NetworkSource
from anyprobe.notices import Notice, as_notice
from anyprobe.pictures.images import ImageSource, Pixels, read_image
from anyprobe.place.plate import Plate, keep_plate
from anyprobe.scatter.materials import Material

EXPOSURE_PIXELS: int = contract("exposure")["doubt"]["samples"]
"""Pixels of the object that are enough to judge its exposure."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Photo:
    """A photo, upright, with the object marked.

    Attributes:
        rgb: [H, W, 3] float32 display values in [0, 1].
        mask: [H, W] float32 in [0, 1], 1 on the object.
        long_fov_deg: field of view of the longer side.
        fov_source: "given", "exif" or "default".
        name: its name in messages.
        warnings: doubts, for the user.
        mask_source: how the object was found, see masks.find.FoundMask.
        mask_confidence: the mask network's, in [0, 1]; None where it was not used.
        normals: the object's; None where they are not known.
        surroundings: known part of the map: the photo's own background, a panorama, or None.
        ground: given or guessed; None where the background is not used.
        exposure: how much light it took, see pictures.images.Pixels; None where nothing says so.
        radiance: [H, W, 3] linear, above white too, see pictures.images.Pixels; None where display values say all.
        pitch_deg: how far the camera looks down; None where it is not given.
        material: the object's; None where it is not given.
        sun: where it stands, see sun_hint.towards_sun; None where it is not given.
        hidden: [H, W] bool, pixels that are transparent, whose colours mean nothing; None where there are none.
        load_s: how long reading it and finding its object took.
    """

    rgb: np.ndarray
    mask: np.ndarray
    long_fov_deg: float
    fov_source: str
    name: str
    warnings: tuple[Notice, ...]
    mask_source: str = "mask"
    mask_confidence: float | None = None
    normals: np.ndarray | None = None
    surroundings: PhotoBackground | GivenPanorama | None = None
    ground: Ground | None = None
    exposure: float | None = None
    radiance: np.ndarray | None = None
    pitch_deg: float | None = None
    material: Material | None = None
    sun: tuple[float, ...] | None = None
    hidden: np.ndarray | None = None
    load_s: float = 0.0

    def __repr__(self) -> str:
        count = len(self.warnings)
        parts = [
            "Photo {1} x {0}".format(*self.rgb.shape),
            self.name,
            f"object by {self.mask_source}",
            f"field of view {self.long_fov_deg:.0f} degrees ({self.fov_source})",
            *([f"{count} warning{'s' if count > 1 else ''}"] if count else []),
        ]
        return f"<{', '.join(parts)}>"

    @property
    def camera(self) -> PinholeCamera:
        """Its lens."""
        height, width = self.mask.shape
        return PinholeCamera.of_fov(width, height, self.long_fov_deg)

    def linear(self, at: Any) -> np.ndarray:
        """Return the linear radiance [..., 3] of pixels, above white too where the photo holds that; at: an index."""
        shown = inverse_response(self.rgb[at])
        return shown if self.radiance is None else np.where(self.radiance[at] > 1, self.radiance[at], shown)

    def plate(self) -> Plate | None:
        """Return what it shows beside its object, small enough to keep; None: nothing."""
        return keep_plate(self.rgb, self.mask, self.camera, self.radiance, self.hidden)

    @property
    def shows_place(self) -> bool:
        """Whether what lies beside the object may be used, and shown."""
        return isinstance(self.surroundings, PhotoBackground)

    def without_pixels(self) -> Photo:
        """Return the photo without its pixels, for when the networks' inputs are made: photos are large."""

        def none_of(pixels: np.ndarray | None) -> Any:
            return None if pixels is None else pixels[:0].copy()  # a view would hold all of them

        bare = replace(self, rgb=none_of(self.rgb), mask=none_of(self.mask), hidden=None)
        return replace(bare, normals=none_of(self.normals), radiance=none_of(self.radiance))


@shown_as(Hints)
def load_photo(
    source: ImageSource | Pixels,
    hints: Hints | None = None,
    *,
    name: str | None = None,
    segmenter: NetworkSource | None = None,
    **given: Unpack[HintKeywords],
) -> Photo:
    """Read a photo, find its object, and keep what else is given of it.

    Args:
        source: path, bytes, Pillow image or array, see read_image; or what that gave.
        hints: all that is given of the object, the camera and the light.
        name: what messages call the photo; None: its file's name, or what it is.
        segmenter: network that finds the object: a name of masks.networks.load_network, or a Network.
        given: fields of Hints by name; these replace what `hints` holds.
    Raises:
        InvalidPhoto, InvalidMask, InputError: with one line that says what to do.
    """
    start = time.perf_counter()
    hints = combine(hints, given)
    pixels = source if isinstance(source, Pixels) else read_image(source, name)
    around = asked_surroundings(hints.surroundings)
    scale = scale_doubts(pixels.radiance, pixels.name)
    place = hints.place()  # whoever marks an object knows what the picture is
    is_marked = pixels.alpha is not None or any(given is not None for given in place.values())
    all_around = () if is_marked else all_around_doubts(pixels.radiance, pixels.name)
    try:
        found = find_mask(pixels, **place, segmenter=segmenter)
    except InvalidMask as error:
        why = (*all_around, *scale)
        raise InvalidMask(error.notice.adding(why[0].text) if why else error) from error
    long_fov_deg, fov_source = _field_of_view(hints.fov_deg, pixels)
    is_whole = isinstance(around, PhotoBackground) and around.is_asked
    rgb = _of_object(found.mask, pixels.rgb)
    radiance = None if pixels.radiance is None else _of_object(found.mask, pixels.radiance)
    exposure = () if scale else exposure_doubts(rgb, pixels.name, radiance)
    if hints.albedo is not None and np.size(hints.albedo) == 1:
        exposure += grey_doubts(rgb, pixels.name)
    photo = Photo(
        rgb=pixels.rgb,
        mask=found.mask,
        long_fov_deg=long_fov_deg,
        fov_source=fov_source,
        name=pixels.name,
        warnings=tuple(map(as_notice, (*pixels.warnings, *all_around, *scale, *found.warnings, *exposure))),
        mask_source=found.source,
        mask_confidence=found.confidence,
        normals=read_given_normals(hints.normals, found.mask, long_fov_deg),
        surroundings=around,
        exposure=pixels.exposure,
        radiance=pixels.radiance,
        pitch_deg=hints.pitch_deg,
        material=hints.surface(),
        sun=place_of_sun(hints.sun, source),
        hidden=None if is_whole else _hidden(pixels.alpha),
    )
    photo = _with_ground(photo, hints, pixels.posture_deg) if photo.shows_place else photo
    return replace(photo, load_s=time.perf_counter() - start)


def _field_of_view(given: float | None, pixels: Pixels) -> tuple[float, str]:
    """Return the field of view of the longer side [degrees] and its source."""
    if given is not None:
        return float(given), "given"
    if pixels.long_fov_deg is not None:
        return pixels.long_fov_deg, "exif"
    return ASSUMED_LONG_FOV_DEG, "default"


def _with_ground(photo: Photo, hints: Hints, posture_deg: tuple[float, float] | None) -> Photo:
    """Add the ground: by the given pitch and roll, else by those that the file notes, else by a guess."""
    if hints.pitch_deg is not None or posture_deg is None:
        return replace(photo, ground=estimate_ground(photo, roll_deg=hints.roll_deg))
    noted_pitch_deg, roll_deg = posture_deg
    noted = estimate_ground(photo, pitch_deg=noted_pitch_deg, roll_deg=roll_deg)
    return replace(photo, ground=replace(noted, source=NOTED))


def inputs_of(photo: Photo) -> dict[str, np.ndarray]:
    """Return what the networks are given of a photo, see light_graph.graph_inputs."""
    around, cover = photo.surroundings, None
    if not isinstance(around, PhotoBackground):
        cover = np.zeros_like(photo.mask)
    elif photo.hidden is not None:
        cover = (~photo.hidden).astype(np.float32)
    return graph_inputs(
        photo.rgb,
        photo.mask,
        photo.long_fov_deg,
        is_lens_known=photo.fov_source != "default",
        cover=cover,
        radiance=photo.radiance,
        up=photo.ground.up if photo.ground is not None and photo.ground.is_known else None,
        normals=photo.normals,
        material=photo.material,
        panorama=around.values if isinstance(around, GivenPanorama) else None,
        believe=isinstance(around, PhotoBackground) and around.is_asked,
    )


def _hidden(alpha: np.ndarray | None) -> np.ndarray | None:
    """Return which pixels are transparent; None if none are, or all, which says nothing."""
    hidden = None if alpha is None else alpha < 0.5
    return hidden if hidden is not None and hidden.any() and not hidden.all() else None


def _of_object(mask: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """Sample EXPOSURE_PIXELS object pixels [N, C] of a picture, or a few more."""
    step = max(1, int(np.sqrt(mask.sum() / EXPOSURE_PIXELS)))
    return picture[::step, ::step][mask[::step, ::step] > 0.5]
