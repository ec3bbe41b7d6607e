"""The photo with its object, and the square crop around the object that the networks see."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.frames import turn_towards
from anyprobe.detail.match import seen_in_photo
from anyprobe.detail.plate import Plate, keep_plate
from anyprobe.errors import InputError, InvalidMask
from anyprobe.estimate.depth_normals import normals_from_depth
from anyprobe.estimate.doubts import backdrop_doubts, exposure_doubts, scale_doubts
from anyprobe.estimate.ground import NOTED, Ground, estimate_ground
from anyprobe.estimate.normals_hint import SHORTEST, normals_from_outline, read_normals
from anyprobe.estimate.normals_model import estimated_normals
from anyprobe.estimate.runtime import NORMALS_SIZE
from anyprobe.estimate.surroundings import (
    at_rows,
    hides_backdrop,
    is_cut_out,
    is_dark_beside,
    read_panorama,
    turned,
    visible_surroundings,
)
from anyprobe.estimate.window import sample_window
from anyprobe.files.images import ImageSource, Pixels, read_image
from anyprobe.hints import (
    AUTO,
    NONE,
    PHOTO,
    SPHERE,
    Hints,
    HintsDict,
    NormalsEstimator,
    NormalsSource,
    as_hints,
    spread,
)
from anyprobe.masks.check import object_box
from anyprobe.masks.depth import DepthSource, chosen_depth, is_carried
from anyprobe.masks.find import find_mask
from anyprobe.masks.segmenters import SegmenterSource
from anyprobe.masks.sources import mask_from_alpha
from anyprobe.scatter.materials import Material

DEFAULT_LONG_FOV_DEG: float = contract("lens")["default_long_fov_deg"]
"""Field of view of the longer side of a phone's main camera."""

