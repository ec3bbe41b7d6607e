"""Surroundings: the part of the environment map that is seen, in the photo's background or in a partial panorama.

An object shows light from all directions, but its own colour and the level stay ambiguous; the surroundings that the
camera sees are a small part of the light, but exact.

Surroundings are [64, 128, 4]: display RGB times cover, and cover in [0, 1]. In those from an .exr or .hdr a fifth
channel is the share of the cover that is measured above white too: a display value above 1 is that radiance there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.camera import PinholeCamera, draw_on_sphere
from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.latlong import bilinear, pixel_directions
from anyprobe.core.resample import resample, widest
from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import Outputs
from anyprobe.inputs.hints import PHOTO, SurroundingsSource
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.maps.radiance import read_linear
from anyprobe.pictures.headers import MAX_PIXELS
from anyprobe.pictures.images import read_image

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

_CONTRACT = contract("surroundings")
GROW_PX: int = _CONTRACT["grow_px"]
"""Rim of the crop around the object that is left out [px]: masks miss the true edge."""
FINE: float = _CONTRACT["fine"]
"""Smallest number of the shrunk photo's pixels per pixel of the map."""
CLIPPED: float = _CONTRACT["clipped"]
"""Display value above which a pixel is only a lower bound of its radiance."""
SEEN: float = _CONTRACT["seen"]
"""Confidence of a place that the photo shows."""
TINT: float = _CONTRACT["tint"]
"""Share of the colour difference between what is seen and what was guessed there that counts as the light's own."""
TINT_FLOOR: float = _CONTRACT["tint_floor"]
"""Radiance added before its logarithm is compared."""
_GOES_ON = _CONTRACT["goes_on"]
GOES_ON_ROWS: int = _GOES_ON["rows"]
GOES_ON_COVER: float = _GOES_ON["least_cover"]
GOES_ON_SHARE: float = _GOES_ON["share"]
GOES_ON_DEG: float = _GOES_ON["reach_deg"]
"""How what is seen goes on beside it: rows of the map at which the nearest seen place is looked for; cover from which
on a place counts as seen; the share of a guess up to white that the nearest seen colour replaces beside it; and the
angle [degrees] after which that share is a factor e less. Share and angle were chosen on left-out renders of all
families (`python -m research.scenes goes-on`)."""
LEAST_COVER = 1e-3
"""Divisor of colours where next to nothing is covered."""
PANORAMA_ROWS = 512
"""Largest number of rows of a panorama kept for maps with detail."""
LINEAR = 5
"""Number of channels of surroundings that hold values above white."""
PLAIN_STEP: float = contract("ground")["plain_step"]
"""Difference from a background's median colour [display values] up to which a pixel is of that colour."""
BACKDROP_LEVEL: float = contract("ground")["backdrop_level"]
"""Median display value above which a single colour may be a backdrop, rather than the black of a cut-out or a dark
room."""
BACKDROP_DAMPING = 1e-6
"""Term added to the normal equations of a backdrop's shading, so that few pixels suffice."""
PLAIN_SHARE: float = contract("ground")["plain_share"]
"""Share of a background's pixels of one colour, see PLAIN_STEP, above which the photo is a cut-out with flaws."""
DARK_BESIDE: float = contract("ground")["dark_beside"]
"""Mean display luminance beside the object over the object's, below which surroundings are taken for unlit and tell
nothing of the light: in rendered photos of all families the object alone is then nearer to the dominant light
(`python -m research.scenes dark`)."""
SAMPLES: int = contract("ground")["samples"]
"""Pixels along the longer side that are looked at for that, at least."""
PLAIN: float = _CONTRACT["plain"]
"""Standard deviation of display values up to which what is behind the object is one colour: a cut-out, not a place."""


def read_panorama(source: SurroundingsSource) -> tuple[np.ndarray, np.ndarray]:
    """Read a partial panorama in the camera's frame, at 64 rows and at its own, PANORAMA_ROWS at most.

    Args:
        source: picture twice as wide as high, transparent where nothing is known; path, bytes, Pillow image or array.
            An .exr or .hdr holds linear radiance in the photo's exposure units.
    Returns:
        [64, 128, 4] and [H, 2H, 4], or of an .exr or .hdr [64, 128, 5] and [H, 2H, 5].
    Raises:
        InputError: not a panorama, or nothing known in it.
    """
    picture, linear = _read_panorama(source)
    rows = min(PANORAMA_ROWS, max(MAP_HEIGHT, len(picture)))
    return _at_rows(picture, linear, MAP_HEIGHT), _at_rows(picture, linear, rows)


