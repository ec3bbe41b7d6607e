"""OpenAPI of requests that are parsed by hand: bodies, forms, options, errors.

Form models of FastAPI would read the whole body before an endpoint can hold its place, time it or bound its parts.
"""

from __future__ import annotations

import json
from dataclasses import fields
from importlib import resources
from typing import Any

from anyprobe.estimate.result import FRAMES
from anyprobe.estimate.settings import CHOICES, Settings
from anyprobe.hints import HINTS, Hint
from anyprobe.serve.limits import MAX_PHOTOS

FORM = "multipart/form-data"

_FILE = {"type": "string", "format": "binary"}


Schemas = dict[str, dict[str, Any]]


def _texts(*about: str) -> Schemas:
    """Return the schemas of text fields for the hints on these subjects; for a file, of the words allowed in its
    place."""
    hints = [hint for hint in HINTS.values() if hint.about in about]
    return {hint.name: _text_schema(hint) for hint in hints if hint.words or not hint.suffixes}


def _files(*about: str) -> Schemas:
    """Return the schemas of file parts for the hints on these subjects."""
    hints = [hint for hint in HINTS.values() if hint.about in about and hint.suffixes]
    return {hint.name: _described(_file_schema(hint), hint.help) for hint in hints}


def _text_schema(hint: Hint) -> dict[str, Any]:
    schema: dict[str, Any] = {"type": "string"}
    if hint.words:
        schema = {"type": "string", "enum": list(hint.words)}
    elif hint.numbers:
        kinds = [_numbers_schema(count) for count in hint.numbers]
        schema = kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    return _described({"type": "array", "items": schema} if hint.repeated else schema, hint.help)


def _file_schema(hint: Hint) -> dict[str, Any]:
    return {"anyOf": [_FILE, {"type": "string", "enum": list(hint.words)}]} if hint.words else _FILE


def _numbers_schema(count: int) -> dict[str, Any]:
    """Return the schema of one number, or of several separated by commas."""
    number = r"-?\d+(\.\d+)?"
    return {"type": "number"} if count == 1 else {"type": "string", "pattern": f"^{','.join([number] * count)}$"}


def _described(schema: dict[str, Any], text: str) -> dict[str, Any]:
    return {**schema, "description": text}


def _choice(name: str) -> dict[str, Any]:
    """Return the schema of a setting, one of its choices."""
    kind = "integer" if isinstance(CHOICES[name][0], int) else "string"
    text = next(setting.metadata["help"] for setting in fields(Settings) if setting.name == name)
    return _described({"type": kind, "enum": list(CHOICES[name])}, text)


_EXPORT = {
    "exposure": _described({"type": "number", "minimum": -30, "maximum": 30}, "stops; 1 doubles the light"),
    "world_from_camera": _described(
        {"anyOf": [_numbers_schema(count) for count in (2, 3, 9)]},
        "how the camera stood: YAW,ELEVATION[,ROLL] in degrees, turned left, raised (looking down), "
        "rolled; or a rotation, nine numbers row by row; else see frame",
    ),
    "frame": _described(
        {"type": "string", "enum": list(FRAMES)},
        "level (default): +Y is up in the place, where the sidecar states the camera's pitch; camera: the map's own",
    ),
}

