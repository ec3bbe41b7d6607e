"""What a request carries: a photo as the body or as a form's part, and options beside it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from starlette.datastructures import FormData, QueryParams, UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request

from anyprobe.errors import InputError, InvalidMask, InvalidPhoto
from anyprobe.estimate.normals_prior import SPHERE
from anyprobe.estimate.surroundings import PHOTO
from anyprobe.files.images import declared_pixels
from anyprobe.serve.limits import Limits
from anyprobe.serve.openapi import FORM, form_names, query_names

UNREAD_S = 5.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Upload:
    """A photo and what was said about it.

    Attributes:
        photo: the file's bytes, as sent.
        name: file name without folders, for messages; "photo" where none came.
        mask: bytes of a mask picture; normals: of a picture of the object's normals, or "sphere";
        surroundings: of a panorama in the camera's frame, or "photo".
        box: X0, Y0, X1, Y1 in pixels of the upright photo.
        clicks: x, y on the object, in pixels of the upright photo.
        clicks_off: likewise beside it.
        fov_deg: field of view of the longer side.
        material: name of the object's; albedo: its linear albedo, one number or three.
        emitters: how they are asked for, of estimate.runtime.EMITTERS.
        include: what the JSON answer shall carry besides: "radiance", "stages", "mask".
        exposure: stops that an export is brightened by.
        world_from_camera: what an export is turned by: 2 or 3 angles in degrees, or 9 numbers of a matrix.
    """

    photo: bytes
    name: str = "photo"
    mask: bytes | None = None
    normals: bytes | str | None = None
    surroundings: bytes | str | None = None
    box: tuple[float, ...] | None = None
    clicks: tuple[tuple[float, float], ...] = ()
    clicks_off: tuple[tuple[float, float], ...] = ()
    fov_deg: float | None = None
    material: str | None = None
    albedo: tuple[float, ...] | None = None
    emitters: str | None = None
    include: frozenset[str] = frozenset()
    exposure: float | None = None
    world_from_camera: tuple[float, ...] | None = None


async def take_unread(request: Request) -> None:
    """Take the body of a request that is sent away, and forget it, for at most UNREAD_S.

    An answer while the body still comes closes the connection on it, and some clients then never see the answer.
    """
    with contextlib.suppress(TimeoutError, ClientDisconnect, HTTPException):
        async with asyncio.timeout(UNREAD_S):
            async for _ in request.stream():
                pass


async def read_upload(request: Request, limits: Limits, address: dict[str, Any]) -> Upload:
    """Read a photo and its options; options of the form win over those of the address.

    Args:
        address: what serve.openapi says of it; what it does not name is refused.
    Raises:
        HTTPException: 408 too slow, 413 too many pixels.
        InputError: no photo came, or an option that is unknown or cannot be read.
    """
    name, mask, normals, surroundings_map = "photo", b"", b"", b""
    async with read_form(request, limits, max_files=4) as form:
        if request.headers.get("content-type", "").startswith(FORM):
            photo, name = await _file(form, "photo")
            mask, _ = await _file(form, "mask")
            if not isinstance(form.get("normals"), str):
                normals, _ = await _file(form, "normals")
            if not isinstance(form.get("surroundings"), str):
                surroundings_map, _ = await _file(form, "surroundings")
        else:
            photo = await request.body()
    refuse_unknown(form, request.query_params, address)
    if not photo:
        raise InvalidPhoto(
            "photo: expected an image as the body, or as the form's part 'photo', got nothing; send one"
        )
    for picture, called in (
        (photo, name),
        (mask, "mask"),
        (normals, "normals"),
        (surroundings_map, "surroundings"),
    ):
        await check_pixels(picture, called, limits)
    option = Options(form, request.query_params)
    return Upload(
        photo=photo,
        name=name,
        mask=mask or None,
        normals=normals or option.word("normals", SPHERE),
        surroundings=surroundings_map or option.word("surroundings", PHOTO),
        box=option.numbers("box", 4),
        clicks=option.points("click"),
        clicks_off=option.points("click_off"),
        exposure=option.number("exposure"),
        world_from_camera=option.turn("world_from_camera"),
        **option.of_light(),
    )


@asynccontextmanager
async def read_form(request: Request, limits: Limits, max_files: int) -> AsyncIterator[FormData]:
    """The request's form, an empty one where it has another body; what is read within is timed too.

    Raises:
        HTTPException: 408 too slow.
    """
    form = FormData()
    try:
        async with asyncio.timeout(limits.upload_s):
            if request.headers.get("content-type", "").startswith(FORM):
                form = await request.form(max_files=max_files, max_fields=32)
            yield form
    except TimeoutError as error:
        raise HTTPException(
            408, f"expected the whole body within {limits.upload_s:g} seconds; send a smaller photo"
        ) from error
    finally:
        await form.close()


def refuse_unknown(form: FormData, query: QueryParams, address: dict[str, Any]) -> None:
    """InputError for a name that nothing reads: a mistyped option would be left out without a word."""
    read = (
        ("form field", form, form_names(address)),
        ("query parameter", query, query_names(address)),
    )
    for kind, given, known in read:
        for name in given:
            if name not in known:
                wanted = f"one of {', '.join(known)}" if known else "none here"
                raise InputError(f"{kind}: expected {wanted}, got {name[:60]!r}")


async def check_pixels(picture: bytes, called: str, limits: Limits) -> None:
    """HTTPException 413 where a picture's header tells of too many pixels.

    In a thread: of an .exr it waits for those that are being decoded.
    """
    if picture and await asyncio.to_thread(declared_pixels, picture) > limits.max_pixels:
        raise HTTPException(
            413, f"{called}: expected at most {limits.max_pixels / 1e6:g} million pixels; shrink it first"
        )


async def _file(form: FormData, field: str) -> tuple[bytes, str]:
    part = form.get(field)
    return (b"", field) if part is None else await read_part(part, field)


async def read_part(part: UploadFile | str, field: str) -> tuple[bytes, str]:
    """A file part's bytes and its name without folders; InvalidPhoto or InvalidMask if it is text."""
    if not isinstance(part, UploadFile):
        fault = InvalidMask if field == "mask" else InvalidPhoto
        raise fault(f"{field}: expected a file, got text; send it as a file part (curl -F {field}=@FILE)")
    name = PurePosixPath((part.filename or "").replace("\\", "/")).name
    return await part.read(), "".join(c for c in name if c.isprintable())[:120] or field


