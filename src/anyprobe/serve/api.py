"""HTTP server: photos in, lights out, and the page that does the same in the browser."""

from __future__ import annotations

import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from functools import partial
from typing import Any, TypeVar

from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import ClientDisconnect

from anyprobe import __version__
from anyprobe.errors import AnyprobeError, InputError, MissingExtra
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.multiview import estimate_crops
from anyprobe.export.targets import TARGETS, find_target
from anyprobe.serve import answers, openapi, tasks
from anyprobe.serve.counters import Counted, Metrics
from anyprobe.serve.guards import BodyLimit, HeadAsGet, OwnNamesOnly, OwnPagesOnly, SecureHeaders, TokenOnly
from anyprobe.serve.limits import Limits
from anyprobe.serve.page import Page, add_page
from anyprobe.serve.pool import Busy, Cancellation, Cancelled, Ending, WorkerPool
from anyprobe.serve.problems import problem
from anyprobe.serve.tasks import TooManyPixels, Upload
from anyprobe.serve.uploads import read_upload, read_views, take_unread

log = logging.getLogger("anyprobe.serve")

Answer = TypeVar("Answer")

CLIENT_GONE = 499
"""Status that logs show for a client that has left, as other servers do; nobody reads the answer."""


def create_app(
    estimator: Estimator,
    limits: Limits | None = None,
    *,
    page: Page | None = None,
    hosts: Sequence[str] = ("*",),
    addresses: bool = False,
    origins: Sequence[str] = (),
    token: str | None = None,
) -> FastAPI:
    """Build the application around an estimator whose networks are open.

    Args:
        estimator: shared by all workers; its own threads times limits.workers should be the cores.
        page: the built page; None leaves the API alone.
        hosts: names a browser may call this server by; others get 400, so that a foreign name
            pointed at this machine opens nothing.
        addresses: whether it may be called by any IP address besides.
        token: asked for by all addresses but /healthz and /readyz; None: nothing is asked for.
        origins: pages of other origins that may use the API; none by default.
    """
    limits = limits or Limits()
    pool = WorkerPool(limits)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        yield
        pool.close()

    app = FastAPI(
        title="anyprobe",
        version=__version__,
        summary="One photo of an object of uniform material in, the HDR light around it out.",
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
    )
    app.state.pool = pool
    app.add_middleware(BodyLimit, max_bytes=limits.max_bytes, grace_s=limits.grace_s, least_rate=limits.least_rate)
    app.add_middleware(OwnPagesOnly, origins=origins)
    if token:
        app.add_middleware(TokenOnly, token=token)
    if origins:  # outside the token's door: browsers ask without a token whether they may send one
        headers = ["Authorization", "Content-Type"]
        app.add_middleware(
            CORSMiddleware, allow_origins=list(origins), allow_methods=["GET", "POST"], allow_headers=headers
        )
    app.add_middleware(OwnNamesOnly, names=hosts, addresses=addresses)
    app.add_middleware(HeadAsGet)
    app.add_middleware(SecureHeaders)
    metrics = Metrics(pool, limits.workers + limits.waiting)
    app.add_middleware(Counted, metrics=metrics)  # the last added stands first
    _add_error_lines(app, limits)
    _add_state(app, estimator, limits, pool, metrics)
    _add_api(app, estimator, limits, pool)
    if page is not None:
        add_page(app, page, pool)
    return app


def _add_state(app: FastAPI, estimator: Estimator, limits: Limits, pool: WorkerPool, metrics: Metrics) -> None:
    """Add the addresses that report the server's state to its operator."""

    @app.get("/healthz", summary="Is the server up, and how busy is it?", tags=["server"], openapi_extra=openapi.HEALTH)
    async def healthz() -> dict[str, Any]:
        return {
            "status": "ok",
            "version": __version__,
            "model": estimator.model_id,
            "taken": pool.taken,
            "places": limits.workers + limits.waiting,
        }

    @app.get("/readyz", summary="Would a photo be taken now?", tags=["server"], openapi_extra=openapi.READY)
    async def readyz() -> dict[str, str]:
        if why := pool.unready():
            raise HTTPException(503, f"not ready: {why}", {"Retry-After": str(limits.retry_after_s)})
        return {"status": "ready"}

    @app.get("/metrics", summary="Counts for Prometheus.", tags=["server"], openapi_extra=openapi.METRICS_ROUTE)
    async def prometheus() -> Response:
        return metrics.answer()