def at_rows(panorama: Float[np.ndarray, "H 2*H C"], rows: int) -> Float[np.ndarray, "R 2*R C"]:
    """Resize surroundings to more rows, or to fewer."""
    return panorama if len(panorama) == rows else resample(panorama, (2 * rows, rows), smooth=len(panorama) < rows)


def _read_panorama(source: SurroundingsSource) -> tuple[np.ndarray, bool]:
    """[H, 2H, 4] times cover, and cover; whether it is linear radiance rather than display values."""
    try:
        linear = read_linear(source, MAX_PIXELS)
        picture = _displayed(source) if linear is None else linear
    except InputError as error:
        raise InputError(error, subject="surroundings") from error
    height, width = picture.shape[:2]
    if width != 2 * height:
        raise InputError(
            f"expected a panorama twice as wide as high, or {PHOTO!r}, got {width} x {height} pixels",
            subject="surroundings",
        )
    if not picture[..., 3].any():
        raise InputError("expected pixels that are not transparent, found none", subject="surroundings")
    return picture, linear is not None


def _at_rows(picture: np.ndarray, linear: bool, rows: int) -> np.ndarray:
    small = resample(picture, (2 * rows, rows))
    if not linear:
        return small
    cover = small[..., 3:]
    return surroundings_of(small[..., :3] / np.maximum(cover, LEAST_COVER), cover, cover)


def _displayed(source: SurroundingsSource) -> np.ndarray:
    """Return a picture [H, W, 4]: display RGB times cover, and cover."""
    pixels = read_image(source)
    cover = np.ones(pixels.rgb.shape[:2], np.float32) if pixels.alpha is None else pixels.alpha
    return np.dstack([pixels.rgb * cover[..., None], cover])


def surroundings_of(
    radiance: Float[np.ndarray, "H 2*H 3"], cover: Float[np.ndarray, "H 2*H 1"], measured: np.ndarray | None = None
) -> Float[np.ndarray, "H 2*H C"]:
    """Encode radiance [H, 2H, 3] and cover [H, 2H, 1] as surroundings; measured: its share with values above white."""
    display = response(radiance)
    if measured is None:
        return np.concatenate([display * cover, cover], axis=-1).astype(np.float32)
    display = np.where((radiance > 1) & (measured > 0), radiance, display)
    return np.concatenate([display * cover, cover, measured], axis=-1).astype(np.float32)