class Options:
    """Text fields by name, read as what they mean."""

    def __init__(self, form: FormData, query: QueryParams) -> None:
        self._form, self._query = form, query

    def texts(self, name: str) -> list[str]:
        hints = [text for text in self._form.getlist(name) if isinstance(text, str)]
        return [text.strip() for text in hints or self._query.getlist(name) if text.strip()]

    def number(self, name: str) -> float | None:
        found = self.numbers(name, 1)
        return None if found is None else found[0]

    def text(self, name: str) -> str | None:
        texts = self.texts(name)
        return texts[-1] if texts else None

    def word(self, name: str, known: str) -> str | None:
        text = self.text(name)
        if text not in (None, known):
            raise InvalidPhoto(f"{name}: expected a file part or {known}, got {text[:60]!r}")
        return text

    def numbers(self, name: str, *counts: int) -> tuple[float, ...] | None:
        text = self.text(name)
        return None if text is None else parse_numbers(name, text, *counts)

    def turn(self, name: str) -> tuple[float, ...] | None:
        text = self.text(name)
        shape = "YAW,ELEVATION[,ROLL] in degrees or nine numbers"
        return None if text is None else parse_numbers(name, text, 2, 3, 9, shape=shape)

    def points(self, name: str) -> tuple[tuple[float, float], ...]:
        return tuple(parse_numbers(name, text, 2) for text in self.texts(name))

    def words(self, name: str, known: set[str]) -> frozenset[str]:
        found = {word.strip() for text in self.texts(name) for word in text.split(",")}
        if found - known:
            raise InvalidPhoto(f"{name}: expected any of {', '.join(sorted(known))}, got {found - known}")
        return frozenset(found)

    def of_light(self) -> dict[str, Any]:
        """What concerns the light and not where the object is, as Upload has it."""
        return {
            "fov_deg": self.number("fov"),
            "material": self.text("material"),
            "albedo": self.numbers("albedo", 1, 3),
            "emitters": self.text("emitters"),
            "include": self.words("include", {"radiance", "stages", "mask"}),
        }


def parse_numbers(name: str, text: str, *counts: int, shape: str | None = None) -> tuple[float, ...]:
    """So many finite numbers with commas between; InvalidPhoto, which says their shape, if they are not."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) not in counts or not all(abs(number) < 1e6 for number in found):  # NaN fails too
        shapes = {1: "a number", 2: "X,Y in pixels", 3: "R,G,B", 4: "X0,Y0,X1,Y1 in pixels"}
        shape = shape or " or ".join(shapes[count] for count in counts)
        raise InvalidPhoto(f"{name}: expected {shape}, got {text[:60]!r}")
    return found
