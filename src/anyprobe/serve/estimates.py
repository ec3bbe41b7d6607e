"""The work behind each address: bytes in, lights and pictures out, step by step so that it can stop."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from anyprobe.core.frames import rotation_of
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.result import Light
from anyprobe.files.images import read_image
from anyprobe.files.radiance import read_radiance
from anyprobe.scatter.materials import Material, given_material
from anyprobe.serve.pool import Job
from anyprobe.serve.uploads import Upload

PAGE_LONG_PX = 2048
"""Longer side of what /v1/photo sends back: more than a page shows."""

MAP_MAX_ROWS = 1024
"""Largest map that is exported, in 0.6 GB at most (a KTX2 cube, turned); ours have 64."""


def open_photo(upload: Upload, job: Job) -> Photo:
    """The photo with its object marked, under the name it was sent with."""
    job.step()
    return load_photo(
        upload.photo,
        name=upload.name,
        mask=upload.mask,
        click=upload.clicks or None,
        click_off=upload.clicks_off or None,
        box=upload.box,
        fov_deg=upload.fov_deg,
        normals=upload.normals,
        surroundings=upload.surroundings,
    )


def estimate_light(estimator: Estimator, upload: Upload, job: Job) -> tuple[Photo, Light]:
    """What Estimator does, with a look between decoding and computing at whether it is still wanted."""
    estimator, material = as_given(estimator, upload)
    start = time.perf_counter()
    photo = open_photo(upload, job)
    job.step()
    return photo, estimator.from_photo(photo, start, material=material)


def as_given(estimator: Estimator, upload: Upload) -> tuple[Estimator, Material | None]:
    """The estimator with the emitters that were asked for, and the material that was told."""
    material = given_material(upload.material, upload.albedo)
    return estimator if upload.emitters is None else estimator.with_emitters(upload.emitters), material


def upright_picture(data: bytes, job: Job) -> tuple[np.ndarray, float | None]:
    """A photo of any known format as uint8 [H, W, 3 or 4], upright, sRGB, at most PAGE_LONG_PX long.

    Returns:
        The picture, and the field of view of its longer side [degrees] where EXIF tells it.
    """
    from PIL import Image

    job.step()
    pixels = read_image(data, "photo")
    layers = [pixels.rgb] if pixels.alpha is None else [pixels.rgb, pixels.alpha[..., None]]
    picture = Image.fromarray(np.round(np.concatenate(layers, axis=-1) * 255).astype(np.uint8))
    picture.thumbnail((PAGE_LONG_PX, PAGE_LONG_PX), Image.Resampling.LANCZOS)
    return np.asarray(picture), pixels.long_fov_deg


def export_map(upload: Upload, target: str, folder: Path, job: Job) -> None:
    """Write a map (.exr or .hdr bytes in the place of the photo) for one target into an empty folder."""
    from anyprobe.export.exported_light import check_front, map_from_camera, origin_turned
    from anyprobe.export.targets import export

    job.step()
    suffix = ".hdr" if upload.photo.startswith(b"#?") else ".exr"
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / f"map{suffix}"
        path.write_bytes(upload.photo)
        radiance = read_radiance(path)
        try:
            check_front(path)
            turned = origin_turned(map_from_camera(path))
        except InputError as error:
            raise InvalidEnvironment(str(error).replace(str(path), "map")) from error
    if len(radiance) > MAP_MAX_ROWS:
        raise InvalidEnvironment(
            f"map: expected at most {MAP_MAX_ROWS} rows, got {len(radiance)}; shrink it first"
        )
    given, exposure_ev = upload.world_from_camera, upload.exposure or 0.0
    turn = None if given is None else rotation_of(given)
    export(radiance, target, folder, "light", world_from_camera=turn, exposure_ev=exposure_ev, origin=turned)
