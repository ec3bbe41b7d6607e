"""Error answers: problem details of RFC 9457, with the notice's code, and its arguments as form fields."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from starlette.responses import JSONResponse

from anyprobe.inputs.hints import HINTS
from anyprobe.notices import Notice, Words

MEDIA_TYPE = "application/problem+json"

_NAMES = {"type": "array", "items": {"type": "string"}}
_REMEDY = {"do": {"enum": ["give", "leave out", "run"]}, "name": {"type": "string"}, "value": {"type": "string"}}
SCHEMA = {
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
    return JSONResponse(body, status, dict(headers or {}), media_type=MEDIA_TYPE)


def notice_json(notice: Notice) -> dict[str, Any]:
    """Return a notice as data that names form fields."""
    return notice.naming({name: FIELDS.name(name) for name in HINTS}).as_json()
