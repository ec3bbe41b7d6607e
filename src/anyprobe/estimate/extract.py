"""A photo as the networks see it: small enough to be sent to another process, and to be kept of several photos.

Its object may be a mirror ball: a circular outline, fine structure all over, and a network that takes it for metal. A
mirror shows its surroundings all over, so no smooth shading explains its ln radiance; satin has no such structure, and
what plastic mirrors near its rim the network does not take for metal.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.core.response import inverse_response
from anyprobe.errors import InputError
from anyprobe.estimate.normals_hint import normals_from_outline, rays_through, sphere_of_outline
from anyprobe.estimate.photo import Photo, inputs_of
from anyprobe.estimate.surroundings import GivenPanorama
from anyprobe.light.harmonics import sh_basis
from anyprobe.masks.check import object_box
from anyprobe.notices import Notice, give
from anyprobe.place.plate import Plate


@dataclass(frozen=True, kw_only=True, slots=True)
class Extract:
    """All that an estimate needs of a photo.

    Attributes:
        photo: without its pixels.
        inputs: of photo.inputs_of.
        ball: the object as a mirror ball, where it is alone and looks like one; if it is metal, the light is unwrapped
            from it.
        plate: the photo beside its object, for the light's panorama; None: it is not kept.
        load_s: how long reading the photo, finding its object and this took.
    """

    photo: Photo
    inputs: dict[str, np.ndarray]
    ball: Extract | None = None
    plate: Plate | None = None
    load_s: float = 0.0


def extract_of(photo: Photo, *, is_first: bool = True, may_be_ball: bool = True, with_plate: bool = True) -> Extract:
    """Return what an estimate needs of a photo.

    Args:
        is_first: whether the sun and a panorama from a file, which are of the first photo's frame, count.
        may_be_ball: whether an object that looks like a mirror ball is taken for one.
    """
    start = time.perf_counter()
    seen = photo
    if not is_first:
        around = None if isinstance(photo.surroundings, GivenPanorama) else photo.surroundings
        seen = replace(photo, surroundings=around, sun=None)
    ball = as_ball(photo) if may_be_ball else None
    return Extract(
        photo=seen.without_pixels(),
        inputs=inputs_of(seen),
        ball=None if ball is None else Extract(photo=ball.without_pixels(), inputs=inputs_of(ball)),
        plate=photo.plate() if with_plate and photo.shows_place else None,
        load_s=photo.load_s + time.perf_counter() - start,
    )


def extracts_of(photos: Iterable[Photo | Extract], is_alone: bool = False) -> Iterator[Extract]:
    """Yield what one estimate needs of several photos, or of one, each of which may be loaded as it is asked for."""
    for number, photo in enumerate(photos):
        if isinstance(photo, Photo):
            yield extract_of(photo, is_first=number == 0, may_be_ball=is_alone, with_plate=number == 0)
        elif isinstance(photo, Extract):
            yield photo
        else:
            text = f"expected what load_photo returns, got {type(photo).__name__}; load each first"
            raise InputError(text, subject="photos")


_NUMBERS = contract("mirror_ball")

ROUND: float = _NUMBERS["round"]
"""Smallest overlap of a mask with a circle that may be a ball's outline."""
FINE, METAL = _NUMBERS["fine"], _NUMBERS["metal"]
"""Smallest standard deviation of ln radiance around smooth shading of a mirror, and smallest probability of a metal.

Chosen on balls under training maps, drawn through lenses of 42 to 72 degrees as JPEG with noise: 26 of 29 of chrome,
silver, gold and perfect mirrors are found, and none of 40 of satin, plastic, paint, porcelain, marble and plaster.
"""
MOST_SIDE, LEAST_SIDE_PX = _NUMBERS["most_side"], _NUMBERS["least_side_px"]
"""Largest number of pixels sampled across the ball, and smallest side [px] of one: a smaller one shows too little."""
INNER: float = _NUMBERS["inner"]
"""Smallest n.wo of pixels that smooth shading is fitted to."""
FLOOR: float = _NUMBERS["floor"]
"""Radiance added before the logarithm."""
CHROME: str = _NUMBERS["material"]
"""Material assumed for a detected ball."""


def said_of_ball(name: str) -> Notice:
    """Return the warning that describes what was done."""
    text = (
        "the object is round and shows its surroundings, so it was unwrapped as a mirror ball of chrome, which it may "
        "not be"
    )
    return Notice(text, code="mirror-ball", source=name, remedy=give("material"))


def as_ball(photo: Photo) -> Photo | None:
    """Return a photo with a sphere's normals where its object looks like a mirror ball, which it is if the network
    takes it for metal (Estimator.from_extract); None where it does not, or its shape or material is given."""
    if photo.material is not None or photo.normals is not None or not looks_like_ball(photo):
        return None
    return replace(photo, normals=normals_from_outline(photo.mask, photo.long_fov_deg))


def looks_like_ball(photo: Photo) -> bool:
    """Return whether a photo's object is round and shows fine structure."""
    x0, y0, x1, y1 = object_box(photo.mask)
    side, other = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    if other < max(LEAST_SIDE_PX, 0.8 * side):
        return False
    step = max(1, side // MOST_SIDE)
    mask, rgb = photo.mask[::step, ::step], photo.rgb[::step, ::step]
    normals, overlap = sphere_of_outline(mask, photo.long_fov_deg)
    return overlap >= ROUND and _fineness(normals, rgb, mask, photo.long_fov_deg) >= FINE


def _fineness(normals: np.ndarray, rgb: np.ndarray, mask: np.ndarray, long_fov_deg: float) -> float:
    """Return the standard deviation of a ball's ln radiance [H, W] around the best sum of harmonics of the normal."""
    height, width = mask.shape
    d, _ = rays_through((slice(0, height), slice(0, width)), PinholeCamera.of_fov(width, height, long_fov_deg))
    on = (mask > 0.99) & (-(normals * d).sum(axis=-1) > INNER)
    if on.sum() < 100:
        return 0.0
    n, level = normals[on].astype(np.float64), np.log(inverse_response(rgb[on]) + FLOOR).mean(axis=-1)
    x, y, z = n.T
    terms = np.concatenate([sh_basis(n), np.stack([x**3, y**3, x * y * z], axis=-1)], axis=-1)
    fit, *_ = np.linalg.lstsq(terms, level, rcond=None)
    return float(np.std(level - terms @ fit))
