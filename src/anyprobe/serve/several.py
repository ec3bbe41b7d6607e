"""Several photos of one object in one request, with the poses of their cameras: one light of all."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from starlette.requests import Request

from anyprobe.errors import InvalidMask, InvalidPhoto
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.multiview import estimate_multiview
from anyprobe.estimate.normals_prior import SPHERE
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.surroundings import PHOTO
from anyprobe.files.poses import parse_poses
from anyprobe.serve.estimates import as_given, open_photo
from anyprobe.serve.limits import Limits
from anyprobe.serve.openapi import FUSE
from anyprobe.serve.pool import Job
from anyprobe.serve.uploads import (
    Options,
    Upload,
    check_pixels,
    parse_numbers,
    read_form,
    read_part,
    refuse_unknown,
)

MOST = 16
"""Photos in one request."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Several:
    """Photos, and world_from_camera [N, 3, 3] of each."""

    uploads: tuple[Upload, ...]
    world_from_camera: np.ndarray


async def read_multiview(request: Request, limits: Limits) -> Several:
    """Read parts `photo` and as many of `mask` or `box` or none, one part `poses`, and what concerns all of them.

    Raises:
        HTTPException: 408 too slow, 413 too many pixels.
        InputError: no photos or too many, no poses or not theirs, or an option that is unknown or cannot be read.
    """
    async with read_form(request, limits, max_files=2 * MOST + 1) as form:
        photos = [await read_part(part, "photo") for part in form.getlist("photo")]
        masks = [(await read_part(part, "mask"))[0] for part in form.getlist("mask")]
        hints = form.get("poses", "null")
        poses = hints.encode() if isinstance(hints, str) else await hints.read()
        files = [name for name in form if not all(isinstance(one, str) for one in form.getlist(name))]
    option = Options(form, request.query_params)
    unused = [name for name in files if name in ("normals", "surroundings")]
    unused += [name for name in ("click", "click_off") if option.texts(name)]
    if unused:
        raise InvalidPhoto(
            f"{unused[0]}: expected a mask or a box a photo, got what one photo alone can have"
        )
    refuse_unknown(form, request.query_params, FUSE)
    if not 1 <= len(photos) <= MOST:
        raise InvalidPhoto(f"photo: expected 1 to {MOST} file parts of this name, got {len(photos)}")
    boxes = [parse_numbers("box", text, 4) for text in option.texts("box")]
    for name, given in (("mask", masks), ("box", boxes)):
        if len(given) not in (0, len(photos)):
            raise InvalidMask(
                f"{name}: expected none or one a photo, got {len(given)} for {len(photos)} photos"
            )
    for data, name in photos:
        await check_pixels(data, name, limits)
    for mask in masks:
        await check_pixels(mask, "mask", limits)
    normals, surroundings_map = option.word("normals", SPHERE), option.word("surroundings", PHOTO)
    turned, fovs = await asyncio.to_thread(_poses_of, photos, poses)
    light = option.of_light()
    uploads = tuple(
        Upload(
            photo=data,
            name=name,
            mask=masks[k] if masks else None,
            box=boxes[k] if boxes else None,
            normals=normals,
            surroundings=surroundings_map,
            **light | ({"fov_deg": fovs[k]} if light["fov_deg"] is None else {}),
        )
        for k, (data, name) in enumerate(photos)
    )
    return Several(uploads=uploads, world_from_camera=turned)


def _poses_of(photos: list[tuple[bytes, str]], poses: bytes) -> tuple[np.ndarray, list[float | None]]:
    """world_from_camera [N, 3, 3] of photos (their data and names), and what Poses.fovs_deg says of them."""
    hints, names = parse_poses(poses, "poses", len(photos)), [Path(name) for _, name in photos]
    return hints.of(names), hints.fovs_deg(names, [data for data, _ in photos])


def estimate_uploads(estimator: Estimator, several: Several, job: Job) -> tuple[Photo, Light]:
    """The first photo and the light of all, in its camera's frame."""
    start = time.perf_counter()
    estimator, material = as_given(estimator, several.uploads[0])  # told of all alike
    photos = (open_photo(upload, job) for upload in several.uploads)
    first = next(photos)
    turned = several.world_from_camera
    light = estimate_multiview(estimator, chain([first], photos), turned, start=start, material=material)
    return first, light
