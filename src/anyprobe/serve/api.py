"""HTTP server: photos in, lights out, and the page that does the same in the browser."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from functools import partial
from http import HTTPStatus
from importlib import resources
from typing import Annotated, Any, Literal

from fastapi import Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.params import Form as FormBody
from fastapi.responses import JSONResponse, Response
from fastapi.security import HTTPBearer
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect

from anyprobe import __version__, session
from anyprobe.errors import AnyprobeError, InputError, MissingExtra
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.extract import Extract
from anyprobe.estimate.result import LEVEL
from anyprobe.export.targets import TARGETS
from anyprobe.serve import answers, forms, tasks
from anyprobe.serve.answers import problem
from anyprobe.serve.forms import EstimateForm, ExportForm, MaskForm, PhotoForm, TargetName
from anyprobe.serve.guards import Admission, Counted, Metrics, OwnPagesOnly, SecureHeaders, TokenOnly
from anyprobe.serve.limits import Limits
from anyprobe.serve.page import Page, add_page
from anyprobe.serve.pool import Cancelled, WorkerPool
from anyprobe.serve.tasks import TooManyPixels

log = logging.getLogger("anyprobe.serve")

CLIENT_GONE = 499
"""Status that logs show for a client that has left, as other servers do; nobody reads the answer."""

REFUSALS = {
    400: "the server does not go by this host name, or the form is malformed",
    401: "the server asks for its token: Authorization: Bearer TOKEN",
    403: "sent by a page of another origin; start the server with --allow-origin ORIGIN",
    406: "Accept names no media type of this answer",
    408: "the body took too long",
    413: "too many bytes or pixels",
    422: "the photo, the mask or an option cannot be used; see detail",
    429: "all places are taken; retry after the seconds of Retry-After",
    500: "the server failed; see its log",
    501: "the server lacks an optional package for this",
}
"""Meaning of each status that refuses a request."""


def create_app(
    estimator: Estimator,
    limits: Limits | None = None,
    *,
    page: Page | None = None,
    hosts: Sequence[str] = ("*",),
    origins: Sequence[str] = (),
    token: str | None = None,
) -> FastAPI:
    """Build the application around an estimator whose networks are open.

    Args:
        estimator: shared by all workers; its own threads times limits.workers should be the cores.
        page: the built page; None leaves the API alone.
        hosts: names a browser may call this server by; others get 400, so that a foreign name
            pointed at this machine opens nothing.
        origins: pages of other origins that may use the API; none by default.
        token: asked for by all addresses but /healthz and /readyz; None: nothing is asked for.
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
        dependencies=[Depends(HTTPBearer(auto_error=False))] if token else [],
    )
    app.state.pool = pool
    metrics = Metrics(pool, limits.places)
    app.add_middleware(Admission, limits=limits, pool=pool)
    app.add_middleware(OwnPagesOnly, origins=origins)
    if token:
        app.add_middleware(TokenOnly, token=token)
    if origins:  # outside the token's door: browsers ask without a token whether they may send one
        methods, headers = ["GET", "POST"], ["Authorization", "Content-Type"]
        app.add_middleware(CORSMiddleware, allow_origins=list(origins), allow_methods=methods, allow_headers=headers)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False)
    app.add_middleware(GZipMiddleware, minimum_size=1024, compresslevel=5)
    app.add_middleware(SecureHeaders)
    app.add_middleware(Counted, metrics=metrics)  # the last added stands first
    _add_error_lines(app)
    _add_state(app, estimator, limits, pool, metrics)
    _add_api(app, estimator, limits, pool)
    if page is not None:
        add_page(app, page, pool)
    return app


def _answers(*statuses: int, content: dict[str, Any] | None = None) -> dict[int | str, dict[str, Any]]:
    """Return the description of a route's answers: 200 with this content, and refusals."""
    refused = {answers.PROBLEM: {"schema": answers.PROBLEM_SCHEMA}}
    described: dict[int | str, dict[str, Any]] = {
        status: {"description": REFUSALS[status], "content": refused} for status in (400, *statuses, 500)
    }
    return described | ({} if content is None else {200: {"description": "done", "content": content}})


_SENT = tuple(status for status in REFUSALS if status != HTTPStatus.NOT_ACCEPTABLE)
"""Refusals of addresses that take files."""
_FILE = {"schema": {"type": "string", "format": "binary"}}
_SIDECAR = json.loads((resources.files("anyprobe") / "estimate" / "sidecar.schema.json").read_text(encoding="utf-8"))
_LIGHT: dict[str, Any] = {"schema": {key: part for key, part in _SIDECAR.items() if key != "$schema"}}
_FOUND: dict[str, Any] = {"schema": {"type": "object", "required": ["size", "box", "share", "source"]}}


def _add_state(app: FastAPI, estimator: Estimator, limits: Limits, pool: WorkerPool, metrics: Metrics) -> None:
    """Add the addresses that report the server's state to its operator."""

    @app.get("/healthz", summary="Is the server up, and how busy is it?", tags=["server"], responses=_answers())
    async def healthz() -> dict[str, Any]:
        state = {"status": "ok", "version": __version__, "model": estimator.model_id}
        return {**state, "taken": pool.taken, "places": limits.places}

    starting: dict[int | str, dict[str, Any]] = {503: {"description": "starting, or all places are taken"}}

    @app.get("/readyz", summary="Would a photo be taken now?", tags=["server"], responses=_answers() | starting)
    async def readyz() -> dict[str, str]:
        if why := pool.unready():
            raise HTTPException(503, f"not ready: {why}", {"Retry-After": str(limits.retry_after_s)})
        return {"status": "ready"}

    text = {"text/plain": {"schema": {"type": "string"}}}

    @app.get(
        "/metrics",
        summary="Counts for Prometheus.",
        tags=["server"],
        response_class=Response,
        responses=_answers(401, 501, content=text),
    )
    async def prometheus() -> Response:
        return metrics.answer()


