"""The photo with its object, and the square crop around the object that the networks see."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np

from anyprobe.core.camera import ASSUMED_LONG_FOV_DEG, PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.core.frames import turn_towards
from anyprobe.errors import InputError, InvalidMask
from anyprobe.estimate.doubts import (
    all_around_doubts,
    backdrop_doubts,
    dark_beside_doubts,
    exposure_doubts,
    grey_doubts,
    scale_doubts,
)
from anyprobe.estimate.ground import NOTED, Ground, estimate_ground
from anyprobe.estimate.known import GivenPanorama, PhotoBackground, asked_surroundings, read_given_normals
from anyprobe.estimate.normals_hint import SHORTEST
from anyprobe.estimate.runtime import CONTEXT_SIZE, NORMALS_SIZE
from anyprobe.estimate.surroundings import hides_backdrop, is_cut_out, is_dark_beside, turned, visible_surroundings
from anyprobe.estimate.window import sample_window
from anyprobe.inputs.description import shown_as
from anyprobe.inputs.hints import HintKeywords, Hints, combine
from anyprobe.masks.check import object_box
from anyprobe.masks.find import find_mask
from anyprobe.masks.segmenters import SegmenterSource
from anyprobe.masks.sources import mask_from_alpha
from anyprobe.notices import Notice, as_notice, leave_out
from anyprobe.pictures.images import ImageSource, Pixels, read_image
from anyprobe.place.plate import Plate, keep_plate
from anyprobe.scatter.materials import Material

"""Field of view of the longer side of a phone's main camera."""

CROP_MARGIN: float = contract("sizes")["crop_margin"]
"""Side of the crop over the longer side of the object's bounding box."""
CONTEXT_SCALE: int = contract("sizes")["context_scale"]
CONTEXT_FINE: int = contract("sizes")["context_fine"]
"""The context picture: its width in crops, and photo pixels per own pixel above which the photo is subsampled."""
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
        shows_place: whether a panorama can show the place beside the object; unlit surroundings are shown although they
            say nothing about the light and are not `surroundings`.
        ground: given or guessed; None where the object is cut out or the background is not used.
        exposure: how much light it took, see pictures.images.Pixels; None where nothing says so.
        radiance: [H, W, 3] linear, above white too, see pictures.images.Pixels; None where display values say all.
        pitch_deg: how far the camera looks down; None where it is not given.
        material: the object's; None where it is not given.
        hidden: [H, W] bool, pixels that are transparent, whose colours mean nothing; None where there are none.
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
    shows_place: bool = False
    ground: Ground | None = None
    exposure: float | None = None
    radiance: np.ndarray | None = None
    pitch_deg: float | None = None
    material: Material | None = None
    hidden: np.ndarray | None = None

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

    def plate(self) -> Plate | None:
        """Return what it shows beside its object, small enough to keep; None: nothing."""
        return keep_plate(self.rgb, self.mask, self.camera, self.radiance, self.hidden)

    def without_pixels(self) -> Photo:
        """Return the photo without its pixels, for when its object is cut out already: photos are large."""
        rgb, mask = self.rgb[:0].copy(), self.mask[:0].copy()  # views would hold all of them
        normals = None if self.normals is None else self.normals[:0].copy()
        surroundings = None if isinstance(self.surroundings, GivenPanorama) else self.surroundings
        bare = replace(self, rgb=rgb, mask=mask, normals=normals, radiance=None, hidden=None)
        return replace(bare, surroundings=surroundings)


@dataclass(frozen=True, kw_only=True, slots=True)
class Crop:
    """A square window on the object.

    Attributes:
        image: [S, S, 4] float32: rgb times mask, and mask, all in [0, 1].
        camera_from_crop: [3, 3] float64, rotation from the frame that looks at the
            window's centre along -Z to the photo's camera.
        side_px: side of the window in pixels of the photo.
        center_px: x, y of its centre; pixel i covers [i, i + 1).
        tan_half: tangent of half the angle that its side takes in, seen as its own camera's picture.
        normals: [64, 64, 3] known ones in the window's frame, unit or zero; None where none were given.
        surroundings_map: [64, 128, 4 or 5] what is known of the map, in the window's frame; None: nothing.
        radiance: [S, S, 3] float32, the photo's radiance times mask; None where display values say all.
        context: [96, 96, 5] float32, the photo CONTEXT_SCALE times as wide as the window: display RGB, the object's
            mask, and where the photo is, all zero outside it; None where only the object is looked at.
    """

    image: np.ndarray
    camera_from_crop: np.ndarray
    side_px: float
    center_px: tuple[float, float]
    tan_half: float
    normals: np.ndarray | None = None
    surroundings_map: np.ndarray | None = None
    radiance: np.ndarray | None = None
    context: np.ndarray | None = None


