"""The HTTP server: photos in, lights out, and the page that does the same in the browser."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import ClientDisconnect

from anyprobe import __version__
from anyprobe.errors import AnyprobeError, InputError, MissingExtra
from anyprobe.estimate.estimator import Estimator
from anyprobe.export.targets import TARGETS, find_target
from anyprobe.serve import answers, estimates, openapi
from anyprobe.serve.guards import BodyLimit, OwnNamesOnly, OwnPagesOnly, SecureHeaders
from anyprobe.serve.limits import Limits
from anyprobe.serve.page import Page, add_page
from anyprobe.serve.pool import Busy, Cancelled, Job, WorkerPool
from anyprobe.serve.several import estimate_uploads, read_multiview
from anyprobe.serve.uploads import read_upload, take_unread

log = logging.getLogger("anyprobe.serve")

CLIENT_GONE = 499
"""Nobody reads this answer; the number is what logs of other servers call it."""


def create_app(
    estimator: Estimator,
    limits: Limits | None = None,
    *,
    page: Page | None = None,
    hosts: Sequence[str] = ("*",),
    origins: Sequence[str] = (),
) -> FastAPI:
    """The application around networks that are open already.

    Args:
        estimator: shared by all workers; its own threads times limits.workers should be the cores.
        page: the built page; None leaves the API alone.
        hosts: names a browser may call this server by; others get 400, so that a foreign name
            pointed at this machine opens nothing.
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
    app.add_middleware(BodyLimit, max_bytes=limits.max_bytes)
    app.add_middleware(OwnPagesOnly, origins=origins)
    if origins:
        app.add_middleware(CORSMiddleware, allow_origins=list(origins), allow_methods=["GET", "POST"])
    app.add_middleware(OwnNamesOnly, names=hosts)
    app.add_middleware(SecureHeaders)  # the last added stands first
    _add_error_lines(app, limits)
    _add_api(app, estimator, limits, pool)
    if page is not None:
        add_page(app, page, pool)
    return app


