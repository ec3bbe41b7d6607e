"""Hints: optional inputs about the object of a photo, about the photo's camera and about the light.

To add one, add a field to Hints and the keyword to estimate, Estimator.__call__ and load_photo. The options of the
command line, the form and query fields of HTTP and their descriptions are derived from the fields;
docs/how-to/inputs.md explains them.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from pathlib import Path
from typing import Any, Literal

import numpy as np

from anyprobe.core.arrays import plain_array
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, InvalidMask, InvalidPhoto
from anyprobe.given_material import Albedo, as_material
from anyprobe.masks.depth import DepthSource
from anyprobe.masks.prompts import Clicks
from anyprobe.masks.sources import MaskSource
from anyprobe.notices import give, leave_out
from anyprobe.pictures.images import ImageSource
from anyprobe.pictures.raw import RAW_SUFFIXES
from anyprobe.scatter.materials import Material

NormalsSource = str | os.PathLike[str] | bytes | np.ndarray
SurroundingsSource = ImageSource

SPHERE = "sphere"
"""Value of `normals`: the object is a sphere, whose outline gives its normals."""
PHOTO = "photo"
"""Value of `surroundings`: the photo's own background."""
AUTO, NONE = "auto", "none"
"""Values of `surroundings`: the photo's background unless the object is cut out; and nothing but the object."""

