"""Hints: everything that can be given of a photo: its object, its camera, its light.

To add one, describe it in `inputs.schema.json`, and add a field to Hints and its keyword to HintKeywords. Options of
the command line, fields of HTTP forms, the signatures of estimate, Estimator and load_photo, and ComfyUI's nodes follow
from it; `python integrations/write_inputs.py` writes the types of the npm package and the settings of the Blender
extension. docs/how-to/inputs.md explains them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from anyprobe.errors import InputError, InvalidMask
from anyprobe.inputs.description import described
from anyprobe.masks.depth import DepthSource
from anyprobe.masks.prompts import Clicks
from anyprobe.masks.sources import MaskSource
from anyprobe.notices import give, leave_out
from anyprobe.pictures.deep_pixels import RAW_SUFFIXES
from anyprobe.pictures.images import ImageSource
from anyprobe.scatter.materials import Albedo, Material, as_material

NormalsSource = str | os.PathLike[str] | bytes | np.ndarray
SurroundingsSource = ImageSource

SunSource = str | Sequence[float]

SPHERE = "sphere"
"""Value of `normals`: the object is a sphere, whose outline gives its normals."""
PHOTO = "photo"
"""Value of `surroundings`: the photo's own background."""
AUTO, NONE = "auto", "none"
"""Values of `surroundings`: the photo's background unless the object is cut out; and nothing but the object."""

EXIF = "exif"
"""Value of `sun`: by the place, time and compass heading that the photo notes."""
SUN_SIDES = {"ahead": 0.0, "right": 90.0, "behind": 180.0, "left": -90.0}
"""Azimuths to the right of where the camera looks [degrees]."""