CROP_MARGIN: float = contract("sizes")["crop_margin"]
"""Side of the crop over the longer side of the object's bounding box."""
CONTEXT_SIZE: int = contract("sizes")["context"]
CONTEXT_SCALE: int = contract("sizes")["context_scale"]
CONTEXT_FINE: int = contract("sizes")["context_fine"]
"""Of the picture of what lies around the object: its side, how many times as wide as the crop it is, and pixels of the
photo on one of its own from which on not all of them are looked at."""
EXPOSURE_PIXELS: int = contract("exposure")["doubt"]["samples"]
"""Of the object that are enough to see how it is exposed."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Photo:
    """A photo, upright, with the object marked.

    Attributes:
        rgb: [H, W, 3] float32 display values in [0, 1].
        mask: [H, W] float32 in [0, 1], 1 on the object.
        long_fov_deg: field of view of the longer side.
        fov_source: "given", "exif" or "default".
        name: what messages call it.
        warnings: one line each, for the user.
        mask_source: how the object was found, see masks.find.FoundMask.
        mask_confidence: of the mask network, in [0, 1]; None where it was not asked.
        normals: [H, W, 3] known ones in the camera's frame, unit or zero; None where none were given.
        normals_from_depth: whether they came of a depth image.
        use_background: whether what the photo shows beside the object is known of the map.
        asked_background: whether that was asked for, so that it is refused where it cannot be.
        ground: given or guessed; None where the object is cut out, or something else was asked.
        surroundings_map: [64, 128, 4 or 5] what a file says of the map, in the camera's frame, see
            estimate.surroundings; None where there was none.
        panorama: the same at its own rows, 512 at most.
        exposure: how much light it took, see files.images.Pixels; None where nothing says so.
        radiance: [H, W, 3] linear, above white too, see files.images.Pixels; None where display values say all.
        pitch_deg: how far the camera looks down; None where it is not given.
        material: the object's; None where it is not given.
        hidden: [H, W] bool, pixels that are transparent, whose colours mean nothing; None where there are none.
    """

    rgb: np.ndarray
    mask: np.ndarray
    long_fov_deg: float
    fov_source: str
    name: str
    warnings: tuple[str, ...]
    mask_source: str = "mask"
    mask_confidence: float | None = None
    normals: np.ndarray | None = None
    normals_from_depth: bool = False
    use_background: bool = False
    asked_background: bool = False
    ground: Ground | None = None
    surroundings_map: np.ndarray | None = None
    panorama: np.ndarray | None = None
    exposure: float | None = None
    radiance: np.ndarray | None = None
    pitch_deg: float | None = None
    material: Material | None = None
    hidden: np.ndarray | None = None

    def seen(self, rows: int) -> np.ndarray | None:
        """What is known of the map, [rows, 2 rows, 4 or 5], for one with detail (detail.blend); None: nothing."""
        if self.use_background:
            beside = self.mask if self.hidden is None else np.maximum(self.mask, self.hidden)
            return seen_in_photo(self.rgb, beside, self.long_fov_deg, rows, self.radiance)
        return None if self.panorama is None else at_rows(self.panorama, rows)

    def plate(self) -> Plate | None:
        """Return what it shows beside its object, small enough to keep; None: nothing."""
        return keep_plate(self.rgb, self.mask, self.long_fov_deg, self.radiance, self.hidden)

    def without_pixels(self) -> Photo:
        """What is known of it, for when its object is cut out already: photos are large."""
        rgb, mask = self.rgb[:0].copy(), self.mask[:0].copy()  # views would hold all of them
        bare = replace(self, rgb=rgb, mask=mask, normals=None, radiance=None, hidden=None)
        return replace(bare, surroundings_map=None, panorama=None)


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


@spread(Hints)
def load_photo(
    source: ImageSource | Pixels,
    hints: Hints | None = None,
    *,
    name: str | None = None,
    segmenter: SegmenterSource | None = None,
    **more: Unpack[HintsDict],
) -> Photo:
    """Read a photo, find its object, and keep what else is given of it.

    Args:
        source: path, bytes, Pillow image or array, see read_image; or what that gave.
        hints: what is given of the object, the camera and the light, see Hints; or by keyword.
        name: what messages call the photo; None: its file's name, or what it is.
        segmenter: what finds the object in the place of our network: a name of masks.segmenters, or a Segmenter.
    Raises:
        InvalidPhoto, InvalidMask, InputError: with one line that says what to do.
    """
    hints = as_hints(hints, more)
    carried = is_carried(hints.depth)
    pixels = source if isinstance(source, Pixels) else read_image(source, name, with_depth=carried)
    asked = AUTO if hints.surroundings is None else hints.surroundings
    word = asked if isinstance(asked, str) and asked in (AUTO, PHOTO, NONE) else None
    surroundings_map, panorama = (None, None) if word else read_panorama(asked)
    scale = scale_doubts(pixels.radiance, pixels.name)
    try:
        found = find_mask(pixels, **hints.place(), segmenter=segmenter)
    except InvalidMask as error:
        raise InvalidMask("; ".join([str(error), *scale])) from error
    if hints.fov_deg is not None:
        long_fov_deg, fov_source = float(hints.fov_deg), "given"
    elif pixels.long_fov_deg is not None:
        long_fov_deg, fov_source = pixels.long_fov_deg, "exif"
    else:
        long_fov_deg, fov_source = DEFAULT_LONG_FOV_DEG, "default"
    normals = _known_normals(hints.normals, pixels.rgb, found.mask, long_fov_deg)
    depth_doubts: tuple[str, ...] = ()
    depth = chosen_depth(hints.depth, pixels)
    by_depth = normals is None and depth is not None
    if normals is None and depth is not None:
        normals, depth_doubts = _normals_by_depth(depth, found.mask, long_fov_deg, fov_source, pixels.name)
    photo = Photo(
        rgb=pixels.rgb,
        mask=found.mask,
        long_fov_deg=long_fov_deg,
        fov_source=fov_source,
        name=pixels.name,
        warnings=pixels.warnings
        + scale
        + found.warnings
        + depth_doubts
        + _exposure_doubts(pixels, found.mask, said=bool(scale)),
        mask_source=found.source,
        mask_confidence=found.confidence,
        normals=normals,
        normals_from_depth=by_depth and normals is not None,
        surroundings_map=surroundings_map,
        panorama=panorama,
        exposure=pixels.exposure,
        radiance=pixels.radiance,
        pitch_deg=hints.pitch_deg,
        material=hints.surface(),
        hidden=None if word == PHOTO else _hidden(pixels.alpha),
    )
    is_asked = word == PHOTO
    if word not in (PHOTO, AUTO):
        return photo
    if not is_asked and is_cut_out(pixels.rgb, found.mask, pixels.alpha):
        is_opaque = pixels.alpha is None or mask_from_alpha(pixels.alpha) is None
        doubtful = is_opaque and not scale and hides_backdrop(pixels.rgb, found.mask)
        return replace(photo, warnings=photo.warnings + backdrop_doubts(pixels.name)) if doubtful else photo
    if not is_asked and is_dark_beside(pixels.rgb, found.mask):
        return photo
    ground = estimate_ground(photo, roll_deg=hints.roll_deg)
    if hints.pitch_deg is None and pixels.posture_deg is not None:
        pitch_deg, roll_deg = pixels.posture_deg
        ground = replace(estimate_ground(photo, pitch_deg=pitch_deg, roll_deg=roll_deg), source=NOTED)
    return replace(photo, use_background=True, asked_background=is_asked, ground=ground)


def _hidden(alpha: np.ndarray | None) -> np.ndarray | None:
    """Photo.hidden of a picture's alpha; one that is transparent everywhere says nothing, as of its object."""
    hidden = None if alpha is None else alpha < 0.5
    return hidden if hidden is not None and hidden.any() and not hidden.all() else None