def _add_api(app: FastAPI, estimator: Estimator, limits: Limits, pool: WorkerPool) -> None:
    """The addresses that other programs call."""

    @app.get("/healthz", summary="Is the server up, and how busy is it?", tags=["server"])
    async def healthz() -> dict[str, Any]:
        return {
            "status": "ok",
            "version": __version__,
            "model": estimator.model_id,
            "taken": pool.taken,
            "places": limits.workers + limits.waiting,
        }

    @app.post("/v1/estimate", openapi_extra=openapi.ESTIMATE, tags=["light"], response_class=Response)
    async def estimate(request: Request) -> Response:
        """Estimate the light around the object of a photo.

        The object is told by a mask, a box, clicks, the photo's alpha channel, or found. JSON by
        default; the map itself as OpenEXR, Radiance .hdr or tone-mapped PNG by Accept or `format`.
        """
        media = answers.choose_type(request, answers.LIGHT_TYPES)
        async with pool.place():
            upload = await read_upload(request, limits, openapi.ESTIMATE)

            def work(job: Job) -> Response:
                photo, light = estimates.estimate_light(estimator, upload, job)
                job.step()
                return answers.light_response(light, media, upload.include, photo)

            return await pool.run(work, _leaving(request))

    @app.post("/v1/fuse", openapi_extra=openapi.FUSE, tags=["light"], response_class=Response)
    async def fuse(request: Request) -> Response:
        """Estimate one light from several photos of an object whose cameras' poses are known.

        The light is in the first photo's camera frame; object and light must not have moved between the photos.
        """
        media = answers.choose_type(request, answers.LIGHT_TYPES)
        async with pool.place():
            several = await read_multiview(request, limits)

            def work(job: Job) -> Response:
                photo, light = estimate_uploads(estimator, several, job)
                job.step()
                return answers.light_response(light, media, several.uploads[0].include, photo)

            return await pool.run(work, _leaving(request))

    @app.post("/v1/mask", openapi_extra=openapi.MASK, tags=["light"], response_class=Response)
    async def mask(request: Request) -> Response:
        """The mask that an estimate would use: a grey PNG of the upright photo's size."""
        media = answers.choose_type(request, answers.MASK_TYPES)
        async with pool.place():
            upload = await read_upload(request, limits, openapi.MASK)

            def work(job: Job) -> Response:
                photo = estimates.open_photo(upload, job)
                if media == answers.JSON:
                    return JSONResponse(answers.mask_json(photo))
                return Response(answers.mask_png(photo.mask), media_type=media)

            return await pool.run(work, _leaving(request))

    @app.post("/v1/photo", openapi_extra=openapi.PHOTO, tags=["page"], response_class=Response)
    async def photo(request: Request) -> Response:
        """A photo a browser cannot open (HEIC, TIFF, EXR) as an upright sRGB PNG of at most 2048 pixels."""
        async with pool.place():
            upload = await read_upload(request, limits, openapi.PHOTO)

            def work(job: Job) -> Response:
                picture, fov_deg = estimates.upright_picture(upload.photo, job)
                headers = {} if fov_deg is None else {"X-Long-Fov-Deg": f"{fov_deg:.3f}"}
                return Response(answers.png(picture), media_type="image/png", headers=headers)

            return await pool.run(work, _leaving(request))

    @app.post("/v1/export/{target}", openapi_extra=openapi.EXPORT, tags=["light"], response_class=Response)
    async def export(request: Request, target: str) -> Response:
        """A map (.exr or .hdr as the body) as the files of one target, in a zip."""
        find_target(target)
        async with pool.place():
            upload = await read_upload(request, limits, openapi.EXPORT)

            def work(job: Job) -> Response:
                with tempfile.TemporaryDirectory() as folder:
                    estimates.export_map(upload, target, Path(folder), job)
                    archive = answers.zip_folder(Path(folder))
                name = f'attachment; filename="light_{target}.zip"'
                return Response(archive, media_type="application/zip", headers={"Content-Disposition": name})

            return await pool.run(work, _leaving(request))

    @app.get("/v1/targets", summary="What /v1/export can write.", tags=["light"])
    async def targets() -> list[str]:
        return list(TARGETS)


def _leaving(request: Request) -> Callable[[], Any]:
    """Returns when the client has gone; the body must have been read."""

    async def gone() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    return gone


def _add_error_lines(app: FastAPI, limits: Limits) -> None:
    """Every error as {"error": one line}; what was not foreseen is logged here and not told there."""

    def line(error: object, status: int, headers: dict[str, str] | None = None) -> JSONResponse:
        return JSONResponse({"error": " ".join(str(error).split())}, status, headers)

    @app.exception_handler(Busy)
    async def busy(request: Request, error: Busy) -> Response:
        await take_unread(request)
        text = f"all {limits.workers + limits.waiting} places are taken; try again in a moment"
        return line(text, 429, {"Retry-After": str(limits.retry_after_s)})

    @app.exception_handler(Cancelled)
    @app.exception_handler(ClientDisconnect)
    async def cancelled(request: Request, error: Exception) -> Response:
        return Response(status_code=CLIENT_GONE)

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        headers = dict(error.headers or {})
        wrong = f"expected {headers['Allow']}, got {request.method}" if "Allow" in headers else error.detail
        return line(wrong, error.status_code, headers)

    @app.exception_handler(AnyprobeError)
    async def ours(request: Request, error: AnyprobeError) -> Response:
        if isinstance(error, InputError):
            return line(error, 422)
        if isinstance(error, MissingExtra):
            return line(error, 501)
        log.error("%s", error)  # it may name a path of this machine
        return line("the server is not whole; its log says more", 500)

    @app.exception_handler(Exception)
    async def unforeseen(request: Request, error: Exception) -> Response:
        log.error("unforeseen", exc_info=error)
        return line("the server failed at this; its log says more", 500)
