"""What the OpenAPI page says of requests that are read by hand: bodies, forms, options, errors.

Form models of FastAPI would read the whole body before an endpoint can hold its place, time it or bound its parts.
"""

from __future__ import annotations

from typing import Any

from anyprobe.hints import HINTS
from anyprobe.serve.limits import MAX_PHOTOS

FORM = "multipart/form-data"

_FILE = {"type": "string", "format": "binary"}


def _texts(*about: str) -> dict[str, str]:
    """Hints about these that come as text, and their lines; of a file that has none, the word in its place."""
    found = [hint for hint in HINTS.values() if hint.about in about]
    return {hint.name: hint.help for hint in found if hint.words or not hint.suffixes}


def _files(*about: str) -> dict[str, str]:
    """Hints about these that come as file parts."""
    found = [hint for hint in HINTS.values() if hint.about in about]
    return {hint.name: hint.help for hint in found if hint.suffixes}


_EXPORT = {
    "exposure": "stops, -30 to 30; 1 doubles the light",
    "world_from_camera": "how the camera stood: YAW,ELEVATION[,ROLL] in degrees, turned left, raised (looking down), "
    "rolled; or a rotation, nine numbers row by row; else the export is in the camera's frame",
}

_ANSWER = {
    "emitters": "mode, light sources at their most likely places, sharp, for shadows and highlights; or expected, the "
    "mean radiance, soft, which lights dull objects better",
    "include": "any of radiance, stages, mask, with commas: carried by the JSON answer besides",
}


_DETAIL = {
    "detail": "none, or plausible: the structure of a real-looking place under the estimated light, for mirrors",
    "size": "rows of a map with detail: 64, 128, 256 or 512, which is the default",
}


_NAMES = {"type": "array", "items": {"type": "string"}}
_REMEDY = {"do": {"enum": ["give", "leave out", "run"]}, "name": {"type": "string"}, "value": {"type": "string"}}
_PROBLEM = {
    "type": "object",
    "properties": {
        **{name: {"type": "string"} for name in ("type", "title", "detail", "code", "text")},
        "status": {"type": "integer"},
        "subject": {**_NAMES, "description": "fields that the error is about"},
        "remedy": {"type": "array", "items": {"type": "object", "properties": _REMEDY}},
    },
    "required": ["type", "title", "status", "detail", "code"],
}
"""Problem details of RFC 9457, see serve.problems."""


def _error(text: str) -> dict[str, Any]:
    return {"description": text, "content": {"application/problem+json": {"schema": _PROBLEM}}}


_AT_THE_DOOR = {
    "400": _error("the server does not go by this host name, or the form is malformed"),
    "401": _error("the server asks for its token: Authorization: Bearer TOKEN"),
    "500": _error("the server failed; its log says more"),
}

_ERRORS = _AT_THE_DOOR | {
    "403": _error("a page of another origin asks; start the server with --allow-origin ORIGIN"),
    "406": _error("Accept names nothing this can be sent as"),
    "408": _error("the body took too long"),
    "413": _error("too many bytes or pixels"),
    "422": _error("the photo, the mask or an option cannot be used; the line says why"),
    "429": _error("all places are taken; Retry-After says for how many seconds"),
    "501": _error("the server lacks an optional package for this"),
}


def _upload(
    options: dict[str, str], formats: list[str], answer: dict[str, Any], files: dict[str, str]
) -> dict[str, Any]:
    fields: dict[str, Any] = {"photo": _FILE}
    fields |= {name: {"type": "string", "description": text} for name, text in options.items()}
    fields |= {name: {**_FILE, "description": text} for name, text in files.items()}
    form = {"schema": {"type": "object", "required": ["photo"], "properties": fields}}
    errors = {status: text for status, text in _ERRORS.items() if formats or status != "406"}
    extra = {"format": f"{' or '.join(formats)}; instead of Accept"} if formats else {}
    return {
        "parameters": [
            {"in": "query", "name": name, "schema": {"type": "string"}, "description": text}
            for name, text in (options | extra).items()
        ],
        "requestBody": {"required": True, "content": {FORM: form, "image/*": {"schema": _FILE}}},
        "responses": {"200": {"description": "done", "content": answer}, **errors},
    }


_ANY: dict[str, Any] = {"schema": {"type": "object"}}
_BYTES = {"schema": _FILE}

ESTIMATE_ROUTE = _upload(
    _texts("place", "camera", "light") | _ANSWER | _DETAIL,
    ["json", "exr", "hdr", "png"],
    {"application/json": _ANY, "image/x-exr": _BYTES, "image/vnd.radiance": _BYTES, "image/png": _BYTES},
    files=_files("place", "light"),
)


def _multiview() -> dict[str, Any]:
    """As ESTIMATE_ROUTE, of several photos in a form."""
    texts = {**_texts("camera", "light"), **_ANSWER, **_DETAIL}
    poses = "JSON: camera to world, a list of matrices, or transforms.json"
    fields: dict[str, Any] = {
        "photo": {"type": "array", "items": _FILE, "description": f"1 to {MAX_PHOTOS} photos of one object"},
        "poses": {**_FILE, "description": poses},
        "mask": {"type": "array", "items": _FILE, "description": "none, or one a photo in their order"},
        "box": {"type": "array", "items": {"type": "string"}, "description": "none, or one a photo"},
    }
    fields |= {name: {"type": "string", "description": text} for name, text in texts.items()}
    form = {"schema": {"type": "object", "required": ["photo", "poses"], "properties": fields}}
    return {
        "parameters": [one for one in ESTIMATE_ROUTE["parameters"] if one["name"] in (*fields, "format")],
        "requestBody": {"required": True, "content": {FORM: form}},
        "responses": ESTIMATE_ROUTE["responses"],
    }


FUSE_ROUTE = _multiview()
TARGETS_ROUTE = {"responses": _AT_THE_DOOR}
HEALTH = {"responses": {status: text for status, text in _AT_THE_DOOR.items() if status != "401"}}
MASK_ROUTE = _upload(
    _texts("place", "camera"), ["png", "json"], {"image/png": _BYTES, "application/json": _ANY}, files=_files("place")
)
PHOTO_ROUTE = _upload({}, [], {"image/png": _BYTES}, files={})
DETAIL_ROUTE = _upload(
    {"size": _DETAIL["size"]},
    ["json", "exr", "hdr", "png"],
    ESTIMATE_ROUTE["responses"]["200"]["content"],
    files={"confidence": "map of the same size: how much each direction counts, 0 to 1"},
)
EXPORT_ROUTE = _upload(_EXPORT, [], {"application/zip": _BYTES}, files={})


def form_names(address: dict[str, Any]) -> list[str]:
    """The parts that an address reads in a form."""
    return list(address["requestBody"]["content"][FORM]["schema"]["properties"])


def query_names(address: dict[str, Any]) -> list[str]:
    """What it reads behind the question mark."""
    return [one["name"] for one in address["parameters"]]