def _add_api(app: FastAPI, estimator: Estimator, limits: Limits, pool: WorkerPool) -> None:
    """Add the addresses that other programs call."""

    async def decode(request: Request, task: Callable[[Upload, int], Answer], upload: Upload) -> Answer:
        return await pool.decode(partial(task, upload, limits.max_pixels), upload.is_quick, _leaving(request))

    async def cut(request: Request, upload: Upload, first: bool = True, is_alone: bool = False) -> tasks.Cut:
        with_mask = first and "mask" in upload.include
        return await decode(request, partial(tasks.cut, first=first, with_mask=with_mask, is_alone=is_alone), upload)

    @app.post("/v1/estimate", openapi_extra=openapi.ESTIMATE_ROUTE, tags=["light"], response_class=Response)
    async def estimate(request: Request) -> Response:
        """Estimate the light around the object of a photo.

        The object is given by a mask, a box, clicks, the photo's alpha channel, or found. JSON by
        default; the map itself as OpenEXR, Radiance .hdr or tone-mapped PNG by Accept or `format`.
        """
        media = answers.choose_type(request, answers.LIGHT_TYPES)
        async with pool.place():
            upload = await read_upload(request, pool, openapi.ESTIMATE_ROUTE)
            start = time.perf_counter()
            cut_photo = await cut(request, upload, is_alone=True)

            def work(cancellation: Cancellation) -> Response:
                model = estimator.with_settings(**upload.settings)
                light = model.from_crop(cut_photo.photo, cut_photo.crop, start)
                if cut_photo.ball is not None:
                    light = model.unwrapped(light, cut_photo.ball, start)
                cancellation.check()
                return answers.light_response(light, media, upload.include, cut_photo.mask)

            return await pool.run(work, _leaving(request))

    @app.post("/v1/fuse", openapi_extra=openapi.FUSE_ROUTE, tags=["light"], response_class=Response)
    async def fuse(request: Request) -> Response:
        """Estimate one light from several photos of an object whose cameras' poses are known.

        The light is in the first photo's camera frame; object and light must not have moved between the photos.
        """
        media = answers.choose_type(request, answers.LIGHT_TYPES)
        async with pool.place():
            uploads, turns = await read_views(request, pool)
            common = uploads[0]
            cuts: list[tasks.Cut] = []
            seconds: list[float] = []
            for upload in uploads:
                start = time.perf_counter()
                cuts.append(await cut(request, upload, first=not cuts))
                seconds.append(time.perf_counter() - start)

            def work(cancellation: Cancellation) -> Response:
                views = [(cut_view.photo, cut_view.crop) for cut_view in cuts]
                from_crop = estimator.with_settings(**common.settings).from_crop
                light = estimate_crops(from_crop, views, turns, seconds)
                cancellation.check()
                return answers.light_response(light, media, common.include, cuts[0].mask)

            return await pool.run(work, _leaving(request))

    @app.post("/v1/mask", openapi_extra=openapi.MASK_ROUTE, tags=["light"], response_class=Response)
    async def mask(request: Request) -> Response:
        """Return the mask that an estimate would use: a grey PNG of the upright photo's size."""
        media = answers.choose_type(request, answers.MASK_TYPES)
        async with pool.place():
            upload = await read_upload(request, pool, openapi.MASK_ROUTE)
            found = await decode(request, partial(tasks.mask, as_json=media == answers.JSON), upload)
        return JSONResponse(found) if media == answers.JSON else Response(found, media_type=media)

    @app.post("/v1/photo", openapi_extra=openapi.PHOTO_ROUTE, tags=["page"], response_class=Response)
    async def photo(request: Request) -> Response:
        """Convert a photo that browsers cannot open (HEIC, TIFF, EXR) to an upright sRGB PNG of at most 2048 pixels."""
        async with pool.place():
            upload = await read_upload(request, pool, openapi.PHOTO_ROUTE)
            picture, fov_deg = await decode(request, tasks.upright, upload)
        headers = {} if fov_deg is None else {"X-Long-Fov-Deg": f"{fov_deg:.3f}"}
        return Response(picture, media_type="image/png", headers=headers)

    @app.post("/v1/export/{target}", openapi_extra=openapi.EXPORT_ROUTE, tags=["light"], response_class=Response)
    async def export(request: Request, target: str) -> Response:
        """Export a map (.exr or .hdr as the body) as the files of one target, in a zip."""
        find_target(target)
        async with pool.place():
            upload = await read_upload(request, pool, openapi.EXPORT_ROUTE)
            archive = await decode(request, partial(tasks.export_zip, target=target), upload)
        name = f'attachment; filename="light_{target}.zip"'
        return Response(archive, media_type="application/zip", headers={"Content-Disposition": name})

    @app.get("/v1/targets", summary="What /v1/export can write.", tags=["light"], openapi_extra=openapi.TARGETS_ROUTE)
    async def targets() -> list[str]:
        return list(TARGETS)


def _leaving(request: Request) -> Callable[[], Any]:
    """Return a coroutine function that waits until the client has gone; call it once the body is read."""

    async def gone() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    return gone


def _add_error_lines(app: FastAPI, limits: Limits) -> None:
    """Answer every error as problem details; log unexpected errors instead of sending them."""

    def line(error: object, status: int, headers: dict[str, str] | None = None) -> Response:
        return problem(status, error.notice if isinstance(error, AnyprobeError) else str(error), headers)

    @app.exception_handler(Busy)
    async def busy(request: Request, error: Busy) -> Response:
        await take_unread(request)
        text = f"all {limits.workers + limits.waiting} places are taken; try again in a moment"
        return line(text, 429, {"Retry-After": str(limits.retry_after_s)})

    @app.exception_handler(Ending)
    async def ending(request: Request, error: Ending) -> Response:
        headers = {"Retry-After": str(limits.retry_after_s), "Connection": "close"}
        return line("the server is shutting down; send the request to another, or again in a moment", 503, headers)

    @app.exception_handler(Cancelled)
    @app.exception_handler(ClientDisconnect)
    async def cancelled(request: Request, error: Exception) -> Response:
        return Response(status_code=CLIENT_GONE)

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        headers = dict(error.headers or {})
        text = f"expected {headers['Allow']}, got {request.method}" if "Allow" in headers else error.detail
        return line(text, error.status_code, headers)

    @app.exception_handler(AnyprobeError)
    async def ours(request: Request, error: AnyprobeError) -> Response:
        if isinstance(error, InputError):
            return line(error, 413 if isinstance(error, TooManyPixels) else 422)
        if isinstance(error, MissingExtra):
            return line(error, 501)
        log.error("%s", error)  # it may name a path of this machine
        return line("the server is not fully set up; see its log", 500)

    @app.exception_handler(Exception)
    async def unforeseen(request: Request, error: Exception) -> Response:
        log.error("unforeseen", exc_info=error)
        return line("the server failed to process the request; see its log", 500)
