"""OpenImageIO: pictures decoded from open files or bytes, and encoded to bytes.

Its Python binding opens files by name only. Bytes reach it through a file in memory, or a temporary one where the
system has no such files; so the name of a user's file, and its suffix, never matter.
"""

from __future__ import annotations

import errno
import os
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from OpenImageIO import ImageInput, ImageSpec
else:
    ImageInput = ImageSpec = Any

FILE_HANDLES = Path("/proc/self/fd")
"""Folder of Linux in which an open file has a name, whatever it was opened as."""

MOST_TILE_BYTES = 1 << 28
"""Largest tile [bytes] that is decoded: a small picture may claim one of gigabytes."""

HEADER_BYTES = 1 << 16
"""Number of bytes at the start of an OpenEXR file in which its channels are looked for."""

quiet: Callable[[], AbstractContextManager] = nullcontext
"""Context of calls of its decoders, some of which print about damaged files; a program that owns its process may
replace it."""

_opening = threading.Lock()
"""Held while the library is imported, and opens or closes a picture: a fork then would copy locks that it holds."""

if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_opening.acquire, after_in_parent=_opening.release, after_in_child=_opening.release)

DTYPES = {"float16": "half", "float32": "float", "uint8": "uint8", "uint16": "uint16"}
"""OpenImageIO's names of NumPy's types."""


@lru_cache(maxsize=1)
def library() -> Any:
    """Import OpenImageIO, without threads of its own: a process forked while they work would wait for ever."""
    with _opening:
        import OpenImageIO

    OpenImageIO.attribute("threads", 1)
    OpenImageIO.attribute("exr_threads", -1)
    return OpenImageIO


@contextmanager
def open_image(source: BinaryIO | bytes, kind: str) -> Iterator[ImageInput]:
    """Open a picture: its header is read, its pixels are not. Transparency stays apart from colour.

    Args:
        source: an open file, or bytes.
        kind: its format, by OpenImageIO's name.
    Raises:
        ValueError: it is damaged, or of another format.
    """
    oiio = library()
    as_stored = oiio.ImageSpec()
    for name in ("oiio:UnassociatedAlpha", "oiio:RawColor"):
        as_stored.attribute(name, 1)
    with _named(source) as path:
        with _opening, quiet():
            image = oiio.ImageInput.open(path, as_stored)
            if image is None and kind == "openexr":
                image = _open_subsampled(path)
            oiio.geterror()  # it prints errors that nobody asked for
        if image is None:
            raise ValueError("without a whole header")
        try:
            if image.format_name() != kind:
                raise ValueError(f"a {image.format_name()} file")
            yield image
        finally:
            with _opening:
                image.geterror()
                image.close()


def _open_subsampled(path: str) -> ImageInput | None:
    """Open an OpenEXR of luminance and less chroma as R, G, B, which OpenImageIO's newer reader refuses; None for any
    other."""
    oiio = library()
    with open(path, "rb") as stream:
        if b"\0RY\0" not in stream.read(HEADER_BYTES):
            return None
    oiio.attribute("openexr:core", 0)
    try:
        return oiio.ImageInput.open(path)
    finally:
        oiio.attribute("openexr:core", 1)


def read_pixels(image: ImageInput, channels: Sequence[int]) -> np.ndarray:
    """Read channels of an open picture's current part, as stored: [H, W, len(channels)].

    Raises:
        ValueError: it is damaged.
    """
    spec = image.spec()
    if spec.tile_bytes(True) > MOST_TILE_BYTES:
        raise ValueError("tiles too large")
    if list(channels) == list(range(channels[0], channels[-1] + 1)):
        if len({str(spec.channelformat(k)) for k in channels}) == 1:
            return _read(image, channels[0], channels[-1] + 1)
    return np.concatenate([_read(image, k, k + 1) for k in channels], axis=-1)


def _read(image: ImageInput, first: int, end: int) -> np.ndarray:
    kind = image.spec().channelformat(first)
    with quiet():
        pixels = image.read_image(image.current_subimage(), 0, first, end, kind)
    if pixels is None:
        raise ValueError(one_line(image.geterror()))
    return np.asarray(pixels).reshape(image.spec().height, image.spec().width, end - first)


def encode_image(pixels: np.ndarray, kind: str, attributes: Mapping[str, Any], names: Sequence[str] = ()) -> bytes:
    """Encode a picture [H, W, C] as a file's bytes.

    Args:
        kind: its format, by OpenImageIO's name.
        attributes: of the header: text, whole numbers, and tuples of floats.
        names: of the channels; R, G, B where there are none.
    Raises:
        OSError: there is no room for it, whole.
    """
    oiio = library()
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], DTYPES[pixels.dtype.name])
    if names:
        spec.channelnames = tuple(names)
    for name, value in attributes.items():
        if isinstance(value, tuple):
            spec.attribute(name, f"float[{len(value)}]", value)
        else:
            spec.attribute(name, value)
    with _named(b"", f".{kind}") as path:
        _write(path, kind, spec, pixels)
        encoded = Path(path).read_bytes()
    _check_end(encoded, kind)
    return encoded


def _write(path: str, kind: str, spec: Any, pixels: np.ndarray) -> None:
    """Write a file, whole once this function has ended."""
    with _opening:
        image = library().ImageOutput.create(kind)
    if not (image.open(path, spec) and image.write_image(np.ascontiguousarray(pixels)) and image.close()):
        raise _no_room(one_line(image.geterror()))


def _check_end(encoded: bytes, kind: str) -> None:
    """Raise OSError where the last row is missing: writers do not report what their last flush loses."""
    try:
        with open_image(encoded, kind) as image, quiet():
            spec = image.spec()
            end = spec.y + spec.height
            is_whole = image.read_scanlines(end - 1, end, 0, 0, spec.nchannels) is not None
    except ValueError as error:
        raise _no_room(str(error)) from error
    if not is_whole:
        raise _no_room("the end is missing")


def _no_room(report: str) -> OSError:
    return OSError(errno.EFBIG, f"{os.strerror(errno.EFBIG)}: {report}")


@contextmanager
def _named(source: BinaryIO | bytes, suffix: str = "") -> Iterator[str]:
    """Yield a path under which an open file, or a new file of these bytes, can be opened."""
    if not isinstance(source, bytes):
        with suppress(OSError, AttributeError):  # not a file of the system's
            if FILE_HANDLES.is_dir():
                yield str(FILE_HANDLES / str(source.fileno()))
                return
        source.seek(0)
        source = source.read()
    if hasattr(os, "memfd_create") and FILE_HANDLES.is_dir():
        with os.fdopen(os.memfd_create("anyprobe"), "wb") as stream:
            stream.write(source)
            stream.flush()
            yield str(FILE_HANDLES / str(stream.fileno()))
        return
    with tempfile.TemporaryDirectory(prefix="anyprobe-") as folder:
        path = Path(folder) / f"picture{suffix}"
        path.write_bytes(source)
        yield str(path)


def one_line(text: str) -> str:
    """Return a library's report as one short line, without the names of files in memory."""
    return " ".join(text.replace(str(FILE_HANDLES), "").split())[:120] or "damaged"
