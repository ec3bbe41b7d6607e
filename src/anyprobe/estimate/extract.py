"""A photo as the networks see it: small enough to be sent to another process, and to be kept of several photos."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.errors import InputError
from anyprobe.estimate.mirror_ball import as_ball
from anyprobe.estimate.photo import Photo, inputs_of
from anyprobe.estimate.surroundings import GivenPanorama
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
        is_first: whether a panorama from a file, which is of the first photo's frame, counts.
        may_be_ball: whether an object that looks like a mirror ball is taken for one.
    """
    start = time.perf_counter()
    seen = photo
    if not is_first and isinstance(photo.surroundings, GivenPanorama):
        seen = replace(photo, surroundings=None)
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