@shown_as(Hints)
def load_photo(
    source: ImageSource | Pixels,
    hints: Hints | None = None,
    *,
    name: str | None = None,
    segmenter: SegmenterSource | None = None,
    **given: Unpack[HintKeywords],
) -> Photo:
    """Read a photo, find its object, and keep what else is given of it.

    Args:
        source: path, bytes, Pillow image or array, see read_image; or what that gave.
        hints: all that is given of the object, the camera and the light.
        name: what messages call the photo; None: its file's name, or what it is.
        segmenter: what finds the object in the place of our network: a name of masks.segmenters, or a Segmenter.
        given: fields of Hints by name; these replace what `hints` holds.
    Raises:
        InvalidPhoto, InvalidMask, InputError: with one line that says what to do.
    """
    hints = combine(hints, given)
    pixels = source
    if not isinstance(pixels, Pixels):
        pixels = read_image(pixels, name)
    around = asked_surroundings(hints.surroundings)
    scale = scale_doubts(pixels.radiance, pixels.name)
    place = hints.place()  # whoever marks an object knows what the picture is
    is_marked = pixels.alpha is not None or any(given is not None for given in place.values())
    all_around = () if is_marked else all_around_doubts(pixels.rgb, pixels.radiance, pixels.name)
    try:
        found = find_mask(pixels, **place, segmenter=segmenter)
    except InvalidMask as error:
        why = (*all_around, *scale)
        raise InvalidMask(error.notice.adding(why[0].text) if why else error) from error
    long_fov_deg, fov_source = _field_of_view(hints.fov_deg, pixels)
    is_whole = isinstance(around, PhotoBackground) and around.is_asked
    exposure = () if scale else _exposure_doubts(pixels, found.mask)
    if hints.albedo is not None and np.size(hints.albedo) == 1:
        exposure += grey_doubts(_of_object(found.mask, pixels.rgb), pixels.name)
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
        hidden=None if is_whole else _hidden(pixels.alpha),
    )
    if not isinstance(around, PhotoBackground):
        return photo
    if not around.is_asked and is_cut_out(pixels.rgb, found.mask, pixels.alpha):
        is_opaque = pixels.alpha is None or mask_from_alpha(pixels.alpha) is None
        doubtful = is_opaque and not scale and hides_backdrop(pixels.rgb, found.mask)
        doubts = backdrop_doubts(pixels.name) if doubtful else ()
        return replace(photo, surroundings=None, warnings=photo.warnings + doubts)
    if not around.is_asked and is_dark_beside(pixels.rgb, found.mask):
        doubts = dark_beside_doubts(pixels.name)
        return replace(photo, surroundings=None, shows_place=True, warnings=photo.warnings + doubts)
    return replace(photo, shows_place=True, ground=_ground(photo, hints, pixels.posture_deg))


def _field_of_view(given: float | None, pixels: Pixels) -> tuple[float, str]:
    """Return the field of view of the longer side [degrees] and its source."""
    if given is not None:
        return float(given), "given"
    if pixels.long_fov_deg is not None:
        return pixels.long_fov_deg, "exif"
    return ASSUMED_LONG_FOV_DEG, "default"


def _ground(photo: Photo, hints: Hints, posture_deg: tuple[float, float] | None) -> Ground:
    """Estimate the ground: by the given pitch and roll, else by those that the file notes, else by a guess."""
    if hints.pitch_deg is not None or posture_deg is None:
        return estimate_ground(photo, roll_deg=hints.roll_deg)
    noted_pitch_deg, roll_deg = posture_deg
    return replace(estimate_ground(photo, pitch_deg=noted_pitch_deg, roll_deg=roll_deg), source=NOTED)


