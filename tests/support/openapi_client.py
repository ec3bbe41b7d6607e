"""A small client made from an OpenAPI document: it knows of a server what that document says, and nothing else."""

from __future__ import annotations

from typing import Any


class OpenApiClient:
    """Calls operations by address and method, and checks that each answer is one that is described."""

    def __init__(self, http: Any) -> None:
        self._http, self._document = http, http.get("/openapi.json").json()

    @property
    def operations(self) -> list[tuple[str, str]]:
        """Address and method of all operations."""
        return [(address, method) for address, methods in self._document["paths"].items() for method in methods]

    def form(self, address: str) -> dict[str, Any]:
        """Return the fields of an address's form."""
        content = self._document["paths"][address]["post"]["requestBody"]["content"]
        assert list(content) == ["multipart/form-data"]
        return self._resolved(content["multipart/form-data"]["schema"])["properties"]

    def choices(self, address: str, name: str) -> list[str]:
        """Return the values that a parameter in the address may have."""
        (operation,) = self._document["paths"][address].values()
        return next(one["schema"]["enum"] for one in operation["parameters"] if one["name"] == name)

    def call(self, address: str, method: str, place: dict[str, str] | None = None, **fields: Any) -> Any:
        """Call an operation: bytes are sent as files, other values as texts. Returns the answer, which is checked."""
        known = self.form(address) if method == "post" else {}
        assert set(fields) <= set(known)
        files = [(name, (f"{name}.bin", value)) for name, value in fields.items() if isinstance(value, bytes)]
        texts = {name: value for name, value in fields.items() if not isinstance(value, bytes)}
        sent = {"files": files, "data": texts} if method == "post" else {}
        answer = getattr(self._http, method)(address.format(**place or {}), **sent)
        described = self._document["paths"][address][method]["responses"]
        assert str(answer.status_code) in described, (address, answer.status_code, answer.text)
        media = answer.headers["content-type"].split(";")[0]
        assert media in described[str(answer.status_code)]["content"], (address, media)
        return answer

    def _resolved(self, schema: dict[str, Any]) -> dict[str, Any]:
        for name in schema.get("$ref", "").split("/")[1:]:
            schema = self._document if schema.get("$ref") else schema
            schema = schema[name]
        return schema