PICTURES = (
    *(".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".gif", ".heic", ".heif", ".hif", ".avif", ".jxl"),
    *(".jp2", ".exr", *RAW_SUFFIXES),
)
ARRAYS = (".png", ".tif", ".tiff", ".exr", ".npy")

MAX_NUMBER = 1e6
"""Upper bound of numbers parsed from text."""

About = Literal["place", "camera", "light"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Hint:
    """Name and parser of one hint where it comes as text or as a file.

    Attributes:
        about: "place", the object's place; "camera"; or "light", used by the estimate only.
        help: one line for users.
        keyword: the field's name, Python's keyword.
        name: its option, form field and query parameter; "": the field's name.
        metavar: format of its text.
        numbers: allowed counts of comma-separated numbers in its text; none: it is a word or a file.
        repeated: whether it may be given several times.
        example: a valid text.
        words: keywords accepted in place of a file.
        suffixes: of its file, where folders hold one a photo; none: it is no file.
        in_web: option of the JavaScript package that takes it; "" where there is none.
    """

    about: About
    help: str
    keyword: str = ""
    name: str = ""
    metavar: str | None = None
    numbers: tuple[int, ...] = ()
    repeated: bool = False
    example: str = ""
    words: tuple[str, ...] = ()
    suffixes: tuple[str, ...] = ()
    in_web: str = ""

    def read(self, text: str) -> Any:
        """Parse a text: a number, numbers, or the text itself.

        Raises:
            InputError: wrong numbers.
        """
        if not self.numbers:
            return text
        found = numbers_in(text, *self.numbers)
        if not found:
            example = f"; for instance {self.example}" if self.example else ""
            raise InputError(f"expected {self._form()}, got {text[:60]!r}{example}", subject=self.keyword)
        return found[0] if self.numbers == (1,) else found

    def _form(self) -> str:
        forms = ["a number"] if 1 in self.numbers else []
        forms += [self.metavar or ""] if self.numbers != (1,) else []
        return " or ".join(forms) + (" in pixels" if self.metavar and self.about == "place" else "")

    def read_word(self, text: str) -> str:
        """Check for one of the words accepted in place of a file; InputError for another."""
        if text not in self.words:
            raise InputError(
                f"expected {' or '.join(('a file part', *self.words))}, got {text[:60]!r}"
                f"{did_you_mean(text, self.words)}",
                subject=self.keyword,
            )
        return text

    def read_path(self, text: str) -> str | Path:
        """Return one of the words, or a file's path."""
        return text if text in self.words else Path(text)


def numbers_in(text: str, *counts: int) -> tuple[float, ...]:
    """Return the numbers below MAX_NUMBER between a text's commas; none unless there are as many as one of `counts`."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return found if len(found) in counts and all(abs(one) < MAX_NUMBER for one in found) else ()  # NaN fails too


def _hint(about: About, help: str, **more: Any) -> Any:
    return field(default=None, metadata={"hint": Hint(about=about, help=help, **more)})


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
    Raises:
        InputError: conflicting hints, or a number out of its range, in one line.
    """

    mask: MaskSource | None = _hint("place", "Mask image, white on the object.", suffixes=PICTURES, in_web="mask")
    click: Clicks | None = _hint(
        "place",
        "A point on the object, in pixels of the photo as shown (upright, square pixels); repeatable.",
        metavar="X,Y",
        numbers=(2,),
        repeated=True,
        example="120,90",
        in_web="click",
    )
    exclude: Clicks | None = _hint(
        "place",
        "A point that is not on the object, in pixels as the click; repeatable.",
        metavar="X,Y",
        numbers=(2,),
        repeated=True,
        example="20,90",
        in_web="exclude",
    )
    box: Sequence[float] | None = _hint(
        "place",
        "Box around the object, in pixels of the photo as shown (upright, square pixels).",
        metavar="X0,Y0,X1,Y1",
        numbers=(4,),
        example="40,30,220,260",
        in_web="box",
    )
    depth: DepthSource | None = _hint(
        "place", "Depth image of the same view: the mask lies between near and far.", suffixes=ARRAYS
    )
    near: float | None = _hint("place", "Near clipping depth, in the depth image's own unit (often mm).", numbers=(1,))
    far: float | None = _hint("place", "Far clipping depth, in the same unit.", numbers=(1,))
    fov_deg: float | None = _hint(
        "camera",
        "Field of view of the photo's longer side, degrees; default: EXIF, else 60.",
        name="fov",
        numbers=(1,),
        in_web="longFovDeg",
    )
    pitch_deg: float | None = _hint(
        "camera",
        "How far the camera looks down, degrees: 0 level, 90 straight down.",
        name="pitch",
        numbers=(1,),
        in_web="pitchDeg",
    )
    roll_deg: float | None = _hint(
        "camera",
        "How far the camera is turned to the left about its axis, degrees, beside its pitch.",
        name="roll",
        numbers=(1,),
    )
    normals: NormalsSource | None = _hint(
        "light",
        "The object's normal map: (n + 1) / 2 in a picture of the photo's size; +X right, +Y up, +Z toward the camera; "
        "or sphere, if the object is one.",
        words=(SPHERE,),
        suffixes=ARRAYS,
        in_web="normals",
    )
    material: Material | str | None = _hint(
        "light",
        "The object's material: chrome, gold, plastic, matte (albedo 0.3) or a measured one (anyprobe materials).",
        metavar="NAME",
        in_web="material",
    )
    albedo: Albedo | None = _hint(
        "light",
        "Its linear diffuse albedo, or one number: 0.18 for a grey card.",
        metavar="R,G,B",
        numbers=(1, 3),
        example="0.18",
        in_web="material",
    )
    roughness: float | None = _hint(
        "light", "Its roughness as in glTF, 0.1 to 1: the square root of GGX alpha.", numbers=(1,), in_web="material"
    )
    surroundings: SurroundingsSource | None = _hint(
        "light",
        "Surroundings: auto (default) uses the photo around the object, unless that is cut out; photo uses it in any "
        "case; none; or a panorama in the camera's frame, transparent where unknown.",
        words=(AUTO, PHOTO, NONE),
        suffixes=(*PICTURES, ".hdr"),
        in_web="surroundings",
    )

    def __post_init__(self) -> None:
        check_together([name for name, _ in self.given()])
        for name in ("near", "far", "fov_deg", "pitch_deg", "roll_deg", "roughness"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, Real):
                raise InputError(f"expected a number, got {type(value).__name__} {str(value)[:40]!r}", subject=name)
        for name in ("mask", "depth", "normals", "surroundings"):
            value = getattr(self, name)
            is_number, is_file = isinstance(value, Real), isinstance(value, os.PathLike | str | bytes | np.ndarray)
            if is_number or not (value is None or is_file or name in ("mask", "surroundings")):
                got = f"the number {value}" if is_number else type(value).__name__
                raise InputError(f"expected a file, its bytes, a picture or an array, got {got}", subject=name)
            if isinstance(value, np.ma.MaskedArray):
                plain_array(value, name, subject=name)
        if self.fov_deg is not None and not 1.0 < self.fov_deg < 170.0:
            raise InvalidPhoto(
                "expected a field of view of more than 1 and less than 170 degrees along the longer side, "
                f"got {self.fov_deg:g}",
                code="invalid-option",
                subject="fov_deg",
            )
        if self.pitch_deg is not None and not -90.0 <= self.pitch_deg <= 90.0:
            raise InputError(
                f"expected -90 to 90 degrees that the camera looks down, got {self.pitch_deg:g}", subject="pitch_deg"
            )
        if self.roll_deg is not None and self.pitch_deg is None:
            raise InputError("expected a pitch with it, got none", subject="roll_deg", remedy=give("pitch_deg"))
        if self.roll_deg is not None and not -60.0 <= self.roll_deg <= 60.0:
            raise InputError(
                f"expected -60 to 60 degrees, got {self.roll_deg:g}; turn the photo upright first", subject="roll_deg"
            )
        self.surface()

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


def _named(name: str, hint: Hint) -> Hint:
    return replace(hint, keyword=name, name=hint.name or name)


HINTS: dict[str, Hint] = {one.name: _named(one.name, one.metadata["hint"]) for one in fields(Hints)}
"""Descriptions by the field's name, in the order of Hints."""


def combine(hints: Hints | None, arguments: Mapping[str, Any]) -> Hints:
    """Merge hints with a function's arguments, its locals(), of the same names; those that are not None win."""
    given = {name: arguments[name] for name in HINTS if arguments[name] is not None}
    return replace(Hints() if hints is None else hints, **given)


def check_keywords(unknown: Mapping[str, Any], function: Callable[..., Any]) -> None:
    """Refuse keywords that a function does not have.

    Raises:
        TypeError: names the parameter most similar to the first, by its name in Python or at another door.
    """
    for name in unknown:
        known = [one.name for one in inspect.signature(function).parameters.values() if one.kind != one.VAR_KEYWORD]
        alike = [own for own, hint in HINTS.items() if hint.name == name and own in known]
        advice = did_you_mean(alike[0] if alike else name, alike or known) or f"; it has {', '.join(known)}"
        raise TypeError(f"{function.__qualname__}() has no keyword {name}{advice}")


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
