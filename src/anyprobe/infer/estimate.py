"""The main job: one photo in, the light around its object out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from anyprobe.files.images import ImageSource
from anyprobe.infer.mask import MaskSource
from anyprobe.infer.photo import Photo, crop_object, load_photo
from anyprobe.infer.result import Light, told_share
from anyprobe.infer.runtime import DEFAULT_MODEL, PHOTO_SIZE, Models, model_id
from anyprobe.light.environment import rotate
from anyprobe.light.reconstruct import reconstruct


class Estimator:
    """Networks opened once, called like a function on many photos.

    >>> estimator = Estimator()                          # doctest: +SKIP
    >>> light = estimator("vase.png", mask="mask.png")   # doctest: +SKIP
    """

    def __init__(self, model: str = DEFAULT_MODEL, *, threads: int | None = None) -> None:
        self.models = Models(model, threads)
        self.model_id = model_id(model)

    def __call__(
        self,
        source: ImageSource,
        *,
        mask: MaskSource | None = None,
        box: Sequence[float] | None = None,
        fov_deg: float | None = None,
    ) -> Light:
        """The light around the object of one photo.

        Args:
            source: path, bytes, Pillow image or array ([H, W, 3 or 4], uint8 or float in [0, 1]).
            mask: picture of the photo's size, white on the object; path, Pillow image or array.
            box: X0, Y0, X1, Y1 in pixels around the object, when there is no mask.
            fov_deg: field of view of the photo's longer side; else from EXIF, else 65.
        Raises:
            InvalidPhoto, InvalidMask: with one line that says what to do.
        """
        start = time.perf_counter()
        return self.from_photo(load_photo(source, mask=mask, box=box, fov_deg=fov_deg), start)

    def from_photo(self, photo: Photo, start: float | None = None) -> Light:
        """The same for a Photo that is loaded already."""
        start = time.perf_counter() if start is None else start
        crop = crop_object(photo, PHOTO_SIZE)
        loaded = time.perf_counter()
        outputs = self.models(crop.image)
        estimated = time.perf_counter()
        radiance = reconstruct(outputs.ldr, outputs.ln_radiance)  # Eq. 7-8, in the crop's frame
        radiance = np.maximum(rotate(radiance, crop.camera_from_crop), 0.0)
        return Light(
            radiance=radiance,
            confidence=told_share(crop.image),
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
                "long_fov_deg": round(float(photo.long_fov_deg), 3),
                "fov_source": photo.fov_source,
                "crop": {"center_px": list(crop.center_px), "side_px": crop.side_px},
                "seconds": {
                    "load": round(loaded - start, 4),
                    "networks": round(estimated - loaded, 4),
                    "reconstruct": round(time.perf_counter() - estimated, 4),
                },
            },
        )


@lru_cache(maxsize=2)
def _shared(model: str) -> Estimator:
    return Estimator(model)


def estimate(
    source: ImageSource,
    *,
    mask: MaskSource | None = None,
    box: Sequence[float] | None = None,
    fov_deg: float | None = None,
    model: str = DEFAULT_MODEL,
) -> Light:
    """The light around the object of one photo; an Estimator used once (and kept for the next call)."""
    return _shared(model)(source, mask=mask, box=box, fov_deg=fov_deg)
