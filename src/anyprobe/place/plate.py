"""The plate: a photo without its object, small enough to keep, for panoramas of the place."""

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.camera import PinholeCamera, draw_on_sphere
from anyprobe.core.color import to_bytes
from anyprobe.core.resample import resample, widest
from anyprobe.core.response import inverse_response

MOST_ROWS = 1024
"""Largest number of panorama rows for which a plate keeps enough pixels."""
GROW = 0.02
"""Rim around the object that counts to it, as a share of the photo's longer side: masks miss the true edge."""
LEAST_LEFT = 0.02
"""Smallest share of the photo that must show the place beside its object."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Plate:
    """The photo beside its object.

    Attributes:
        rgb: [H, W, 3] uint8 display values.
        hidden: [H, W] uint8, 255 where the object or a transparent pixel hides the place.
        camera: of a photo of this size.
        radiance: [H, W, 3] float16, linear radiance where the photo holds it above white; None: display values suffice.
    """

    rgb: np.ndarray
    hidden: np.ndarray
    camera: PinholeCamera
    radiance: np.ndarray | None = None

    def drawn(self, frame_from_camera: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Draw it into the map of a frame: radiance times cover [rows, 2 rows, 3], cover [rows, 2 rows, 1], and which
        directions are inside the photo [rows, 2 rows, 1]."""
        linear = inverse_response(self.rgb.astype(np.float32) / 255)
        if self.radiance is not None:
            above = self.radiance.astype(np.float32)
            linear = np.where(above > 1, above, linear)
        cover = 1.0 - widest(self.hidden.astype(np.float32) / 255, max(2, round(GROW * max(self.hidden.shape))))
        cover = cover[..., None]
        both, inside = draw_on_sphere(np.dstack([linear * cover, cover]), self.camera, frame_from_camera, rows)
        return both[..., :3], both[..., 3:], inside[..., None].astype(np.float32)


def keep_plate(
    rgb: np.ndarray,
    mask: np.ndarray,
    camera: PinholeCamera,
    radiance: np.ndarray | None = None,
    transparent: np.ndarray | None = None,
) -> Plate | None:
    """Make the plate of a photo [H, W, 3] with its object marked [H, W]; None where hardly any place is visible."""
    height, width = mask.shape
    scale = min(1.0, MOST_ROWS / np.pi / camera.focal)
    size = max(4, round(width * scale)), max(4, round(height * scale))
    step = max(1, min(width // (2 * size[0]), height // (2 * size[1])))
    covered = mask if transparent is None else np.maximum(mask, transparent)
    hidden = resample(covered[::step, ::step].astype(np.float32), size)
    if (hidden < 0.5).mean() < LEAST_LEFT:
        return None
    return Plate(
        rgb=to_bytes(resample(rgb[::step, ::step], size)),
        hidden=to_bytes(hidden),
        camera=replace(camera, width=size[0], height=size[1], focal=camera.focal * size[0] / width),
        radiance=None if radiance is None else resample(radiance[::step, ::step], size).clip(0, 6e4).astype(np.float16),
    )