def radiance_of(surroundings: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Decode surroundings to radiance [H, 2H, 3], where it is clipped and may be more, and cover [H, 2H, 1]."""
    cover = surroundings[..., 3:4]
    display = surroundings[..., :3] / np.maximum(cover, LEAST_COVER)
    clipped = display >= CLIPPED
    if surroundings.shape[-1] == LINEAR:
        clipped = clipped & (surroundings[..., 4:] < 0.5 * cover)
    return np.where(display > 1, display, inverse_response(display)), clipped, cover


def over(upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """Composite surroundings, or panoramas: the upper ones where they cover, else the lower."""
    most = max(upper.shape[-1], lower.shape[-1])
    upper, lower = (np.pad(one, ((0, 0), (0, 0), (0, most - one.shape[-1]))) for one in (upper, lower))
    return upper + (1 - upper[..., 3:4]) * lower


def turned(surroundings: np.ndarray, camera_from_crop: Float[np.ndarray, "3 3"]) -> np.ndarray:
    """Rotate surroundings [64, 128, 4 or 5] from the camera's frame into the crop's."""
    most = np.inf if surroundings.shape[-1] == LINEAR else 1.0
    found = np.clip(rotate(surroundings, camera_from_crop.T), 0.0, most).astype(np.float32)
    found[..., 3:] = np.minimum(found[..., 3:], 1.0)
    return found


def visible_surroundings(
    rgb: Float[np.ndarray, "H W 3"],
    camera: PinholeCamera,
    camera_from_crop: Float[np.ndarray, "3 3"],
    image: np.ndarray,
    tan_half: float,
    radiance: Float[np.ndarray, "H W 3"] | None = None,
    transparent: Bool[np.ndarray, "H W"] | None = None,
) -> np.ndarray | None:
    """Return the map in the crop's frame as far as the photo shows it beside the object.

    Args:
        rgb: [H, W, 3], the photo's display values.
        camera: the photo's.
        image, tan_half: of the crop, see estimate.photo.Crop.
        radiance: [H, W, 3], the photo's, where it holds it above white.
        transparent: [H, W], pixels whose colours mean nothing.
    Returns:
        [64, 128, 4] float32, display RGB times cover, and cover in [0, 1], or with radiance [64, 128, 5] with values
        above white; None where the photo shows one colour.
    """

    def sampled(values: np.ndarray) -> np.ndarray:
        return draw_on_sphere(values, camera, camera_from_crop.T, MAP_HEIGHT, FINE)[0]

    d = pixel_directions(MAP_HEIGHT)
    cover = camera.shows(d @ camera_from_crop.T.astype(np.float32)) * (1.0 - hidden(image, tan_half))
    opaque = None if transparent is None else (~transparent)[..., None].astype(np.float32)
    share = None if opaque is None else sampled(opaque)
    if share is not None:
        cover = cover * share[..., 0]

    def at_map(picture: np.ndarray) -> np.ndarray:
        """Means over the opaque pixels of [H, W, 3] around each of the map's."""
        return sampled(picture) if share is None else sampled(picture * opaque) / np.maximum(share, LEAST_COVER)

    shown = at_map(rgb)
    if not cover.any() or np.std(shown[cover > 0], axis=0).max() <= PLAIN:
        return None
    if radiance is not None:
        linear = at_map(radiance)
        shown = np.where(linear > 1, linear, shown.clip(0.0, 1.0))  # up to white as without it
        return np.dstack([shown * cover[..., None], cover, cover]).astype(np.float32)
    return np.dstack([shown * cover[..., None], cover]).clip(0.0, 1.0).astype(np.float32)


def hides_backdrop(rgb: Float[np.ndarray, "H W 3"], mask: Float[np.ndarray, "H W"]) -> bool:
    """Return whether what is beside the object of an opaque cut-out is bright enough for a studio's backdrop."""
    step = max(1, max(mask.shape) // SAMPLES)
    display = rgb[::step, ::step][mask[::step, ::step] < 0.5]
    return len(display) > 0 and bool(np.median(luminance(display)) > BACKDROP_LEVEL)


def is_cut_out(
    rgb: Float[np.ndarray, "H W 3"], mask: Float[np.ndarray, "H W"], alpha: Float[np.ndarray, "H W"] | None = None
) -> bool:
    """Return whether a photo shows no place beside its object: it is transparent there, or but for flaws of one colour
    or of a backdrop's smooth shading, a quadratic of the place in the photo."""
    step = max(1, max(mask.shape) // SAMPLES)
    beside = mask[::step, ::step] < 0.5
    if not beside.any():
        return True
    if alpha is not None and alpha.any() and (alpha[::step, ::step][beside] < 0.5).mean() >= 0.5:
        return True
    display = rgb[::step, ::step][beside]
    return any(
        np.logical_and.reduce((np.abs(display - fit) <= PLAIN_STEP).T).mean() >= PLAIN_SHARE
        for fit in (np.median(display, axis=0), _backdrop(display, beside))
    )


def is_dark_beside(rgb: Float[np.ndarray, "H W 3"], mask: Float[np.ndarray, "H W"]) -> bool:
    """Return whether what is beside the object is much darker than it, as in a dark room or before black cloth."""
    step = max(1, max(mask.shape) // SAMPLES)
    display, inside = luminance(rgb[::step, ::step]), mask[::step, ::step] >= 0.5
    if inside.all() or not inside.any():
        return False
    return bool(display[~inside].mean() < DARK_BESIDE * display[inside].mean())


def _backdrop(display: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return the quadratic of place nearest to display values [N, 3] of the pixels beside [H, W]."""
    row, column = (
        2.0 * index / max(side - 1, 1) - 1.0 for index, side in zip(np.nonzero(beside), beside.shape, strict=True)
    )
    terms = np.stack([np.ones_like(row), column, row, column * column, column * row, row * row], axis=-1)
    normal = terms.T @ terms + BACKDROP_DAMPING * np.eye(terms.shape[1])
    return terms @ np.linalg.solve(normal, terms.T @ display.astype(np.float64))


@dataclass(frozen=True, slots=True)
class GoesOn:
    """Share of the nearest seen colour just beside the photo, and the angle [degrees] over which it falls to 1/e."""

    share: float = GOES_ON_SHARE
    reach_deg: float = GOES_ON_DEG


def use_surroundings(
    outputs: Outputs, surroundings: np.ndarray, *, tint: bool = True, goes_on: GoesOn = GoesOn()
) -> Outputs:
    """Return a model's answer with what is known of the map [H, 2H, 4 or 5] in the place of its guess.

    Display values mean radiance by the mean camera curve; a clipped place may be brighter than it looks.
    tint: whether the guess takes on some of the colour that it misses there; not where the object's own is known.
    goes_on: how the guess follows what is known.
    """
    shown, clipped, cover = radiance_of(surroundings)
    tinted = outputs.radiance * _tint(outputs.radiance, shown, cover) if tint else outputs.radiance
    guessed = _continued(tinted, surroundings, goes_on)
    seen = _brightened(shown, clipped, guessed)
    radiance = (guessed + cover * (seen - guessed)).astype(np.float32)
    if (confidence := outputs.confidence) is not None:
        confidence = (confidence + cover[..., 0] * (SEEN - confidence)).astype(np.float32)
    return outputs.with_map(radiance, confidence)


def nearest_seen(surroundings: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the display colours [H, 2H, 3] of the nearest seen place and the angle [degrees] to it [H, 2H, 1], between
    the middles of GOES_ON_ROWS rows; None where nothing is seen."""
    height = len(surroundings)
    step = height // GOES_ON_ROWS
    coarse = (
        surroundings[..., :4].reshape(GOES_ON_ROWS, step, 2 * GOES_ON_ROWS, step, 4).mean(axis=(1, 3)).reshape(-1, 4)
    )
    seen = coarse[:, 3] >= GOES_ON_COVER
    if not seen.any():
        return None
    d = pixel_directions(GOES_ON_ROWS).reshape(-1, 3)
    cosine = d @ d[seen].T
    which = cosine.argmax(axis=1)
    colors = np.minimum(coarse[seen, :3] / coarse[seen, 3:], 1.0)[which]
    degrees = np.degrees(np.arccos(np.clip(np.take_along_axis(cosine, which[:, None], axis=1), -1.0, 1.0)))
    found = np.concatenate([colors, degrees], axis=1).reshape(GOES_ON_ROWS, 2 * GOES_ON_ROWS, 4).astype(np.float32)
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height)
    fine = bilinear(found, np.stack([u, v], axis=-1).astype(np.float32))
    return fine[..., :3], fine[..., 3:]


def _continued(guessed: np.ndarray, surroundings: np.ndarray, goes_on: GoesOn) -> np.ndarray:
    """Return a guess [H, 2H, 3] that goes on from what is seen: more so the nearer it is; light above white stays."""
    nearest = nearest_seen(surroundings)
    if nearest is None:
        return guessed
    colors, degrees = nearest
    share = goes_on.share * np.exp(-degrees / goes_on.reach_deg)
    shown = np.minimum(guessed, 1.0)
    display = response(shown)
    return inverse_response(display + share * (colors - display)) + (guessed - shown)


def _brightened(shown: np.ndarray, clipped: np.ndarray, guessed: np.ndarray) -> np.ndarray:
    """Return the seen radiance; where it is clipped, as bright as a brighter guess, with its own hue.

    One gain a pixel, so that no channel alone takes an emitter on; and none that would burn out a channel which is not.
    """
    white = inverse_response(np.array([CLIPPED], np.float32))
    room = np.where(clipped, np.inf, white / np.maximum(shown, 1e-6)).min(axis=-1, keepdims=True)
    asked = luminance(guessed) / np.maximum(luminance(shown), 1e-6)  # black is never clipped
    gain = np.clip(asked[..., None], 1.0, np.maximum(room, 1.0))
    return np.where(clipped.any(axis=-1, keepdims=True), shown * gain, shown)


def _tint(guessed: np.ndarray, seen: np.ndarray, cover: np.ndarray) -> np.ndarray:
    """Shares [3] of geometric mean 1 that bring the colour of what was guessed nearer to that of what is seen."""
    weight = cover * (cover > 0.5)
    if not weight.any():
        return np.ones(3, np.float32)
    missed = np.log(np.minimum(seen, 1.0) + TINT_FLOOR) - np.log(np.minimum(guessed, 1.0) + TINT_FLOOR)
    mean = (weight * missed).sum(axis=(0, 1)) / weight.sum()
    return np.exp(TINT * (mean - mean.mean())).astype(np.float32)


def hidden(image: np.ndarray, tan_half: float) -> np.ndarray:
    """Return how much of each direction of the crop's map the object hides [64, 128], its edge counted to it."""
    grown = widest((image[..., 3] * 255).round() / np.float32(255.0), GROW_PX)[..., None]
    size = len(grown)
    crop = PinholeCamera(width=size, height=size, focal=size / 2 / tan_half)
    return draw_on_sphere(grown, crop, np.eye(3), MAP_HEIGHT, np.inf)[0][..., 0]
