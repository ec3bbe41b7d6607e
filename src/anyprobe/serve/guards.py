"""What stands before every request: its size, where it comes from, and the headers of every answer."""

from __future__ import annotations

from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SECURITY_HEADERS = {
    "Cross-Origin-Opener-Policy": "same-origin",  # these two let the page's networks use threads
    "Cross-Origin-Embedder-Policy": "require-corp",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; "
    "connect-src 'self' blob: data:; img-src 'self' blob: data:; media-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Permissions-Policy": "camera=(self), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")


def too_large(max_bytes: int) -> str:
    return f"expected a body of at most {max_bytes / 2**20:g} MiB; shrink the photo first"


class BodyLimit:
    """Refuses a body by its Content-Length, or when that many bytes have come."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app, self._max_bytes = app, max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        given = Headers(scope=scope).get("content-length", "0")
        if given.isdigit() and int(given) > self._max_bytes:
            answer = JSONResponse({"error": too_large(self._max_bytes)}, 413, {"Connection": "close"})
            return await answer(scope, receive, send)
        num_bytes = 0

        async def counted() -> Message:
            nonlocal num_bytes
            message = await receive()
            num_bytes += len(message.get("body", b""))
            if num_bytes > self._max_bytes:
                raise HTTPException(413, too_large(self._max_bytes), {"Connection": "close"})
            return message

        return await self._app(scope, counted, send)


class OwnNamesOnly:
    """Refuses names that the server does not go by, so that a foreign one pointed at this machine opens nothing.

    Which those are says Starlette; what they are told is a line like our others.
    """

    def __init__(self, app: ASGIApp, names: Collection[str]) -> None:
        self._app, self._names = app, list(dict.fromkeys(names))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def own(scope: Scope, receive: Receive, _: Send) -> None:
            await self._app(scope, receive, send)

        async def foreign(message: Message) -> None:
            if message["type"] == "http.response.start":
                got = Headers(scope=scope).get("host", "")[:60]
                text = (
                    f"host: expected {' or '.join(self._names)}, got {got!r}; a server on the loopback answers to no "
                    "other name, start it with --host to open it to others"
                )
                await JSONResponse({"error": text}, 400)(scope, receive, send)

        await TrustedHostMiddleware(own, self._names, www_redirect=False)(scope, receive, foreign)


class OwnPagesOnly:
    """Refuses what a page of another origin makes a browser send; programs send no such header."""

    def __init__(self, app: ASGIApp, origins: Collection[str] = ()) -> None:
        self._app, self._origins = app, frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["method"] not in SAFE_METHODS:
            headers = Headers(scope=scope)
            if _is_foreign(headers) and headers.get("origin") not in self._origins:
                text = "pages of other origins may not use this server; start it with --allow-origin ORIGIN"
                return await JSONResponse({"error": text}, 403)(scope, receive, send)
        return await self._app(scope, receive, send)


def _is_foreign(headers: Headers) -> bool:
    """By Sec-Fetch-Site, which browsers send to https and to this machine; else by Origin, which they always send."""
    site, origin = headers.get("sec-fetch-site"), headers.get("origin")
    if site is not None:
        return site not in ("none", "same-origin")
    return origin is not None and urlsplit(origin).netloc != headers.get("host")


class SecureHeaders:
    """Adds SECURITY_HEADERS to every answer that does not set them itself."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, with_headers)
