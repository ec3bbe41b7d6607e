"""MkDocs hook: the page reference/http.md, from the server's OpenAPI description."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

from mkdocs.structure.files import File, Files

PAGE = "reference/http.md"
HEAD = """# HTTP API

`anyprobe serve` answers these addresses. Requests are forms (`multipart/form-data`); only `format` is in the address.
A running server has the same reference at `/api/` and its OpenAPI document at `/openapi.json`.
[Server](../how-to/serve.md) shows how to start it and how to call it.
"""


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, PAGE, content="\n".join(page(described()))))
    return files


def described() -> dict[str, Any]:
    """Return the OpenAPI document of a server; no network is opened for it."""
    from anyprobe.serve.api import create_app

    return create_app(SimpleNamespace(model_id="")).openapi()  # type: ignore[arg-type]


def page(document: dict[str, Any]) -> Iterator[str]:
    """Yield the page's lines: per address its fields and its answers."""
    yield HEAD
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield f"## `{method.upper()} {path}`\n"
            yield f"{operation.get('description') or operation.get('summary', '')}\n"
            yield from table(("field", "form", "query", "type", "meaning"), fields(operation, document))
            yield from table(("status", "content", "meaning"), answers(operation, document))


def fields(operation: dict[str, Any], document: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each form part, query parameter and path parameter."""
    content = operation.get("requestBody", {}).get("content", {})
    form = resolved(content.get("multipart/form-data", {}).get("schema", {}), document)
    parts = form.get("properties", {})
    named = {one["name"]: one for one in operation.get("parameters", [])}
    for name in [*parts, *(name for name in named if name not in parts)]:
        schema = parts.get(name) or named[name].get("schema", {})
        meaning = schema.get("description") or named.get(name, {}).get("description", "")
        needed = name in form.get("required", []) or named.get(name, {}).get("required", False)
        in_query = "path" if named.get(name, {}).get("in") == "path" else "yes" if name in named else ""
        yield (
            f"`{name}`" + (", required" if needed else ""),
            "yes" if name in parts else "",
            in_query,
            kind(schema, document),
            meaning,
        )


def answers(operation: dict[str, Any], document: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each status."""
    for status, answer in sorted(operation["responses"].items()):
        answer = resolved(answer, document)
        yield status, ", ".join(f"`{one}`" for one in answer.get("content", {})), answer.get("description", "")


def kind(schema: dict[str, Any], document: dict[str, Any]) -> str:
    """Return a schema's type in a few words."""
    schema = resolved(schema, document)
    if "enum" in schema:
        return ", ".join(f"`{one}`" for one in schema["enum"])
    if alternatives := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(kind(one, document) for one in alternatives))
    if schema.get("type") == "array":
        return f"list of: {kind(schema.get('items', {}), document)}"
    if schema.get("format") == "binary":
        return "file"
    limits = [f"{word} {schema[key]:g}" for key, word in (("minimum", "from"), ("maximum", "to")) if key in schema]
    return " ".join([schema.get("type", "any"), *limits])


def resolved(schema: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    """Return what a reference within the document points at."""
    while "$ref" in schema:
        found: Any = document
        for key in schema["$ref"].removeprefix("#/").split("/"):
            found = found[key]
        schema = found
    return schema


def table(head: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> Iterator[str]:
    """Yield a Markdown table; nothing for no rows."""
    lines = [" | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) for row in rows]
    if lines:
        yield f"| {' | '.join(head)} |\n|{' --- |' * len(head)}"
        yield from (f"| {line} |" for line in lines)
        yield ""
