"""Tasks of decoding processes: from bytes to the input of the networks or of the answer."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from anyprobe import session
from anyprobe.core.color import to_bytes
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.estimate.extract import Extract, extract_of
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.sidecar import export_settings, read_rotation
from anyprobe.export.exported_light import check_front
from anyprobe.export.targets import write_export
from anyprobe.maps.radiance import read_radiance
from anyprobe.notices import leave_out
from anyprobe.pictures.declared_size import declared_pixels
from anyprobe.pictures.images import png_bytes, read_image
from anyprobe.serve.answers import mask_json, mask_png
from anyprobe.serve.limits import MAX_MAP_ROWS, MAX_PANORAMA_PIXELS, MAX_SENT_SIDECAR_BYTES, QUICK_BYTES
from anyprobe.session import Shot

PAGE_LONG_PX = 2048
"""Longer side of the pictures that /v1/photo returns [pixels]: more than a page shows."""

QUICK_STARTS = (b"\xff\xd8\xff", b"\x89PNG", b"RIFF")
"""First bytes of JPEG, PNG and WebP."""


class TooManyPixels(InputError):
    """A picture's header claims more pixels than the server decodes."""

    default_code = "too-large"


def ready() -> None:
    """Do nothing: imports are done once a process can call this."""


def pictures(shot: Shot) -> list[tuple[str, bytes]]:
    """Return a request's files with their names in messages."""
    return [(name, data) for name, data in [(shot.name, shot.source), *shot.hints.given()] if isinstance(data, bytes)]


def is_quick(shot: Shot) -> bool:
    """Return whether all pictures are small and of formats that decode quickly."""
    data = [picture for _, picture in pictures(shot)]
    return all(one.startswith(QUICK_STARTS) for one in data) and sum(map(len, data)) <= QUICK_BYTES


def extract(
    shot: Shot, max_pixels: int, is_first: bool, is_alone: bool, with_mask: bool
) -> tuple[Extract, bytes | None]:
    """Return a photo's extract, and its mask as PNG where it is asked for."""
    photo = _marked(shot, max_pixels)
    found = extract_of(photo, is_first=is_first, may_be_ball=is_alone, with_plate=False)
    return found, mask_png(photo.mask) if with_mask else None


def mask(shot: Shot, max_pixels: int, as_json: bool) -> dict[str, Any] | bytes:
    """Return the mask that an estimate would use as PNG, or its description as JSON data."""
    photo = _marked(shot, max_pixels)
    return mask_json(photo) if as_json else mask_png(photo.mask)


def upright(shot: Shot, max_pixels: int) -> tuple[bytes, float | None]:
    """Convert a photo of any known format to PNG: upright, sRGB, at most PAGE_LONG_PX long.

    Returns:
        The picture, and the field of view of its longer side [degrees] where its EXIF has it.
    """
    _check_pixels(pictures(shot), max_pixels)
    assert isinstance(shot.source, bytes)  # as all that is sent
    pixels = read_image(shot.source, "photo")
    layers = [pixels.rgb] if pixels.alpha is None else [pixels.rgb, pixels.alpha]
    image, fov_deg = Image.fromarray(np.dstack([to_bytes(layer) for layer in layers])), pixels.long_fov_deg
    del pixels, layers
    image.thumbnail((PAGE_LONG_PX, PAGE_LONG_PX), Image.Resampling.LANCZOS)
    return png_bytes(np.asarray(image), compress_level=3), fov_deg


def export_zip(
    data: bytes,
    max_pixels: int,
    target: str,
    *,
    sidecar: bytes | None = None,
    world_from_camera: str | None = None,
    is_level: bool = True,
    exposure_ev: float = 0.0,
) -> bytes:
    """Export a map for one target, as a zip.

    Args:
        data: the bytes of an .exr or .hdr; sidecar: those of its .json.
        world_from_camera: a text for read_rotation; None: see is_level.
        is_level: whether +Y is up in the place, where the sidecar states the camera's pitch.
        exposure_ev: exposure change [stops].
    """
    _check_pixels([("map", data)], min(max_pixels, 2 * MAX_MAP_ROWS**2))
    if len(sidecar or b"") > MAX_SENT_SIDECAR_BYTES:
        raise InputError(f"expected at most {MAX_SENT_SIDECAR_BYTES / 2**20:g} MiB, got more", subject="sidecar")
    turn = read_rotation(world_from_camera)
    with tempfile.TemporaryDirectory() as sent, tempfile.TemporaryDirectory() as folder:
        path = Path(sent) / f"map{'.hdr' if data.startswith(b'#?') else '.exr'}"
        path.write_bytes(data)
        beside = path.with_suffix(".json")
        if sidecar is not None:
            beside.write_bytes(sidecar)
        try:
            check_front(path)
            settings = export_settings(path, turn, is_level=is_level)
            write_export(read_radiance(path), target, Path(folder), "light", exposure_ev=exposure_ev, **settings)
            return Path(shutil.make_archive(str(Path(sent) / "files"), "zip", folder)).read_bytes()
        except (InputError, RecursionError) as error:
            if isinstance(error, RecursionError) or error.notice.source == str(beside):
                text = "expected the .json of this map as it was written, got a damaged one"
                raise InputError(text, subject="sidecar", remedy=leave_out("sidecar")) from error
            is_about_file = error.notice.source in (str(path), path.name)
            raise InvalidEnvironment(error.notice.of("map") if is_about_file else error) from error


def _marked(shot: Shot, max_pixels: int) -> Photo:
    """Read a photo whose pictures are small enough, and find its object."""
    _check_pixels(pictures(shot), max_pixels, shot.hints.surroundings)
    return session.mark(shot)


def _check_pixels(files: list[tuple[str, bytes]], max_pixels: int, panorama: object = None) -> None:
    """Raise TooManyPixels if a picture's header declares more pixels than allowed."""
    for name, picture in files:
        limit = min(max_pixels, MAX_PANORAMA_PIXELS) if picture is panorama else max_pixels
        if declared_pixels(picture) > limit:
            text = f"expected at most {limit / 1e6:g} million pixels, got more; shrink it first"
            raise TooManyPixels(text, source=name)
