"""Normals given with a photo: of a tracked model, a depth camera, a scan, another network."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from anyprobe.core import Float
from anyprobe.core.camera import PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.errors import InputError
from anyprobe.files.paths import open_regular
from anyprobe.inputs.hints import NormalsSource
from anyprobe.maps.exr import EXR_MAGIC, read_exr
from anyprobe.masks.check import object_box
from anyprobe.masks.depth import NPY_MAGIC
from anyprobe.pictures.headers import MAX_PIXELS
from anyprobe.pictures.images import read_image

Part = tuple[slice, slice]
"""Rows and columns of a photo."""

SHORTEST: float = contract("graph")["shortest_normal"]
"""A vector shorter than this is no normal: nothing is known there, or opposite ones were averaged."""
NEAR_UNIT: float = contract("normals")["near_unit"]
UNIT_SHARE: float = contract("normals")["unit_share"]
"""A picture of normals has vectors so near to unit length in this share at least of where they are known. Of 14 photos
one had more, .77, whose vectors look away; normal maps of spheres 40 pixels wide as JPEG of quality 30 had .78."""
PLAIN = 0.1
"""Display value up to which black, and down from 1 white, is no normal's colour: their vectors are far too long."""
ROUND = 0.9
"""Overlap with a sphere's outline, intersection over union, from which on a mask is taken for one."""
STRIP_PX = 1 << 17
"""A sphere's normals are computed in strips of so many pixels: rays of a whole photo take 118 bytes a pixel."""
FACING: float = contract("normals")["facing"]
"""Share of the normals that must look towards the camera; else their axes are another frame's."""


def normals_from_outline(mask: Float[np.ndarray, "H W"], long_fov_deg: float) -> Float[np.ndarray, "H W 3"]:
    """Compute the normals of a spherical object from its outline alone.

    A pinhole sees a sphere of angular radius phi around the axis c in all rays d with d.c >= cos phi: the outline's
    solid angle 2 pi (1 - cos phi) gives phi, its mean ray c. With c at distance 1 the sphere has the radius
    sin phi, the ray meets it at s = d.c - sqrt(sin^2 phi - (1 - (d.c)^2)), and n = (s d - c) / sin phi.

    Args:
        mask: [H, W] in [0, 1], 1 on the sphere.
        long_fov_deg: field of view of the photo's longer side.
    Returns:
        [H, W, 3] float32 in the camera's frame, unit, zero beside the sphere.
    Raises:
        InputError: the outline is no sphere's.
    """
    normals, overlap = sphere_of_outline(mask, long_fov_deg)
    if overlap < ROUND:
        raise InputError(
            f"expected a sphere, got a mask that shares {overlap:.0%} with the nearest circle; "
            "mask the sphere alone and whole, or give its normals",
            subject="normals",
        )
    return normals


def sphere_of_outline(mask: Float[np.ndarray, "H W"], long_fov_deg: float) -> tuple[np.ndarray, float]:
    """Return the normals [H, W, 3] of the sphere nearest to an outline, and their overlap: intersection over union."""
    height, width = mask.shape
    camera = PinholeCamera.of_fov(width, height, long_fov_deg)
    solid_angle, axis = 0.0, np.zeros(3)
    for part in _strips(mask):
        d, length = rays_through(part, camera)
        angles = mask[part] / (camera.focal**2 * length**3)  # steradians of what the mask covers of each pixel
        solid_angle += angles.sum()
        axis += (angles[..., None] * d).sum(axis=(0, 1))
    axis /= np.linalg.norm(axis)
    cos_phi = 1.0 - solid_angle / (2 * np.pi)
    radius = np.sqrt(max(1.0 - cos_phi**2, 1e-12))
    normals = np.zeros((*mask.shape, 3), np.float32)
    shared = covered = 0
    for part in _strips(mask):
        d, _ = rays_through(part, camera)
        along = d @ axis
        inside, on = along > cos_phi, mask[part] > 0.5
        shared += int((inside & on).sum())
        covered += int((inside | on).sum())
        s = along - np.sqrt(np.maximum(radius**2 - 1.0 + along**2, 0.0))
        n = (s[..., None] * d - axis) / radius
        normals[part] = np.where(inside[..., None], n, 0.0)
    return normals, shared / covered


def rays_through(part: Part, camera: PinholeCamera) -> tuple[np.ndarray, np.ndarray]:
    """Return unit rays [h, w, 3] through a part of a photo, in the camera's frame, and the length [h, w] that each had
    where z was -1."""
    y, x = np.mgrid[part] + 0.5
    d = camera.rays(x, y)
    length = np.linalg.norm(d, axis=-1)
    return d / length[..., None], length


