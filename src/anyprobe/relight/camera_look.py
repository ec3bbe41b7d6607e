"""Blur and grain of a photo around its object, which an inserted one gets too.

The blur is that of the sharpest edges: of a step by b that a Gaussian of deviation s blurs, neighbouring pixels differ
by b erf(1 / (2 sqrt(2) s)) at most. The grain is what a filter leaves that no plane passes (Immerkaer 1996, "Fast noise
variance estimation"), in the calmest quarter of the photo's patches.
"""

import math
import zlib
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.estimate.ground import contact_of
from anyprobe.estimate.photo import Photo

REACH_PX = 400
"""Half the side [px] of the part of the photo that is looked at, around the foot of its object."""
EDGE_PATCH, INSIDE, GRAIN_PATCH = 16, 4, 8
"""Side [px] of the patches in which edges are measured, how far inside they lie, so that both their sides are seen, and
side of those in which grain is."""
LEAST_STEP, SHARPEST = 0.15, 0.95
"""Smallest difference in a patch with an edge [display values], and the quantile of patches that counts."""
LEAST_PATCHES = 20
DRAWN_BLUR, MOST_BLUR = 0.45, 2.5
"""Blur [px] of an object as drawn, and the largest that it is given."""
CALMEST = 0.25
"""Quantile of patches whose grain counts."""
MOST_GRAIN = 0.05
"""Largest deviation of the grain [display values]: more is texture."""
NOT_CLIPPED = 0.02, 0.98
"""Mean display values of patches that may have grain."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraLook:
    """Deviations of a photo's blur [px] and of its grain [display values]."""

    blur: float
    grain: float


def look_of(photo: Photo) -> CameraLook:
    """Measure blur and grain around the foot of a photo's object; none of either where too little is seen."""
    x, y = contact_of(photo.mask)
    rows, columns = (slice(max(0, int(c) - REACH_PX), max(0, int(c) + REACH_PX)) for c in (y, x))
    shown = luminance(photo.rgb[rows, columns]).astype(np.float32)
    # of a cut-out only the object's own texture would be measured
    grain = _grain_of(shown) if photo.shows_place and photo.plate() is not None else 0.0
    return CameraLook(blur=_blur_of(shown), grain=grain)


def _blur_of(shown: np.ndarray) -> float:
    """Return the deviation of the blur of the sharpest edges of a picture [H, W]."""
    patches = _patches(shown, EDGE_PATCH)
    step = np.ptp(patches, axis=(1, 2))
    patches, step = patches[step > LEAST_STEP], step[step > LEAST_STEP]
    if len(patches) < LEAST_PATCHES:
        return DRAWN_BLUR
    inner = patches[:, INSIDE:-INSIDE, INSIDE:-INSIDE]
    steepest = np.maximum(*(np.abs(np.diff(inner, axis=axis)).max(axis=(1, 2)) for axis in (1, 2)))
    share = float(np.quantile(steepest / step, SHARPEST))
    blurs = np.linspace(DRAWN_BLUR, MOST_BLUR, 64)
    return float(np.interp(-share, [-math.erf(1 / (2 * math.sqrt(2) * blur)) for blur in blurs], blurs))


def _grain_of(shown: np.ndarray) -> float:
    """Return the deviation of the grain of a picture [H, W]."""
    twice = np.diff(np.diff(shown, n=2, axis=0), n=2, axis=1)
    patches, levels = _patches(twice, GRAIN_PATCH), _patches(shown[1:-1, 1:-1], GRAIN_PATCH).mean(axis=(1, 2))
    patches = patches[(levels > NOT_CLIPPED[0]) & (levels < NOT_CLIPPED[1])]
    if len(patches) < LEAST_PATCHES:
        return 0.0
    return min(float(np.quantile(np.abs(patches).mean(axis=(1, 2)) * math.sqrt(math.pi / 2) / 6, CALMEST)), MOST_GRAIN)


def _patches(picture: np.ndarray, side: int) -> np.ndarray:
    """Cut a picture [H, W] into whole patches [N, side, side]."""
    rows, columns = (count // side for count in picture.shape)
    cut = picture[: rows * side, : columns * side].reshape(rows, side, columns, side)
    return cut.transpose(0, 2, 1, 3).reshape(-1, side, side)


def blurred(drawn: np.ndarray, look: CameraLook, own: float = DRAWN_BLUR) -> np.ndarray:
    """Blur a drawn object [S, S, 4] (linear radiance, coverage) as the photo is; own: its blur as it is [px]."""
    deviation = math.sqrt(max(look.blur**2 - own**2, 0.0))
    if deviation < 0.2:  # less is no more than rounding
        return drawn
    reach = math.ceil(3 * deviation)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    kernel = (kernel / kernel.sum()).astype(np.float32)
    parts = np.concatenate([drawn[..., :3] * drawn[..., 3:], drawn[..., 3:]], axis=-1)
    for _ in range(2):  # down, then across
        padded = np.pad(parts, ((reach, reach), (0, 0), (0, 0)))
        parts = sum(weight * padded[k : k + len(parts)] for k, weight in enumerate(kernel)).swapaxes(0, 1)
    parts[..., :3] /= np.maximum(parts[..., 3:], 1e-6)
    return parts.astype(np.float32)


def grain_over(shape: tuple[int, int], look: CameraLook, photo: Photo) -> np.ndarray:
    """Return grain [H, W, 1] of display values, the same for the same photo."""
    seed = zlib.crc32(np.ascontiguousarray(photo.rgb[::16, ::16]).tobytes())
    return np.random.default_rng(seed).normal(0.0, look.grain, (*shape, 1)).astype(np.float32)