PICTURES = (
    *(".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".gif", ".heic", ".heif", ".hif", ".avif", ".jxl"),
    *(".jp2", ".exr", *RAW_SUFFIXES),
)
ARRAYS = (".png", ".tif", ".tiff", ".exr", ".npy")


@dataclass(frozen=True, kw_only=True, slots=True)
class Hints:
    """Optional inputs about the object, the photo's camera and the light; None where nothing is given.

    Attributes:
        mask: picture of the photo's size, white on the object (path, bytes, Pillow image, array), or a function from
            the upright photo [H, W, 3] uint8 to its mask [H, W]. Without mask, click, box or depth to cut, the photo's
            alpha channel is used, else the mask network's proposal.
        click, exclude: x, y in pixels of the photo as shown (upright, square pixels) on the object and beside it, one
            or several.
        box: x0, y0, x1, y1 around the object, likewise.
        depth: depth image of the same view, along the camera's axis; near, far: cut-off distances in its unit, one at
            least; the mask lies between them.
        fov_deg: field of view of the photo's longer side, in degrees; else from EXIF, else 60.
        pitch_deg: camera pitch downwards, in degrees: 0 level, 90 straight down.
        roll_deg: camera roll to the left about its axis, in degrees; needs pitch_deg.
        normals: the object's normal map of the photo's size in the camera's frame, see normals_hint.read_normals;
            or "sphere".
        material: the object's material: a Material, or a name: "chrome", "gold", "plastic", "matte" or a measured one,
            see scatter.materials. Level and colour of the light are fitted to it.
        albedo: linear, one number or three (0.18 for a grey card), of a matte object or of the named material.
        roughness: as in glTF, 0.1 to 1, likewise.
        surroundings: "auto" (default): the photo's ground and background around the object, unless the object is cut
            out; "photo": the same for any photo; "none"; or a panorama in the camera's frame, transparent where
            unknown.
        sun: where the sun stands, if it shines: "left,30" is 30 degrees above the horizon at the camera's left, also
            right, ahead, behind or degrees to the right; a direction x, y, z in the camera's frame; or "exif", by
            the place, time and compass heading that the photo notes, which are read for that alone and not kept.
    Raises:
        InputError: conflicting hints, or a number out of its range, in one line.
    """

    mask: MaskSource | None = None
    click: Clicks | None = None
    exclude: Clicks | None = None
    box: Sequence[float] | None = None
    depth: DepthSource | None = None
    near: float | None = None
    far: float | None = None
    fov_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    normals: NormalsSource | None = None
    material: Material | str | None = None
    albedo: Albedo | None = None
    roughness: float | None = None
    surroundings: SurroundingsSource | None = None
    sun: SunSource | None = None

    def __post_init__(self) -> None:
        given = dict(self.given())
        check_together(list(given))
        for name, value in given.items():
            HINTS[name].check(value)
        if self.roll_deg is not None and self.pitch_deg is None:
            raise InputError("expected a pitch with it, got none", subject="roll_deg", remedy=give("pitch_deg"))
        self.surface()
        if self.sun is not None:
            read_sun(self.sun)

    def given(self) -> Iterator[tuple[str, Any]]:
        """Iterate over names and values of the hints that are given."""
        for name in HINTS:
            value = getattr(self, name)
            if value is not None and not (isinstance(value, (list, tuple)) and not value):
                yield name, value

    def place(self) -> dict[str, Any]:
        """Return the hints about the object's place, as keywords of masks.find_mask."""
        return {name: getattr(self, name) for name, hint in HINTS.items() if hint.about == "place"}

    def surface(self) -> Material | None:
        """Return the object's material from material, albedo and roughness; None where none of them is given."""
        return as_material(self.material, self.albedo, self.roughness)

    def files(self) -> dict[str, Path]:
        """Return the hints that are paths, by name."""
        return {name: value for name, value in self.given() if isinstance(value, Path)}


class HintKeywords(TypedDict, total=False):
    """Keywords of functions that take hints: the fields of Hints."""

    mask: MaskSource | None
    click: Clicks | None
    exclude: Clicks | None
    box: Sequence[float] | None
    depth: DepthSource | None
    near: float | None
    far: float | None
    fov_deg: float | None
    pitch_deg: float | None
    roll_deg: float | None
    normals: NormalsSource | None
    material: Material | str | None
    albedo: Albedo | None
    roughness: float | None
    surroundings: SurroundingsSource | None
    sun: SunSource | None


HINTS = described(Hints, pictures=PICTURES, arrays=ARRAYS, panoramas=(*PICTURES, ".hdr"))
"""Descriptions by the field's name, in the order of Hints."""


def combine(hints: Hints | None, given: Mapping[str, Any]) -> Hints:
    """Merge hints with keywords of the same names; those that are not None win. TypeError for another keyword."""
    unknown = {name: value for name, value in given.items() if name not in HINTS}
    chosen = {name: value for name, value in given.items() if value is not None}
    return replace(Hints() if hints is None else hints, **chosen | unknown)


def read_sun(given: SunSource) -> tuple[float, ...] | None:
    """Return azimuth to the right of where the camera looks and height above the horizon [degrees], or a direction
    [3]; None for EXIF; InputError for what is none of them."""
    if isinstance(given, str) and given == EXIF:
        return None
    parts = given.split(",") if isinstance(given, str) else list(map(str, given))
    try:
        numbers = tuple(SUN_SIDES[part] if part in SUN_SIDES else float(part) for part in parts)
    except (TypeError, ValueError):
        numbers = ()
    is_place = len(numbers) == 2 and abs(numbers[0]) <= 360 and -5 <= numbers[1] <= 90
    if not (is_place or (len(numbers) == 3 and 0 < max(map(abs, numbers)) < np.inf)):
        text = f"expected {', '.join(SUN_SIDES)} or degrees, and a height up to 90, or X,Y,Z, or {EXIF}"
        raise InputError(f"{text}, got {str(given)[:60]!r}; for instance left,30", subject="sun")
    return numbers


def check_together(given: Sequence[str]) -> None:
    """Refuse conflicting combinations of hints.

    Raises:
        InputError: several that give the mask, or one that needs another.
    """
    cut = [name for name in ("near", "far") if name in given]
    ways = [name for name in ("mask", "depth", "box", "click") if name in given]
    if len(ways) > 1 and ways != ["box", "click"]:
        got = "both" if len(ways) == 2 else f"all {len(ways)}"
        raise InputError(f"expected one of them, got {got}", subject=ways)
    if "exclude" in given and ways and ways[0] in ("mask", "depth"):
        both = "exclude", ways[0]
        raise InputError("expected one of them, got both", subject=both, remedy=leave_out(*both))
    if cut and "depth" not in given:
        raise InvalidMask("expected a depth image to cut, got none", subject=cut[0], remedy=give("depth"))
    if "depth" in given and not cut:
        raise InvalidMask("expected a distance to cut at, got none", subject="depth", remedy=give("near", "far"))
