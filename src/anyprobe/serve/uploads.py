"""Contents of a request: a photo as the body or as a form part, and its options."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from starlette.datastructures import FormData, QueryParams, UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request

from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, InvalidMask, InvalidPhoto
from anyprobe.estimate.poses import parse_poses
from anyprobe.estimate.result import LEVEL, check_frame
from anyprobe.estimate.settings import CHOICES
from anyprobe.hints import HINTS, Hints, numbers_in
from anyprobe.serve.guards import RECEIVED
from anyprobe.serve.limits import MAX_PHOTOS, UNREAD_S
from anyprobe.serve.openapi import FORM, FUSE_ROUTE, form_names, query_names
from anyprobe.serve.pool import WorkerPool
from anyprobe.serve.tasks import Upload

FILES = {field: hint for field, hint in HINTS.items() if hint.suffixes}
"""Hints that are sent as file parts."""


async def take_unread(request: Request) -> None:
    """Receive and discard the body of a refused request, for at most UNREAD_S.

    An answer while the body still comes closes the connection on it, and some clients then never see the answer.
    """
    with contextlib.suppress(TimeoutError, ClientDisconnect, HTTPException):
        async with asyncio.timeout(UNREAD_S):
            async for _ in request.stream():
                pass


async def read_upload(request: Request, pool: WorkerPool, address: dict[str, Any]) -> Upload:
    """Read a photo and its options; form fields take precedence over query parameters.

    Args:
        address: what serve.openapi says of it; what it does not name is refused.
    Raises:
        HTTPException: 408 too slow.
        InputError: no photo came, or an option that is unknown, given twice or cannot be read.
    """
    name, sidecar, files = "photo", b"", {}
    async with _read_form(request, pool, max_files=1 + len(FILES)) as form:
        if request.headers.get("content-type", "").startswith(FORM):
            photo, name = await _file(form, "photo")
            sidecar, _ = await _file(form, "sidecar")
            texts = [field for field, hint in FILES.items() if hint.words and isinstance(form.get(hint.name), str)]
            files = {field: (await _file(form, hint.name))[0] for field, hint in FILES.items() if field not in texts}
        else:
            photo = await request.body()
    refuse_unknown(form, request.query_params, address)
    if not photo:
        raise InvalidPhoto("expected an image as the body, or as a part of the form, got nothing", subject="photo")
    option = Options(form, request.query_params)
    return Upload(
        photo=photo,
        name=name,
        hints=option.hints({field: data for field, data in files.items() if data}),
        settings=option.settings(),
        include=option.include(),
        exposure=(option.numbers("exposure", "a number", 1) or (None,))[0],
        world_from_camera=option.numbers(
            "world_from_camera", "YAW,ELEVATION[,ROLL] in degrees or nine numbers", 2, 3, 9
        ),
        sidecar=sidecar or None,
        frame=check_frame((option.text("frame") or LEVEL)[:60]),
    )


async def read_views(request: Request, pool: WorkerPool) -> tuple[list[Upload], np.ndarray]:
    """Read the photos of one object, and world_from_camera [N, 3, 3] of each.

    The form has parts `photo`, as many of `mask` or `box` or none, one part `poses`, and options common to all.

    Raises:
        HTTPException: 408 too slow.
        InputError: no photos or too many, no poses or not theirs, or an option that is unknown or cannot be read.
    """
    async with _read_form(request, pool, max_files=2 * MAX_PHOTOS + 1) as form:
        photos = [await read_part(part, "photo") for part in form.getlist("photo")]
        masks = [(await read_part(part, "mask"))[0] for part in form.getlist("mask")]
        _refuse_repeated(form, "poses")
        sent_poses = form.get("poses", "")
        poses = sent_poses.encode() if isinstance(sent_poses, str) else await sent_poses.read()
        files = [name for name in form if not all(isinstance(part, str) for part in form.getlist(name))]
    option = Options(form, request.query_params)
    unusable = [name for name in files if name in FILES and name != "mask"]
    unusable += [name for name in ("click", "exclude") if option.texts(name)]
    if unusable:
        raise InputError(
            "expected a mask or a box per photo, got an input for single photos; leave it out", subject=unusable[0]
        )
    refuse_unknown(form, request.query_params, FUSE_ROUTE)
    if not 1 <= len(photos) <= MAX_PHOTOS:
        raise InvalidPhoto(f"expected 1 to {MAX_PHOTOS} file parts of this name, got {len(photos)}", subject="photo")
    boxes = [HINTS["box"].read(text) for text in option.texts("box")]
    for name, values in (("mask", masks), ("box", boxes)):
        if len(values) not in (0, len(photos)):
            raise InvalidMask(
                f"expected none or one per photo, got {len(values)} for {len(photos)} photos", subject=name
            )
    rotations, fovs = await asyncio.to_thread(_poses_of, photos, poses)
    common = option.hints({}, "camera", "light")
    settings, include = option.settings(), option.include()
    uploads = []
    for k, (data, name) in enumerate(photos):
        hints = replace(
            common,
            mask=masks[k] if masks else None,
            box=boxes[k] if boxes else None,
            fov_deg=fovs[k] if common.fov_deg is None else common.fov_deg,
        )
        uploads.append(Upload(photo=data, name=name, hints=hints, settings=settings, include=include))
    return uploads, rotations


def _poses_of(photos: list[tuple[bytes, str]], poses: bytes) -> tuple[np.ndarray, list[float | None]]:
    """Parse the poses of photos (their data and names): world_from_camera [N, 3, 3] and fields of view [degrees]."""
    if not poses:
        raise InputError("expected a transforms.json, got nothing", subject="poses")
    try:
        parsed, names = parse_poses(poses, "poses"), [Path(name) for _, name in photos]
        rotations = parsed.of(names)
    except InputError as error:
        raise InputError(error, subject="poses") from error
    return rotations, parsed.fovs_deg(names, [data for data, _ in photos])


@asynccontextmanager
async def _read_form(request: Request, pool: WorkerPool, max_files: int) -> AsyncIterator[FormData]:
    """Yield the request's form, an empty one for another body; reading within the block is timed too.

    Raises:
        HTTPException: 408 too slow.
    """
    form = FormData()
    try:
        async with pool.upload(lambda: request.scope.get(RECEIVED, 0)):
            if request.headers.get("content-type", "").startswith(FORM):
                form = await request.form(max_files=max_files, max_fields=32)
            yield form
    finally:
        await form.close()


def refuse_unknown(form: FormData, query: QueryParams, address: dict[str, Any]) -> None:
    """Raise InputError for a name that nothing reads, as a mistyped option would otherwise be ignored."""
    sources = (("form field", form, form_names(address)), ("query parameter", query, query_names(address)))
    for kind, names, known_names in sources:
        for name in names:
            if name not in known_names:
                expected = f"one of {', '.join(known_names)}" if known_names else "none here"
                advice = did_you_mean(name, known_names)
                raise InputError(f"expected {expected}, got {name[:60]!r}{advice}", source=kind)


async def _file(form: FormData, field: str) -> tuple[bytes, str]:
    _refuse_repeated(form, field)
    part = form.get(field)
    return (b"", field) if part is None else await read_part(part, field)


def _refuse_repeated(form: FormData, field: str) -> None:
    """Raise InputError if a part that counts once is sent more often."""
    count = len(form.getlist(field))
    if count > 1:
        raise InputError(f"expected one part of this name, got {count}; send one", subject=field)


async def read_part(part: UploadFile | str, field: str) -> tuple[bytes, str]:
    """Return a file part's bytes and its name without folders; InvalidPhoto or InvalidMask for text."""
    if not isinstance(part, UploadFile):
        fault = InvalidMask if field == "mask" else InvalidPhoto
        raise fault(f"expected a file, got text; send it as a file part (curl -F {field}=@FILE)", subject=field)
    name = PurePosixPath((part.filename or "").replace("\\", "/")).name
    return await part.read(), "".join(c for c in name if c.isprintable())[:120] or field