def _strips(mask: np.ndarray) -> Iterator[Part]:
    """Yield the part of a photo around a mask in strips of at most STRIP_PX pixels, a row at least.

    A disc of area A around the mask's mean reaches sqrt(A / pi) - A / (2 side) beyond its box, side / 2 pi at most.
    """
    (height, width), (x0, y0, x1, y1) = mask.shape, object_box(mask > 0.0)
    reach = max(x1 - x0, y1 - y0) // 4 + 1
    columns, bottom = slice(max(x0 - reach, 0), min(x1 + reach, width)), min(y1 + reach, height)
    step = max(1, STRIP_PX // (columns.stop - columns.start))
    for top in range(max(y0 - reach, 0), bottom, step):
        yield slice(top, min(top + step, bottom)), columns


def read_normals(source: NormalsSource, shape: tuple[int, int]) -> Float[np.ndarray, "H W 3"]:
    """Return a normal map of the photo, in the camera's frame (+X right, +Y up, +Z towards the camera).

    Args:
        source: float [H, W, 3] (array, .npy, .exr), or a picture (file, its bytes, uint8 or uint16 array) of
            (n + 1) / 2. Zero (in pictures black, middle grey, white or transparent) where they are not known.
        shape: (height, width) of the upright photo.
    Returns:
        [H, W, 3] float32, unit or zero.
    Raises:
        InputError: no normals, a picture of something else, another size, or another frame: most of them look away from
            the camera.
    """
    values, name, from_picture = _read(source)
    if values.shape != (*shape, 3):
        raise InputError(
            f"expected normals of the photo's size {shape[1]} x {shape[0]}, three a pixel, got "
            f"shape {values.shape}; render them through the photo's camera",
            source=name,
        )
    values = np.where(np.isfinite(values), values, 0.0).astype(np.float32)
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    known = length > SHORTEST
    if not known.any():
        text = "expected unit normals where the object is, found none; a picture holds (n + 1) / 2"
        raise InputError(text, source=name)
    is_unit = (np.abs(length[known] - 1.0) < NEAR_UNIT).mean() >= UNIT_SHARE
    if not (is_unit or from_picture) and (values >= 0.0).all():
        text = "expected unit vectors in floats, got values of a picture, (n + 1) / 2; pass 2 * values - 1"
        raise InputError(text, source=name)
    if from_picture and not is_unit:
        raise InputError(
            "expected a picture of (n + 1) / 2, got one most of whose vectors are far from unit length, as a "
            "photo's are; pass a normal map, or sphere",
            source=name,
        )
    if (values[known[..., 0], 2] > 0).mean() < FACING:
        raise InputError(
            "expected normals towards the camera (+X right, +Y up, +Z to it), most look away; "
            "flip Y and Z if they come from OpenCV, turn them if they are the world's",
            source=name,
        )
    return np.where(known, values / np.maximum(length, SHORTEST), 0.0)


def _read(source: NormalsSource) -> tuple[np.ndarray, str, bool]:
    """Vectors as they are stored, what messages call them, and whether a picture held them."""
    if isinstance(source, bytes) and source.startswith(EXR_MAGIC):
        text = "expected a PNG picture of (n + 1) / 2, got an .exr; send it as 16-bit PNG"
        raise InputError(text, subject="normals")
    if isinstance(source, bytes | np.ndarray):
        return _decoded(source, "normals")
    path = Path(source)
    with open_regular(path, InputError, "a normal map") as stream:
        start = stream.read(len(NPY_MAGIC))
    if start.startswith(EXR_MAGIC):
        return read_exr(path, path.name, InputError, MAX_PIXELS)[..., :3], path.name, False
    if start != NPY_MAGIC and path.suffix.lower() != ".npy":
        return _decoded(path, path.name)
    try:
        with path.open("rb") as stream:
            values = np.load(stream, allow_pickle=False)[:]
    except Exception as error:  # its headers are parsed as Python, which fails in every way
        text = "expected one array in a .npy file, got several, or a damaged file"
        raise InputError(text, source=path.name) from error
    return _decoded(values, path.name)


def _decoded(source: Path | bytes | np.ndarray, name: str) -> tuple[np.ndarray, str, bool]:
    """_read of floats, which are vectors already, or of a picture."""
    if isinstance(source, np.ndarray) and source.dtype.kind == "f":
        return source, name, False
    pixels = read_image(source, as_data=True)
    known = (pixels.rgb.max(axis=-1) > PLAIN) & (pixels.rgb.min(axis=-1) < 1.0 - PLAIN)
    if pixels.alpha is not None:
        known &= pixels.alpha > 0.5
    return np.where(known[..., None], pixels.rgb * 2.0 - 1.0, 0.0), name, True
