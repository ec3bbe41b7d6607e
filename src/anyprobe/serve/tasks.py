"""What is done in a decoding process: bytes in, and what the networks or the answer need of them out."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from anyprobe.core.frames import rotation_of
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.estimate.panorama import cut_out
from anyprobe.estimate.photo import Crop, Photo, load_photo
from anyprobe.files.headers import declared_pixels
from anyprobe.files.images import read_image
from anyprobe.files.radiance import read_radiance
from anyprobe.serve.answers import mask_json, mask_png, png, zip_folder

PAGE_LONG_PX = 2048
"""Longer side of what /v1/photo sends back: more than a page shows."""

MAP_MAX_ROWS = 512
"""Largest map that is exported: a cube of it takes 5 seconds; ours have 64."""

MAX_PANORAMA_PIXELS = 8_500_000
"""Of surroundings, which are brought to 128 x 64."""

QUICK_STARTS = (b"\xff\xd8\xff", b"\x89PNG", b"RIFF")
QUICK_BYTES = 16 * 2**20
"""JPEG, PNG and WebP up to this are decoded in a moment."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Upload:
    """A photo and what was given with it.

    Attributes:
        photo: the file's bytes, as sent.
        name: file name without folders, for messages; "photo" where none came.
        mask: bytes of a mask picture; normals: of a picture of the object's normals, or "sphere";
        surroundings: of a panorama in the camera's frame, or "photo".
        box: X0, Y0, X1, Y1 in pixels of the upright photo.
        clicks: x, y on the object, in pixels of the upright photo.
        clicks_off: likewise beside it.
        fov_deg: field of view of the longer side.
        material: name of the object's; albedo: its linear albedo, one number or three.
        emitters: how the light sources are asked for, of estimate.runtime.EMITTERS.
        include: what the JSON answer shall carry besides: "radiance", "stages", "mask".
        exposure: stops that an export is brightened by.
        world_from_camera: what an export is turned by: 2 or 3 angles in degrees, or 9 numbers of a matrix.
    """

    photo: bytes
    name: str = "photo"
    mask: bytes | None = None
    normals: bytes | str | None = None
    surroundings: bytes | str | None = None
    box: tuple[float, ...] | None = None
    clicks: tuple[tuple[float, float], ...] = ()
    clicks_off: tuple[tuple[float, float], ...] = ()
    fov_deg: float | None = None
    material: str | None = None
    albedo: tuple[float, ...] | None = None
    emitters: str | None = None
    include: frozenset[str] = frozenset()
    exposure: float | None = None
    world_from_camera: tuple[float, ...] | None = None

    @property
    def is_quick(self) -> bool:
        """Whether all its pictures are of formats that are decoded in a moment."""
        pictures = [
            one for one in (self.photo, self.mask, self.normals, self.surroundings) if isinstance(one, bytes)
        ]
        return (
            all(one.startswith(QUICK_STARTS) for one in pictures) and sum(map(len, pictures)) <= QUICK_BYTES
        )


class TooManyPixels(InputError):
    """A picture's header claims more pixels than the server decodes."""


def ready() -> None:
    """Nothing; for a process that is to have its imports done."""


def cut(upload: Upload, max_pixels: int, first: bool, with_mask: bool) -> tuple[Photo, Crop, bytes | None]:
    """The object cut out of its photo, what the photo is without its pixels, and its mask as PNG if it is wanted."""
    photo = _open(upload, max_pixels)
    return photo.without_pixels(), cut_out(photo, first=first), mask_png(photo.mask) if with_mask else None


def mask(upload: Upload, max_pixels: int, as_json: bool) -> dict[str, Any] | bytes:
    """The mask that an estimate would use, as PNG, or what is said of it."""
    photo = _open(upload, max_pixels)
    return mask_json(photo) if as_json else mask_png(photo.mask)


def upright(upload: Upload, max_pixels: int) -> tuple[bytes, float | None]:
    """A photo of any known format as PNG, upright, sRGB, at most PAGE_LONG_PX long.

    Returns:
        The picture, and the field of view of its longer side [degrees] where its EXIF has it.
    """
    _check_pixels(upload, max_pixels)
    pixels = read_image(upload.photo, "photo")
    layers = [pixels.rgb] if pixels.alpha is None else [pixels.rgb, pixels.alpha[..., None]]
    picture = np.empty((*pixels.rgb.shape[:2], 2 + len(layers)), np.uint8)
    for rows in np.array_split(np.arange(len(picture)), max(1, picture.size // 2**22)):
        both = np.concatenate([layer[rows[0] : rows[-1] + 1] for layer in layers], axis=-1)
        picture[rows[0] : rows[-1] + 1] = np.round(both * 255)
    image, fov_deg = Image.fromarray(picture), pixels.long_fov_deg
    del pixels, layers
    image.thumbnail((PAGE_LONG_PX, PAGE_LONG_PX), Image.Resampling.LANCZOS)
    return png(np.asarray(image)), fov_deg


def export_zip(upload: Upload, max_pixels: int, target: str) -> bytes:
    """A map (.exr or .hdr bytes in the place of the photo) as the files of one target, in a zip."""
    from anyprobe.export.exported_light import check_front, map_from_camera, origin_turned
    from anyprobe.export.targets import export

    _check_pixels(upload, min(max_pixels, 2 * MAP_MAX_ROWS**2))
    suffix = ".hdr" if upload.photo.startswith(b"#?") else ".exr"
    with tempfile.TemporaryDirectory() as scratch, tempfile.TemporaryDirectory() as folder:
        path = Path(scratch) / f"map{suffix}"
        path.write_bytes(upload.photo)
        radiance = read_radiance(path)
        try:
            check_front(path)
            turned = origin_turned(map_from_camera(path))
        except InputError as error:
            raise InvalidEnvironment(str(error).replace(str(path), "map")) from error
        given, exposure_ev = upload.world_from_camera, upload.exposure or 0.0
        turn = None if given is None else rotation_of(given)
        export(
            radiance,
            target,
            Path(folder),
            "light",
            world_from_camera=turn,
            exposure_ev=exposure_ev,
            origin=turned,
        )
        return zip_folder(Path(folder))


def _open(upload: Upload, max_pixels: int) -> Photo:
    """The photo with its object marked, under the name it was sent with."""
    _check_pixels(upload, max_pixels)
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


def _check_pixels(upload: Upload, max_pixels: int) -> None:
    """TooManyPixels where a picture's header claims more."""
    pictures = {upload.name: upload.photo, "mask": upload.mask, "normals": upload.normals}
    bounds = dict.fromkeys(pictures, max_pixels) | {"surroundings": min(max_pixels, MAX_PANORAMA_PIXELS)}
    for name, picture in (pictures | {"surroundings": upload.surroundings}).items():
        if isinstance(picture, bytes) and declared_pixels(picture) > bounds[name]:
            raise TooManyPixels(
                f"{name}: expected at most {bounds[name] / 1e6:g} million pixels; shrink it first"
            )