def _of_object(mask: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """EXPOSURE_PIXELS pixels [N, C] of a picture, or a few more, on the object."""
    step = max(1, int(np.sqrt(mask.sum() / EXPOSURE_PIXELS)))
    return picture[::step, ::step][mask[::step, ::step] > 0.5]


def _exposure_doubts(pixels: Pixels, mask: np.ndarray, *, said: bool) -> tuple[str, ...]:
    """Of the object; said: of the whole photo already."""
    if said:
        return ()
    radiance = None if pixels.radiance is None else _of_object(mask, pixels.radiance)
    return exposure_doubts(_of_object(mask, pixels.rgb), pixels.name, radiance)


def _known_normals(
    source: NormalsSource | NormalsEstimator | None, rgb: np.ndarray, mask: np.ndarray, long_fov_deg: float
) -> np.ndarray | None:
    if source is None:
        return None
    if callable(source):
        return estimated_normals(source, rgb, mask, long_fov_deg)
    if isinstance(source, str) and source == SPHERE:
        return normals_from_outline(mask, long_fov_deg)
    return read_normals(source, mask.shape)


def _normals_by_depth(
    source: DepthSource, mask: np.ndarray, long_fov_deg: float, fov_source: str, name: str
) -> tuple[np.ndarray | None, tuple[str, ...]]:
    """Normals of a depth image, None where they would be worse than the network's, and what is doubtful of them."""
    found = normals_from_depth(source, mask, long_fov_deg)
    if found.normals is None:
        return None, (f"{name}: {found.doubt}; normals are estimated from the photo, pass normals= if you have them",)
    if fov_source == "default":
        line = f"{name}: normals are from depth seen through an assumed lens of {long_fov_deg:g} degrees; pass fov_deg="
        return found.normals, (line,)
    return found.normals, ()


def crop_object(photo: Photo, size: int = 128) -> Crop:
    """Cut a square around the object and bring it to size x size.

    Averaged over areas when shrinking, bilinear when enlarging, with colour premultiplied by the mask so that no
    background bleeds in. What lies over the border of the photo is empty.
    """
    x0, y0, x1, y1 = object_box(photo.mask)
    center = ((x0 + x1) / 2.0, (y0 + y1) / 2.0)
    side = CROP_MARGIN * max(x1 - x0, y1 - y0)
    height, width = photo.mask.shape
    ray = _pixel_direction(center, width, height, photo.long_fov_deg)
    # away from the photo's centre a pixel takes in less: by cos^2 along the radius, by cos across it
    tan_half = side / max(width, height) * np.tan(np.radians(photo.long_fov_deg) / 2.0) * (-ray[2]) ** 1.5

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
    surroundings_map = None
    if photo.use_background:
        surroundings_map = visible_surroundings(
            photo.rgb, photo.long_fov_deg, camera_from_crop, image, float(tan_half), photo.radiance, photo.hidden
        )
        if surroundings_map is None and photo.asked_background:
            raise InputError(
                f"{photo.name}: expected a photo that shows more than its object, found one colour behind it; "
                f"leave the surroundings out"
            )
    elif photo.surroundings_map is not None:
        surroundings_map = turned(photo.surroundings_map, camera_from_crop)
    return Crop(
        image=image,
        camera_from_crop=camera_from_crop,
        side_px=side,
        center_px=center,
        tan_half=float(tan_half),
        normals=normals,
        surroundings_map=surroundings_map,
        radiance=radiance,
        context=_context(photo, center, side) if photo.use_background else None,
    )


def _context(photo: Photo, center: tuple[float, float], side: float) -> np.ndarray:
    """Crop.context around a window."""
    # of large photos not every pixel is looked at
    step = max(1, int(CONTEXT_SCALE * side / CONTEXT_SIZE / CONTEXT_FINE))
    rgb, mask = photo.rgb[::step, ::step], photo.mask[::step, ::step]
    middle, side = (center[0] / step, center[1] / step), CONTEXT_SCALE * side / step
    opaque = None if photo.hidden is None else (~photo.hidden[::step, ::step]).astype(np.float32)
    seen = sample_window(rgb, opaque, middle, side, CONTEXT_SIZE)
    cover = sample_window(mask[..., None], None, middle, side, CONTEXT_SIZE)[..., :1]
    return np.concatenate([seen[..., :3], cover, seen[..., 3:]], axis=-1).clip(0.0, 1.0)


def _pixel_direction(point: tuple[float, float], width: int, height: int, long_fov_deg: float) -> np.ndarray:
    """Unit direction, camera frame, through the point x, y of a pinhole photo."""
    focal_px = max(width, height) / 2.0 / np.tan(np.radians(long_fov_deg) / 2.0)
    direction = np.array([(point[0] - width / 2.0) / focal_px, -(point[1] - height / 2.0) / focal_px, -1.0])
    return direction / np.linalg.norm(direction)
