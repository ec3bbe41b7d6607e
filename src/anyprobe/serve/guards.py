"""Checks before every request, of its size and its origin, and the security headers of every answer."""

from __future__ import annotations

import asyncio
import ipaddress
import re
import secrets
import time
from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from anyprobe.serve.problems import problem

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

RECEIVED = "anyprobe.received"
"""Key of a request's scope that counts the bytes of its body."""

COOKIE = "anyprobe_token"

HOST = re.compile(r"(\[[0-9a-fA-F:.%]+\]|[^\s:@/\\?#\[\],]+)(?::[0-9]{0,5})?")
"""Pattern of a Host header: a name or an address, and a port; nothing before an @, where parsers disagree."""

OPEN_PATHS = ("/healthz", "/readyz")
"""Paths that need no token."""


def too_large(max_bytes: int) -> str:
    return f"expected a body of at most {max_bytes / 2**20:g} MiB; shrink the photo first"


class BodyLimit:
    """Middleware that refuses a body that is too large, by Content-Length or as it comes, or too slow."""

    def __init__(self, app: ASGIApp, max_bytes: int, grace_s: float, least_rate: float) -> None:
        self._app, self._max_bytes, self._grace_s, self._least_rate = app, max_bytes, grace_s, least_rate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        length = Headers(scope=scope).get("content-length", "0")
        if length.isdigit() and int(length[:20]) > self._max_bytes:
            answer = problem(413, too_large(self._max_bytes), {"Connection": "close"})
            return await answer(scope, receive, send)
        scope[RECEIVED], start, is_coming = 0, time.monotonic(), True

        async def counted_receive() -> Message:
            nonlocal is_coming
            if not is_coming:  # the body is there; what follows is that the client leaves
                return await receive()
            allowed = self._grace_s + scope[RECEIVED] / self._least_rate
            try:
                async with asyncio.timeout(max(0.0, start + allowed - time.monotonic())):
                    message = await receive()
            except TimeoutError as error:
                text = (
                    f"expected {self._least_rate / 1024:g} KiB of the body per second, got less; shrink the photo first"
                )
                raise HTTPException(408, text, {"Connection": "close"}) from error
            is_coming = message.get("more_body", False)
            scope[RECEIVED] += len(message.get("body", b""))
            if scope[RECEIVED] > self._max_bytes:
                raise HTTPException(413, too_large(self._max_bytes), {"Connection": "close"})
            return message

        return await self._app(scope, counted_receive, send)


class OwnNamesOnly:
    """Middleware that refuses foreign host names, so that one pointed at this machine opens nothing.

    With `addresses`, any IP address is accepted: no DNS name can redirect one.
    """

    def __init__(self, app: ASGIApp, names: Collection[str], addresses: bool = False) -> None:
        self._app, self._names, self._addresses = app, list(dict.fromkeys(names)), addresses

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            return await self._app(scope, receive, send)
        host = Headers(scope=scope).get("host", "")
        match = HOST.fullmatch(host)
        name = match[1].lower() if match else ""
        if "*" in self._names or name in self._names or (self._addresses and _is_address(name)):
            return await self._app(scope, receive, send)
        text = (
            f"host: expected {' or '.join(self._names)}, got {host[:60]!r}; "
            "to serve under another name, start with --allow-host NAME"
        )
        return await problem(400, text)(scope, receive, send)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True


class TokenOnly:
    """Middleware that requires a token: in Authorization: Bearer, in a cookie, or once in an address, which sets the
    cookie."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app, self._token = app, token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["path"] in OPEN_PATHS:
            return await self._app(scope, receive, send)
        request = Request(scope)
        scheme, _, bearer = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self._fits(bearer) or self._fits(request.cookies.get(COOKIE, "")):
            return await self._app(scope, receive, send)
        if scope["method"] in SAFE_METHODS and self._fits(request.query_params.get("token", "")):
            target = "/" + request.url.path.lstrip("/\\")  # two strokes would begin another host's address
            answer: Response = RedirectResponse(target, 303)
            secure = scope["scheme"] == "https"
            answer.set_cookie(COOKIE, self._token.decode(), httponly=True, samesite="strict", secure=secure)
            return await answer(scope, receive, send)
        text = "expected the server's token, got none or another; open the address that it printed, or send "
        headers = {"WWW-Authenticate": "Bearer", "Connection": "close"}
        answer = problem(401, text + "Authorization: Bearer TOKEN", headers)
        return await answer(scope, receive, send)

    def _fits(self, token: str) -> bool:
        return secrets.compare_digest(token.strip().encode(), self._token)


class HeadAsGet:
    """Middleware that answers HEAD as GET, without the body."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            return await self._app(scope, receive, send)

        async def headers_only(message: Message) -> None:
            await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

        return await self._app({**scope, "method": "GET"}, receive, headers_only)


class OwnPagesOnly:
    """Middleware that refuses requests sent by pages of other origins; programs send no such header."""

    def __init__(self, app: ASGIApp, origins: Collection[str] = ()) -> None:
        self._app, self._origins = app, frozenset(origins)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["method"] not in SAFE_METHODS:
            headers = Headers(scope=scope)
            if _is_foreign(headers) and headers.get("origin") not in self._origins:
                text = "pages of other origins may not use this server; start it with --allow-origin ORIGIN"
                return await problem(403, text)(scope, receive, send)
        return await self._app(scope, receive, send)


def _is_foreign(headers: Headers) -> bool:
    """Return whether a page of another origin sent a request: by Sec-Fetch-Site, else by Origin.

    Browsers send the former to https and to this machine only, the latter always.
    """
    site, origin = headers.get("sec-fetch-site"), headers.get("origin")
    if site is not None:
        return site not in ("none", "same-origin")
    return origin is not None and urlsplit(origin).netloc != headers.get("host")


class SecureHeaders:
    """Middleware that adds SECURITY_HEADERS to every answer that does not set them itself."""

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
