"""Names of files: the user's own folder, the order people count in, libraries that take UTF-8 alone, files that end."""

from __future__ import annotations

import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

from anyprobe.errors import InputError, OutputError

MAX_BYTES = 2**31
"""Longest file that is read whole."""

CHUNK_BYTES = 2**20
"""Bytes of a pipe that are read at a time."""


def home_folder() -> Path | None:
    """Return the user's own folder; None where the system names none, as for a container's user without an entry."""
    try:
        return Path.home()
    except (RuntimeError, OSError, KeyError):
        return None


def is_there(path: Path) -> bool:
    """Return whether a file is there, and may be looked at; a folder above it may be a file, a loop or closed."""
    try:
        return path.is_file()
    except (OSError, RuntimeError, ValueError):
        return False


def same_file_key(path: Path) -> str:
    """Return what two names of one file have in common: links followed as far as they lead, case where it counts."""
    real = os.path.normcase(os.path.realpath(path))
    return real.casefold() if folds_case(Path(real).parent) else real


def folds_case(folder: Path) -> bool:
    """Return whether Name and name are one file there, as on Windows and macOS; the folder need not exist yet."""
    real = Path(os.path.realpath(folder))
    for one in (real, *real.parents):
        other = one.with_name(one.name.swapcase()) if one.name else one
        if other != one and os.path.exists(one):
            try:
                return os.path.samefile(one, other)
            except OSError:  # the other is not there
                return False
    return os.name == "nt"


def natural_order(name: str) -> list[tuple[bool, int, str]]:
    """Return a key to sort names by: frame_2 stands before frame_10."""
    return [
        (part.isdecimal(), int(part[:4000]) if part.isdecimal() else 0, part) for part in re.split(r"([0-9]+)", name)
    ]


def visible_files(folder: Path, suffixes: Iterable[str]) -> list[Path]:
    """Return the files of a folder that have one of these lower-case suffixes, in natural_order, without hidden files.

    macOS leaves a ._NAME beside each NAME on shared drives.
    """
    known = tuple(suffixes)
    found = [p for p in folder.iterdir() if p.suffix.lower() in known and not p.name.startswith(".")]
    return sorted(found, key=lambda path: natural_order(path.name))


@contextmanager
def open_regular(path: str | os.PathLike[str], fault: type[InputError], what: str = "a file") -> Iterator[BinaryIO]:
    """Return a file to read that has an end: a pipe may never get one, a device has none.

    what: it should be, for messages.

    Raises:
        fault: something else is there, or nothing, or it may not be read.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:
        raise fault("no such file; check the path", source=path) from error
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a pipe or device"
        raise fault(f"is {kind}, not {what}; name a file", source=path)
    try:
        with open(path, "rb") as stream:
            yield stream
    except OSError as error:
        raise fault(f"cannot be read ({error.strerror or error}); check the permissions", source=path) from error


def read_regular(
    path: str | os.PathLike[str], name: str, fault: type[InputError], what: str = "a file", max_bytes: int = MAX_BYTES
) -> bytes:
    """Return all bytes of open_regular; fault also where they are more."""
    with open_regular(path, fault, what) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > max_bytes:
            raise fault(f"expected at most {max_bytes / 2**20:g} MiB, got {size / 2**20:.0f}; shrink it", source=name)
        return stream.read(size)


def read_stream(stream: BinaryIO, name: str, fault: type[InputError], max_bytes: int = MAX_BYTES) -> bytes:
    """Read all bytes of a pipe, which may have no end; fault where they are more than max_bytes."""
    parts: list[bytes] = []
    size = 0
    while part := stream.read(CHUNK_BYTES):
        parts.append(part)
        size += len(part)
        if size > max_bytes:
            raise fault(f"{name}: expected at most {max_bytes / 2**20:g} MiB, got more; shrink it")
    return b"".join(parts)


def read_rest(stream: BinaryIO) -> bytes:
    """Read the rest of an open file, at most MAX_BYTES; read(n) would allocate n bytes at once."""
    return stream.read(min(os.fstat(stream.fileno()).st_size, MAX_BYTES))


@contextmanager
def utf8_path(path: str | os.PathLike[str]) -> Iterator[str]:
    """Return the path itself, or one that leads to it where its bytes are no UTF-8; to read from and to write to.

    The other is a symbolic link of the same suffix, in a folder of its own for as long as the block lasts.

    Raises:
        OutputError: no link can be made.
    """
    name = os.fspath(path)
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:  # bytes that Python keeps as surrogates
        with ExitStack() as stack:
            try:
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="anyprobe-"))
                link = Path(folder) / f"file{Path(name).suffix.encode('ascii', 'ignore').decode()}"
                link.symlink_to(os.path.abspath(name))
            except OSError as error:
                raise OutputError(
                    f"expected a name in UTF-8, got other bytes, and no link to it can be made "
                    f"({error.strerror or error}); rename it",
                    source=name,
                ) from error
            yield str(link)
    else:
        yield name