_ANSWER = {
    **{name: _choice(name) for name in ("emitters", "looks")},
    "include": _described(
        {"type": "string"}, "any of radiance, stages, mask, with commas: carried by the JSON answer besides"
    ),
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
"""Schema of problem details (RFC 9457), see serve.problems."""


def _error(text: str) -> dict[str, Any]:
    return {"description": text, "content": {"application/problem+json": {"schema": _PROBLEM}}}


_GUARD_ERRORS = {
    "400": _error("the server does not go by this host name, or the form is malformed"),
    "401": _error("the server asks for its token: Authorization: Bearer TOKEN"),
    "500": _error("the server failed; see its log"),
}

_ERRORS = _GUARD_ERRORS | {
    "403": _error("sent by a page of another origin; start the server with --allow-origin ORIGIN"),
    "406": _error("Accept names no media type of this answer"),
    "408": _error("the body took too long"),
    "413": _error("too many bytes or pixels"),
    "422": _error("the photo, the mask or an option cannot be used; see detail"),
    "429": _error("all places are taken; retry after the seconds of Retry-After"),
    "501": _error("the server lacks an optional package for this"),
}


def _upload(options: Schemas, formats: list[str], answer: dict[str, Any], files: Schemas) -> dict[str, Any]:
    form = {"schema": {"type": "object", "required": ["photo"], "properties": {"photo": _FILE, **options, **files}}}
    errors = {status: text for status, text in _ERRORS.items() if formats or status != "406"}
    extra = {"format": _described({"type": "string", "enum": formats}, "instead of Accept")} if formats else {}
    return {
        "parameters": [
            {"in": "query", "name": name, "schema": schema, "description": schema["description"]}
            for name, schema in (options | extra).items()
        ],
        "requestBody": {"required": True, "content": {FORM: form, "image/*": {"schema": _FILE}}},
        "responses": {"200": {"description": "done", "content": answer}, **errors},
    }


_SIDECAR = json.loads((resources.files("anyprobe") / "estimate" / "sidecar.schema.json").read_text(encoding="utf-8"))
_LIGHT: dict[str, Any] = {"schema": {key: part for key, part in _SIDECAR.items() if key != "$schema"}}
_NUMBER = {"type": "number"}
_FOUND_MASK: dict[str, Any] = {
    "schema": {
        "type": "object",
        "properties": {
            **{name: {"type": "string"} for name in ("photo", "source")},
            **{name: {"type": "array", "items": {"type": "integer"}} for name in ("size", "box")},
            "share": _NUMBER,
            "confidence": {"anyOf": [_NUMBER, {"type": "null"}]},
            **{name: _SIDECAR["properties"][name] for name in ("warnings", "notices")},
        },
    }
}
_BYTES = {"schema": _FILE}

ESTIMATE_ROUTE = _upload(
    _texts("place", "camera", "light") | _ANSWER,
    ["json", "exr", "hdr", "png"],
    {"application/json": _LIGHT, "image/x-exr": _BYTES, "image/vnd.radiance": _BYTES, "image/png": _BYTES},
    files=_files("place", "light"),
)


def _multiview() -> dict[str, Any]:
    """Return the route of several photos in a form, with the answers of ESTIMATE_ROUTE."""
    texts = {**_texts("camera", "light"), **_ANSWER}
    poses = "transforms.json of nerfstudio: camera to world, found by the photos' names"
    parts: Schemas = {
        "photo": {"type": "array", "items": _FILE, "description": f"1 to {MAX_PHOTOS} photos of one object"},
        "poses": {**_FILE, "description": poses},
        "mask": {"type": "array", "items": _FILE, "description": "none, or one a photo in their order"},
        "box": {"type": "array", "items": _numbers_schema(4), "description": "none, or one a photo"},
        **texts,
    }
    form = {"schema": {"type": "object", "required": ["photo", "poses"], "properties": parts}}
    return {
        "parameters": [one for one in ESTIMATE_ROUTE["parameters"] if one["name"] in (*parts, "format")],
        "requestBody": {"required": True, "content": {FORM: form}},
        "responses": ESTIMATE_ROUTE["responses"],
    }


FUSE_ROUTE = _multiview()
TARGETS_ROUTE = {"responses": _GUARD_ERRORS}
HEALTH = {"responses": {status: text for status, text in _GUARD_ERRORS.items() if status != "401"}}
READY = {"responses": HEALTH["responses"] | {"503": _error("starting, shutting down, or all places are taken")}}
METRICS_ROUTE = {
    "responses": _GUARD_ERRORS
    | {"200": {"description": "Prometheus text", "content": {"text/plain": {"schema": {"type": "string"}}}}}
    | {"501": _error("prometheus-client is not installed")}
}
MASK_ROUTE = _upload(
    _texts("place", "camera"),
    ["png", "json"],
    {"image/png": _BYTES, "application/json": _FOUND_MASK},
    files=_files("place"),
)
PHOTO_ROUTE = _upload({}, [], {"image/png": _BYTES}, files={})
_SAID = "the JSON that the map's estimate was answered with: how the map lies, its error and origin"
EXPORT_ROUTE = _upload(_EXPORT, [], {"application/zip": _BYTES}, files={"sidecar": _described(_FILE, _SAID)})


def form_names(address: dict[str, Any]) -> list[str]:
    """Return the names of a route's form parts."""
    return list(address["requestBody"]["content"][FORM]["schema"]["properties"])


def query_names(address: dict[str, Any]) -> list[str]:
    """Return the names of a route's query parameters."""
    return [one["name"] for one in address["parameters"]]
