"""Middleware: checks before every request, of its size, its sender and its page; security headers of every answer; and
metrics for Prometheus at /metrics: requests, seconds and the queue."""

import asyncio
import contextlib
import secrets
import time
from collections.abc import Collection
from typing import Any
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from anyprobe.serve.answers import problem
from anyprobe.serve.limits import UNREAD_S, Limits
from anyprobe.serve.pool import WorkerPool

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

COOKIE = "anyprobe_token"

OPEN_PATHS = ("/healthz", "/readyz")
"""Paths that need no token."""


class Admission:
    """Middleware that gives each POST a place in the queue, before its body is read, and bounds that body.

    A full queue is answered 429; a body of more than Limits.max_bytes 413, by Content-Length or as it comes; one slower
    than Limits.upload_s 408.
    """

    def __init__(self, app: ASGIApp, limits: Limits, pool: WorkerPool) -> None:
        self._app, self._limits, self._pool = app, limits, pool

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "POST":
            return await self._app(scope, receive, send)
        limits, received = self._limits, 0
        large = f"expected a body of at most {limits.max_bytes / 2**20:g} MiB; shrink the photo first"
        length = Headers(scope=scope).get("content-length", "0")
        if length.isdigit() and int(length[:20]) > limits.max_bytes:
            return await problem(413, large, {"Connection": "close"})(scope, receive, send)
        if self._pool.is_full:
            await _discard(receive)
            text = f"all {limits.places} places are taken; try again in a moment"
            return await problem(429, text, {"Retry-After": str(limits.retry_after_s)})(scope, receive, send)
        deadline: float | None = asyncio.get_running_loop().time() + limits.upload_s

        async def bounded() -> Message:
            nonlocal received, deadline
            try:
                async with asyncio.timeout_at(deadline):
                    message = await receive()
            except TimeoutError as error:
                text = f"expected the whole body within {limits.upload_s:g} seconds; send a smaller photo"
                raise HTTPException(408, text, {"Connection": "close"}) from error
            received += len(message.get("body", b""))
            if received > limits.max_bytes:
                raise HTTPException(413, large, {"Connection": "close"})
            if not message.get("more_body", False):  # what follows is that the client leaves
                deadline = None
            return message

        self._pool.taken += 1
        try:
            await self._app(scope, bounded, send)
        finally:
            self._pool.taken -= 1


async def _discard(receive: Receive) -> None:
    """Receive a refused body for a while: an answer while it still comes closes the connection, which some clients
    take for a fault."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(UNREAD_S):
            while (await receive()).get("more_body", False):
                pass


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
        return await problem(401, text + "Authorization: Bearer TOKEN", headers)(scope, receive, send)

    def _fits(self, token: str) -> bool:
        return secrets.compare_digest(token.strip().encode(), self._token)


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


SECONDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)
"""Upper bounds of the histogram's bins [s]."""

ELSEWHERE = "other"
"""Route label of requests without a route: clients can make up any number of addresses."""


class Metrics:
    """Metrics of one application, in its own registry, so that one process can run several."""

    def __init__(self, pool: WorkerPool, places: int) -> None:
        import prometheus_client as prometheus

        self._prometheus = prometheus
        self._registry = prometheus.CollectorRegistry()
        in_registry: dict[str, Any] = {"registry": self._registry}
        requests = ("anyprobe_requests", "Answered requests.", ["route", "status"])
        self.requests = prometheus.Counter(*requests, **in_registry)
        self.seconds = prometheus.Histogram(
            "anyprobe_request_seconds", "From head to last byte.", ["route"], buckets=SECONDS, **in_registry
        )
        taken = prometheus.Gauge("anyprobe_places_taken", "Requests that hold a place in the queue.", **in_registry)
        taken.set_function(lambda: pool.taken)
        prometheus.Gauge("anyprobe_places", "Places of the queue, those at work included.", **in_registry).set(places)
        ready = prometheus.Gauge("anyprobe_ready", "1 where a photo would be taken now.", **in_registry)
        ready.set_function(lambda: not pool.unready())
        prometheus.ProcessCollector(**in_registry)

    def answer(self) -> Response:
        """Return the metrics in Prometheus's text format."""
        text = self._prometheus.generate_latest(self._registry)
        return Response(text, media_type=self._prometheus.CONTENT_TYPE_LATEST)


class Counted:
    """Middleware that counts every request and its seconds."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app, self._metrics = app, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        start, status = time.perf_counter(), 500

        async def send_noting_status(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, receive, send_noting_status)
        finally:
            route = getattr(scope.get("route"), "path", ELSEWHERE)
            self._metrics.requests.labels(route, str(status)).inc()
            self._metrics.seconds.labels(route).observe(time.perf_counter() - start)
