"""Forms of requests: pydantic models made from the descriptions of hints and settings, and what they hold."""

from __future__ import annotations

import asyncio
import re
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import Request, UploadFile
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, create_model

from anyprobe import session
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, InvalidMask
from anyprobe.estimate.poses import parse_poses
from anyprobe.estimate.result import FRAMES, LEVEL
from anyprobe.export.targets import TARGETS
from anyprobe.inputs.description import Hint
from anyprobe.inputs.hints import HINTS, Hints
from anyprobe.serve.limits import MAX_PHOTOS
from anyprobe.session import Shot

TargetName = Literal[tuple(TARGETS)]  # type: ignore[valid-type]  # known at run time
INCLUDED = ("radiance", "stages", "mask")
"""Further contents of the JSON answer."""

_NUMBER = r"-?\d+(\.\d+)?"
_TEXT: dict[str, Any] = {"max_length": 1000}


class Form(BaseModel):
    """A form whose unknown fields are refused, as a mistyped option would otherwise be ignored."""

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


def _pattern(*counts: int) -> str:
    """Return the pattern of so many numbers between commas."""
    return "|".join(f"^{','.join([_NUMBER] * count)}$" for count in counts)


def _hint_type(hint: Hint, several: bool) -> Any:
    kind: Any = Annotated[str, Field(**_TEXT)]
    if hint.suffixes:
        kind = UploadFile | Literal[hint.words] if hint.words else UploadFile  # type: ignore[valid-type]
    elif hint.numbers == (1,):
        kind = Annotated[float, Field(allow_inf_nan=False)]
    elif hint.numbers:
        kind = Annotated[str, Field(json_schema_extra={"pattern": _pattern(*hint.numbers)}, **_TEXT)]
    return list[kind] if hint.repeated or several else kind