def _hidden(alpha: np.ndarray | None) -> np.ndarray | None:
    """Return which pixels are transparent; None if none are, or all, which says nothing."""
    hidden = None if alpha is None else alpha < 0.5
    return hidden if hidden is not None and hidden.any() and not hidden.all() else None


def _of_object(mask: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """Sample EXPOSURE_PIXELS object pixels [N, C] of a picture, or a few more."""
    step = max(1, int(np.sqrt(mask.sum() / EXPOSURE_PIXELS)))
    return picture[::step, ::step][mask[::step, ::step] > 0.5]


def _exposure_doubts(pixels: Pixels, mask: np.ndarray) -> tuple[Notice, ...]:
    """Warn of an object that is too dark or too bright."""
    radiance = None if pixels.radiance is None else _of_object(mask, pixels.radiance)
    return exposure_doubts(_of_object(mask, pixels.rgb), pixels.name, radiance)


def crop_object(photo: Photo, size: int = 128) -> Crop:
    """Cut a square around the object and bring it to size x size.

    Averaged over areas when shrinking, bilinear when enlarging, with colour premultiplied by the mask so that no
    background bleeds in. What lies over the border of the photo is empty.
    """
    x0, y0, x1, y1 = object_box(photo.mask)
    center = ((x0 + x1) / 2.0, (y0 + y1) / 2.0)
    side = CROP_MARGIN * max(x1 - x0, y1 - y0)
    ray = photo.camera.ray(center)
    # away from the photo's centre a pixel takes in less: by cos^2 along the radius, by cos across it
    tan_half = side / 2 / photo.camera.focal * (-ray[2]) ** 1.5

    camera_from_crop = turn_towards(ray)
    normals = None
    if photo.normals is not None:
        mean = sample_window(photo.normals, photo.mask, center, side, NORMALS_SIZE)[..., :3]
        length = np.linalg.norm(mean, axis=-1, keepdims=True)
        mean = mean / np.maximum(length, SHORTEST) @ camera_from_crop
        normals = np.where(length > SHORTEST, mean, 0.0).astype(np.float32)
    image = np.clip(sample_window(photo.rgb, photo.mask, center, side, size), 0.0, 1.0)
    radiance = None
    if photo.radiance is not None:
        radiance = np.maximum(sample_window(photo.radiance, photo.mask, center, side, size)[..., :3], 0.0)
    surroundings_map, background = None, photo.surroundings if isinstance(photo.surroundings, PhotoBackground) else None
    if background is not None:
        surroundings_map = visible_surroundings(
            photo.rgb, photo.camera, camera_from_crop, image, float(tan_half), photo.radiance, photo.hidden
        )
        if surroundings_map is None and background.is_asked:
            text = "expected a photo that shows more than its object, found one colour behind it"
            raise InputError(text, source=photo.name, remedy=leave_out("surroundings"))
    elif isinstance(photo.surroundings, GivenPanorama):
        surroundings_map = turned(photo.surroundings.small, camera_from_crop)
    return Crop(
        image=image,
        camera_from_crop=camera_from_crop,
        side_px=side,
        center_px=center,
        tan_half=float(tan_half),
        normals=normals,
        surroundings_map=surroundings_map,
        radiance=radiance,
        context=_context(photo, center, side) if background is not None else None,
    )


def _context(photo: Photo, center: tuple[float, float], side: float) -> np.ndarray:
    """Return Crop.context around a window."""
    # of large photos not every pixel is looked at
    step = max(1, int(CONTEXT_SCALE * side / CONTEXT_SIZE / CONTEXT_FINE))
    rgb, mask = photo.rgb[::step, ::step], photo.mask[::step, ::step]
    middle, side = (center[0] / step, center[1] / step), CONTEXT_SCALE * side / step
    opaque = None if photo.hidden is None else (~photo.hidden[::step, ::step]).astype(np.float32)
    seen = sample_window(rgb, opaque, middle, side, CONTEXT_SIZE)
    cover = sample_window(mask[..., None], None, middle, side, CONTEXT_SIZE)[..., :1]
    return np.concatenate([seen[..., :3], cover, seen[..., 3:]], axis=-1).clip(0.0, 1.0)