def _add_api(app: FastAPI, estimator: Estimator, limits: Limits, pool: WorkerPool) -> None:
    """Add the addresses that other programs call."""

    async def decode(request: Request, task: Callable[[Any, int], Any], sent: Any, quick: bool) -> Any:
        return await pool.decode(partial(task, sent, limits.max_pixels), quick, partial(_gone, request))

    @app.post(
        "/v1/estimate",
        tags=["light"],
        response_class=Response,
        responses=_answers(*_SENT, 406, content={**dict.fromkeys(answers.LIGHT_TYPES, _FILE), answers.JSON: _LIGHT}),
    )
    async def estimate(
        request: Request,
        form: Annotated[EstimateForm, FormBody(media_type="multipart/form-data")],  # type: ignore[valid-type]
        format: Literal["json", "exr", "hdr", "png"] | None = None,
    ) -> Response:
        """Estimate the light around the object of a photo, or of several photos whose cameras' poses are known.

        The object is given by a mask, a box, clicks, the photo's alpha channel, or found. The light is in the first
        photo's camera frame; object and light must not have moved between the photos. JSON by default; the map itself
        as OpenEXR, Radiance .hdr or tone-mapped PNG by Accept or `format`.
        """
        media = answers.choose_type(request, answers.LIGHT_TYPES)
        include = forms.included(form)
        await forms.check_once(request, form)
        shots, turns = await forms.photos_sent(form)
        extracts: list[Extract] = []
        masks: list[bytes | None] = []
        for shot in shots:
            start, is_first = time.perf_counter(), not extracts
            with_mask = is_first and "mask" in include
            task = partial(tasks.extract, is_first=is_first, is_alone=turns is None, with_mask=with_mask)
            extract, mask = await decode(request, task, shot, tasks.is_quick(shot))
            extracts.append(replace(extract, load_s=time.perf_counter() - start))
            masks.append(mask)

        def work() -> Response:
            return answers.light_response(session.estimate(estimator, extracts, turns), media, include, masks[0])

        return await pool.run(work, partial(_gone, request))

    @app.post(
        "/v1/mask",
        tags=["light"],
        response_class=Response,
        responses=_answers(*_SENT, 406, content={"image/png": _FILE, answers.JSON: _FOUND}),
    )
    async def mask(
        request: Request,
        form: Annotated[MaskForm, FormBody(media_type="multipart/form-data")],  # type: ignore[valid-type]
        format: Literal["json", "png"] | None = None,
    ) -> Response:
        """Return the mask that an estimate would use: a grey PNG of the upright photo's size."""
        media = answers.choose_type(request, answers.MASK_TYPES)
        await forms.check_once(request, form)
        shot = await forms.photo_sent(form)
        found = await decode(request, partial(tasks.mask, as_json=media == answers.JSON), shot, tasks.is_quick(shot))
        return JSONResponse(found) if media == answers.JSON else Response(found, media_type=media)

    @app.post(
        "/v1/photo", tags=["page"], response_class=Response, responses=_answers(*_SENT, content={"image/png": _FILE})
    )
    async def photo(
        request: Request, form: Annotated[PhotoForm, FormBody(media_type="multipart/form-data")]
    ) -> Response:
        """Convert a photo that browsers cannot open (HEIC, RAW, TIFF) to an upright sRGB PNG of at most 2048 pixels."""
        await forms.check_once(request, form)
        shot = await forms.photo_sent(form)
        picture, fov_deg = await decode(request, tasks.upright, shot, tasks.is_quick(shot))
        headers = {} if fov_deg is None else {"X-Long-Fov-Deg": f"{fov_deg:.3f}"}
        return Response(picture, media_type="image/png", headers=headers)

    @app.post(
        "/v1/export/{target}",
        tags=["light"],
        response_class=Response,
        responses=_answers(*_SENT, content={"application/zip": _FILE}),
    )
    async def export(
        request: Request,
        target: TargetName,  # type: ignore[valid-type]
        form: Annotated[ExportForm, FormBody(media_type="multipart/form-data")],
    ) -> Response:
        """Export a map as the files of one target, in a zip."""
        await forms.check_once(request, form)
        task = partial(
            tasks.export_zip,
            target=target,
            sidecar=None if form.sidecar is None else await form.sidecar.read(),
            world_from_camera=form.world_from_camera,
            is_level=form.frame == LEVEL,
            exposure_ev=form.exposure,
        )
        archive = await decode(request, task, await form.photo.read(), False)
        name = f'attachment; filename="light_{target}.zip"'
        return Response(archive, media_type="application/zip", headers={"Content-Disposition": name})

    @app.get("/v1/targets", summary="What /v1/export can write.", tags=["light"], responses=_answers(401))
    async def targets() -> list[str]:
        return list(TARGETS)


async def _gone(request: Request) -> None:
    """Wait until the client has gone; to be called once the body is read."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _add_error_lines(app: FastAPI) -> None:
    """Answer every error as problem details; log unexpected errors instead of sending them."""

    def line(error: object, status: int, headers: dict[str, str] | None = None) -> Response:
        return problem(status, error.notice if isinstance(error, AnyprobeError) else str(error), headers)

    @app.exception_handler(Cancelled)
    @app.exception_handler(ClientDisconnect)
    async def cancelled(request: Request, error: Exception) -> Response:
        return Response(status_code=CLIENT_GONE)

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        headers = dict(error.headers or {})
        text = f"expected {headers['Allow']}, got {request.method}" if "Allow" in headers else error.detail
        return line(text, error.status_code, headers)

    @app.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        return line(forms.refusal(error, request.url.path), 422)

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
