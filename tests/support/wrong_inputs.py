"""Wrong inputs, and what every door says of each."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from PIL import Image

SIZE = 160, 120


def png(mode: str = "RGB", size: tuple[int, int] = SIZE, level: Any = 0) -> bytes:
    stream = io.BytesIO()
    Image.new(mode, size, level).save(stream, "PNG")
    return stream.getvalue()


def photo() -> bytes:
    """A bright disc on a dark wall."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    rgb = np.random.default_rng(1).integers(20, 60, (SIZE[1], SIZE[0], 3))
    rgb[np.hypot(x - 80, y - 60) < 35] = (200, 180, 160)
    stream = io.BytesIO()
    Image.fromarray(rgb.astype(np.uint8)).save(stream, "PNG")
    return stream.getvalue()


def mask(where: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> bytes:
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    stream = io.BytesIO()
    Image.fromarray(np.uint8(255 * where(x, y))).save(stream, "PNG")
    return stream.getvalue()


DISC = mask(lambda x, y: np.hypot(x - 80, y - 60) < 35)


@dataclass(frozen=True)
class Wrong:
    """One wrong input.

    Attributes:
        given: hints and settings as Python has them; bytes are files.
        code, subject: of the notice.
        remedy: what it names.
        photo: bytes of the photo.
        doors: where it can occur besides Python.
    """

    given: dict[str, Any]
    code: str = "invalid-option"
    subject: tuple[str, ...] = ()
    remedy: tuple[str, ...] = ()
    photo: bytes = field(default_factory=photo)
    doors: tuple[str, ...] = ("command line", "http")


TABLE = {
    "mask and click": Wrong({"mask": DISC, "click": (3, 3)}, subject=("mask", "click")),
    "mask and box": Wrong({"mask": DISC, "box": (1, 2, 90, 90)}, subject=("mask", "box")),
    "mask and exclude": Wrong(
        {"mask": DISC, "exclude": (3, 3)}, subject=("exclude", "mask"), remedy=("exclude", "mask")
    ),
    "near without depth": Wrong({"near": 3.0}, subject=("near",), remedy=("depth",)),
    "far without depth": Wrong({"far": 3.0}, subject=("far",), remedy=("depth",)),
    "near beyond far": Wrong({"depth": png("I;16", level=9), "near": 5.0, "far": 3.0}, subject=("near", "far")),
    "nothing so near": Wrong({"depth": png("I;16", level=9), "far": 3.0}, subject=("depth",)),
    "depth of nothing": Wrong({"depth": png("I;16"), "far": 3.0}, subject=("depth",)),
    "depth of another view": Wrong({"depth": png("I;16", (80, 80), 9), "far": 30.0}, subject=("depth",)),
    "coloured depth": Wrong({"depth": photo(), "far": 3.0}, subject=("depth",)),
    "text as depth": Wrong({"depth": b"depth", "far": 3.0}, subject=("depth",)),
    "field of view of 0": Wrong({"fov_deg": 0.0}, subject=("fov_deg",)),
    "field of view of 200": Wrong({"fov_deg": 200.0}, subject=("fov_deg",)),
    "pitch of 91": Wrong({"pitch_deg": 91.0}, subject=("pitch_deg",)),
    "roll without pitch": Wrong({"roll_deg": 5.0}, subject=("roll_deg",), remedy=("pitch_deg",)),
    "metal with an albedo": Wrong({"material": "gold", "albedo": 0.5}, subject=("albedo",)),
    "albedo of 2": Wrong({"albedo": 2.0}, subject=("albedo",)),
    "roughness of 0": Wrong({"roughness": 0.0}, subject=("roughness",)),
    "unknown material": Wrong({"material": "unobtainium"}, subject=("material",)),
    "empty mask": Wrong({"mask": png("L")}, code="no-object", subject=("mask",)),
    "mask of a few pixels": Wrong({"mask": mask(lambda x, y: (x < 9) & (y < 9))}, code="no-object", subject=("mask",)),
    "mask of another size": Wrong({"mask": png("L", (80, 60), 255)}, subject=("mask",)),
    "text as mask": Wrong({"mask": b"mask"}, code="invalid-image", subject=("mask",), remedy=("choose-photo",)),
    "click beside the photo": Wrong({"click": (500.0, 3.0)}, subject=("click",)),
    "exclude beside the photo": Wrong({"exclude": (3.0, 500.0)}, subject=("exclude",)),
    "box beside the photo": Wrong({"box": (0.0, 0.0, 900.0, 90.0)}, subject=("box",)),
    "box of nothing": Wrong({"box": (10.0, 10.0, 14.0, 14.0)}, subject=("box",)),
    "box of all": Wrong({"box": (0.0, 0.0, *map(float, SIZE))}, subject=("box",)),
    "nothing to find": Wrong({}, code="no-object", remedy=("click", "box", "mask"), photo=png(level="grey")),
    "nothing at the click": Wrong({"click": (5.0, 5.0)}, code="no-object", remedy=("box", "mask"), photo=png()),
    "square panorama": Wrong({"surroundings": png(size=(64, 64))}, subject=("surroundings",)),
    "transparent panorama": Wrong({"surroundings": png("RGBA", (64, 32))}, subject=("surroundings",)),
    "text as panorama": Wrong(
        {"surroundings": b"sky"}, code="invalid-image", subject=("surroundings",), remedy=("choose-photo",)
    ),
    "normals of another size": Wrong(
        {"normals": png(size=(80, 60), level=(128, 128, 255)), "mask": DISC}, subject=("normals",)
    ),
    "a photo as normals": Wrong({"normals": photo(), "mask": DISC}, subject=("normals",)),
    "a box as sphere": Wrong(
        {"normals": "sphere", "mask": mask(lambda x, y: (x > 20) & (x < 140) & (y > 50) & (y < 80))},
        subject=("normals",),
    ),
    "text as photo": Wrong({}, code="invalid-image", remedy=("choose-photo",), photo=b"not a photo"),
    "video as photo": Wrong({}, code="invalid-image", remedy=("use-video",), photo=b"\0\0\0\x20ftypisom" + bytes(32)),
    "empty file as photo": Wrong({}, code="invalid-image", photo=b"", doors=("command line",)),
    "photo of a few pixels": Wrong({}, code="invalid-image", photo=png(size=(8, 8))),
}


def text_of(value: Any) -> str:
    return ",".join(f"{one:g}" for one in value) if isinstance(value, tuple) else str(value)