class Options:
    """Text fields by name, parsed to their values."""

    def __init__(self, form: FormData, query: QueryParams) -> None:
        self._form, self._query = form, query

    def texts(self, name: str) -> list[str]:
        texts = [text for text in self._form.getlist(name) if isinstance(text, str)] or self._query.getlist(name)
        return [text.strip() for text in texts if text.strip()]

    def text(self, name: str) -> str | None:
        texts = self.texts(name)
        if len(texts) > 1:
            raise InputError(f"expected one value, got {len(texts)}; send one", subject=name)
        return texts[0] if texts else None

    def numbers(self, name: str, expected: str, *counts: int) -> tuple[float, ...] | None:
        """Return the numbers between a field's commas, as many as one of `counts`; None where it is absent."""
        text = self.text(name)
        if text is None:
            return None
        numbers = numbers_in(text, *counts)
        if not numbers:
            raise InputError(f"expected {expected}, got {text[:60]!r}", subject=name)
        return numbers

    def include(self) -> frozenset[str]:
        parts = {word.strip() for text in self.texts("include") for word in text.split(",")}
        if unknown := parts - {"radiance", "stages", "mask"}:
            raise InputError(
                f"expected any of mask, radiance, stages, got {', '.join(sorted(unknown))[:60]!r}", subject="include"
            )
        return frozenset(parts)

    def hints(self, files: Mapping[str, bytes], *about: str) -> Hints:
        """Return the hints in texts and files, on these subjects only; all if none are named."""
        values: dict[str, Any] = dict(files)
        for field, hint in HINTS.items():
            if field in files or (about and hint.about not in about):
                continue
            if hint.repeated:
                values[field] = [hint.read(text) for text in self.texts(hint.name)]
            elif (text := self.text(hint.name)) is not None:
                values[field] = hint.read_word(text) if hint.suffixes else hint.read(text)
        return Hints(**values)

    def settings(self) -> dict[str, Any]:
        """Return the requested settings of the estimate."""
        asked = {}
        for name, choices in CHOICES.items():
            known, text = {str(one): one for one in choices}, self.text(name)
            if text not in (None, *known):
                advice = did_you_mean(text, known)
                raise InputError(f"expected one of {', '.join(known)}, got {str(text)[:60]!r}{advice}", subject=name)
            if text is not None:
                asked[name] = known[text]
        return asked