def _hint_fields(*about: str, several: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the fields of the hints on these subjects; several: those of which each photo may have its own."""
    chosen = {hint.name: hint for hint in HINTS.values() if hint.about in about}
    kinds = {name: _hint_type(hint, name in several) | None for name, hint in chosen.items()}
    return {name: (kinds[name], Field(None, description=hint.help)) for name, hint in chosen.items()}


_Photos = Annotated[
    list[UploadFile],
    Field(min_length=1, max_length=MAX_PHOTOS, description="The photo, or several of one object, with their poses."),
]

EstimateForm: type[Form] = create_model(
    "EstimateForm",
    __base__=Form,
    photo=(_Photos, ...),
    poses=(
        UploadFile | str | None,
        Field(None, description="transforms.json of nerfstudio: camera to world, found by the photos' names."),
    ),
    include=(
        str | None,
        Field(None, description=f"Any of {', '.join(INCLUDED)}, with commas: carried by the JSON answer besides."),
    ),
    **_hint_fields("place", "camera", "light", several=("mask", "box")),
)
MaskForm: type[Form] = create_model(
    "MaskForm", __base__=Form, photo=(UploadFile, ...), **_hint_fields("place", "camera")
)


class PhotoForm(Form):
    """A photo of any format."""

    photo: UploadFile


class ExportForm(Form):
    """A map, its estimate's JSON, and how it is exported."""

    photo: UploadFile = Field(description="The map: .exr or .hdr.")
    sidecar: UploadFile | None = Field(
        None, description="The JSON that the map's estimate was answered with: how the map lies, its error and origin."
    )
    exposure: float = Field(0.0, ge=-30, le=30, description="Stops; 1 doubles the light.")
    world_from_camera: str | None = Field(
        None,
        json_schema_extra={"pattern": _pattern(2, 3, 9)},
        description="How the camera stood: YAW,ELEVATION[,ROLL] in degrees, turned left, raised (looking down), "
        "rolled; or a rotation, nine numbers row by row; else see frame.",
    )
    frame: Literal[tuple(FRAMES)] = Field(  # type: ignore[valid-type]
        LEVEL,
        description="level: +Y is up in the place, where the sidecar states the camera's pitch; camera: the map's own.",
    )


FORMS: dict[str, type[Form]] = {"/v1/estimate": EstimateForm, "/v1/mask": MaskForm, "/v1/photo": PhotoForm}
"""Forms by address; others are exports."""


def refusal(error: RequestValidationError, address: str) -> InputError:
    """Return the first fault of a form sent to an address, as one line."""
    faults = error.errors()
    first = next((one for one in faults if one["type"] == "literal_error"), faults[0])
    name = next((str(part) for part in first["loc"][1:] if isinstance(part, str)), "")
    got = str(first.get("input"))[:60]
    if first["type"] == "extra_forbidden":
        known = list(FORMS.get(address, ExportForm).model_fields)
        return InputError(f"expected one of {', '.join(known)}, got {name[:60]!r}{did_you_mean(name, known)}")
    if first["type"] == "missing":
        return InputError(f"expected it, got none; send it as a part of a form (curl -F {name}=...)", subject=name)
    if first["type"] == "literal_error" and "expected" in first["ctx"]:
        known = re.findall("'([^']*)'", first["ctx"]["expected"])
        return InputError(f"expected one of {', '.join(known)}, got {got!r}{did_you_mean(got, known)}", subject=name)
    if "UploadFile" in first["msg"]:
        return InputError(f"expected a file, got text; send it as a file part (curl -F {name}=@FILE)", subject=name)
    text = first["msg"][:1].lower() + first["msg"][1:]
    return InputError(f"expected another value ({text}), got {got!r}; see /api/", subject=name)


async def check_once(request: Request, form: Form) -> None:
    """Raise InputError for a field that is sent several times where one is read, or in the address."""
    sent = await request.form()
    for name in type(form).model_fields.keys() & request.query_params.keys():
        raise InputError("expected it in the form, got it in the address; send it as a part of the form", subject=name)
    for name in sent:
        count = len(sent.getlist(name))
        if count > 1 and not isinstance(getattr(form, name), list):
            raise InputError(f"expected one, got {count}; send a request for each", subject=name)


async def photo_sent(form: Any) -> Shot:
    """Return the one photo of a form and its hints."""
    return Shot(source=await form.photo.read(), name=_name(form.photo), hints=await _hints(form))


async def photos_sent(form: Any) -> tuple[list[Shot], np.ndarray | None]:
    """Return the photos of a form with their hints, and world_from_camera [N, 3, 3] of each, None for a single photo.

    Raises:
        InputError: no poses or not theirs, a hint of one photo given with several, or one that cannot be read.
    """
    count, masks, boxes = len(form.photo), form.mask or [], form.box or []
    for name, given in (("mask", masks), ("box", boxes)):
        if len(given) not in (0, count):
            raise InvalidMask(f"expected none or one per photo, got {len(given)} for {count} photos", subject=name)
    single = [hint.name for hint in HINTS.values() if hint.about == "place" and hint.name not in ("mask", "box")]
    unusable = [name for name in (*single, "normals") if getattr(form, name)]
    if count > 1 and unusable:
        text = "expected a mask or a box per photo, got an input for single photos; leave it out"
        raise InputError(text, subject=unusable[0])
    if count > 1 and form.poses is None:
        raise InputError("expected a transforms.json with several photos, got none", subject="poses")
    common = await _hints(form, without=("mask", "box"))
    shots = []
    for k, photo in enumerate(form.photo):
        mask = await masks[k].read() if masks else None
        hints = replace(common, mask=mask, box=HINTS["box"].read(boxes[k]) if boxes else None)
        shots.append(Shot(source=await photo.read(), name=_name(photo), hints=hints))
    if form.poses is None:
        return shots, None
    poses = form.poses.encode() if isinstance(form.poses, str) else await form.poses.read()
    try:
        return await asyncio.to_thread(lambda: session.open(shots, parse_poses(poses, "poses")))
    except InputError as error:
        raise InputError(error, subject="poses") from error


async def _hints(form: Any, without: tuple[str, ...] = ()) -> Hints:
    """Return the hints of a form, files read."""
    values: dict[str, Any] = {}
    for keyword, hint in HINTS.items():
        value = None if keyword in without else getattr(form, hint.name, None)
        if value is None:
            continue
        if hasattr(value, "read"):
            values[keyword] = await value.read()
        else:
            values[keyword] = hint.read_word(value) if hint.suffixes else hint.read(value)
    return Hints(**values)


def included(form: Any) -> frozenset[str]:
    """Return the further contents that the JSON answer is asked for."""
    parts = {word.strip() for word in (form.include or "").split(",")} - {""}
    if unknown := parts - set(INCLUDED):
        text = f"expected any of {', '.join(INCLUDED)}, got {', '.join(sorted(unknown))[:60]!r}"
        raise InputError(text, subject="include")
    return frozenset(parts)


def _name(part: UploadFile) -> str:
    """Return a file's name without folders, for messages."""
    name = PurePosixPath((part.filename or "").replace("\\", "/")).name
    return "".join(c for c in name if c.isprintable())[:120] or "photo"
