"""Responses: a light as JSON or as a map in the requested format, and errors as problem details (RFC 9457)."""

import base64
import tempfile
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

import numpy as np
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from anyprobe import session
from anyprobe.core.color import to_bytes
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.result import Light
from anyprobe.inputs.hints import HINTS
from anyprobe.masks.check import object_box
from anyprobe.notices import Notice, Words
from anyprobe.pictures.images import png_bytes

JSON = "application/json"

LIGHT_TYPES = {JSON: "json", "image/x-exr": "exr", "image/aces": "exr", "image/vnd.radiance": "hdr", "image/png": "png"}
"""Media types that a light is available in, best first, with the suffix that each is written under."""

MASK_TYPES = {"image/png": "png", JSON: "json"}


PROBLEM = "application/problem+json"

_NAMES = {"type": "array", "items": {"type": "string"}}
_REMEDY = {"do": {"enum": ["give", "leave out", "run"]}, "name": {"type": "string"}, "value": {"type": "string"}}
PROBLEM_SCHEMA = {
    "type": "object",
    "properties": {
        **{name: {"type": "string"} for name in ("type", "title", "detail", "code", "text")},
        "status": {"type": "integer"},
        "subject": {**_NAMES, "description": "fields that the error is about"},
        "remedy": {"type": "array", "items": {"type": "object", "properties": _REMEDY}},
    },
    "required": ["type", "title", "status", "detail", "code"],
}
"""JSON schema of an error's answer."""


def choose_type(request: Request, types: dict[str, str]) -> str:
    """Return the media type of the answer: the one of ?format=, else the best that Accept allows.

    Raises:
        HTTPException: 406, none of those can be had.
    """
    if (suffix := request.query_params.get("format")) is not None:
        ranked = [media for media, kind in types.items() if kind == suffix]
    else:
        ranked = _accepted(request.headers.get("accept", "*/*"), list(types))
    if not ranked:
        suffixes = "|".join(dict.fromkeys(types.values()))  # one may stand for two types
        raise HTTPException(406, f"expected Accept to name one of {', '.join(types)}, or format={suffixes}")
    return ranked[0]


def light_response(light: Light, media: str, include: frozenset[str], mask: bytes | None) -> Response:
    """Return a light as JSON with the requested parts, or as a picture file."""
    if media != JSON:
        with tempfile.TemporaryDirectory() as folder:  # the writers of .exr know files only
            kind = LIGHT_TYPES[media]
            data = session.deliver(light, Path(folder), "light", [kind])[kind].read_bytes()
        return Response(data, media_type=media)
    return JSONResponse(light_json(light, include, mask))


def light_json(light: Light, include: frozenset[str], mask: bytes | None) -> dict[str, Any]:
    """Return the sidecar, and arrays as {shape, dtype, base64}: little-endian float32, row by row; mask: as PNG."""
    answer = light.sidecar() | _warnings(light.warnings)
    if "radiance" in include:
        answer["radiance"] = packed(light.radiance)
    if "stages" in include:
        answer["stages"] = {name: packed(values) for name, values in light.stages.items()}
    if "mask" in include and mask is not None:
        picture = base64.b64encode(mask).decode("ascii")
        answer["mask"] = {**answer.get("mask", {}), "media_type": "image/png", "base64": picture}
    return answer


def packed(values: np.ndarray) -> dict[str, Any]:
    """Return an array as data for JSON."""
    data = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"shape": list(values.shape), "dtype": "float32", "base64": base64.b64encode(data).decode("ascii")}


def mask_json(photo: Photo) -> dict[str, Any]:
    """Return where the object is, how it was found, and the IoU that the network expects, None if it was not asked."""
    confidence = photo.mask_confidence
    return {
        "photo": photo.name,
        "size": [photo.mask.shape[1], photo.mask.shape[0]],
        "box": list(object_box(photo.mask)),
        "share": round(float(photo.mask.mean()), 6),
        "source": photo.mask_source,
        "confidence": None if confidence is None else round(confidence, 4),
        **_warnings(photo.warnings),
    }


def _warnings(notices: tuple[Notice, ...]) -> dict[str, Any]:
    """Return warnings as lines and as data, in the words of form fields."""
    return {"warnings": [FIELDS.line(one) for one in notices], "notices": [notice_json(one) for one in notices]}


def mask_png(mask: np.ndarray) -> bytes:
    """Return a mask [H, W] as a grey PNG."""
    return png_bytes(to_bytes(mask), compress_level=3)


def _accepted(header: str, known: list[str]) -> list[str]:
    """Return the known media types that an Accept header allows, by its q and then in our order."""
    weights: dict[str, float] = {}
    for part in header.split(","):
        media, *parameters = (piece.strip() for piece in part.lower().split(";"))
        quality = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        try:
            weights[media] = float(quality)
        except ValueError:
            weights[media] = 0.0

    def weight(media: str) -> float:
        return next((weights[kind] for kind in (media, f"{media.split('/')[0]}/*", "*/*") if kind in weights), 0.0)

    return sorted((media for media in known if weight(media) > 0), key=weight, reverse=True)


class FormWords(Words):
    """Arguments as form fields and query parameters."""

    verb = "send"

    def name(self, argument: str) -> str:
        """Return the field of a hint or setting."""
        return HINTS[argument].name if argument in HINTS else argument

    def giving(self, argument: str, value: str) -> str:
        """Return the field and its value."""
        return f"{self.name(argument)} {value}".strip()


FIELDS = FormWords()


def problem(status: int, notice: str, headers: Mapping[str, str] | None = None) -> JSONResponse:
    """Return an error as an answer; a plain line gets its status as its code ("not-found")."""
    title = HTTPStatus(status).phrase
    code = notice.code if isinstance(notice, Notice) else title.lower().replace(" ", "-")
    body = {"type": "about:blank", "title": title, "status": status, "detail": FIELDS.line(notice), "code": code}
    if isinstance(notice, Notice):
        data = notice_json(notice)
        body |= {name: data[name] for name in ("text", "subject", "remedy") if data[name]}
    return JSONResponse(body, status, dict(headers or {}), media_type=PROBLEM)


def notice_json(notice: Notice) -> dict[str, Any]:
    """Return a notice as data that names form fields."""
    return notice.naming({name: FIELDS.name(name) for name in HINTS}).as_json()
