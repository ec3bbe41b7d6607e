"""Paths: the home folder, natural order, names of one file, and files that have an end."""

import os
import re
import stat
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from anyprobe.errors import InputError

MAX_BYTES = 2**31
"""Largest file [bytes] that is read whole."""

CHUNK_BYTES = 2**20
"""Number of bytes of a pipe that are read at a time."""


def home_folder() -> Path | None:
    """Return the user's home folder; None where the system has none, as for a container's user without an entry."""
    with suppress(RuntimeError, OSError, KeyError):
        return Path.home()
    return None


def is_there(path: Path) -> bool:
    """Return whether a file exists and is accessible; False too where a parent is a file, a loop or closed."""
    with suppress(OSError, RuntimeError, ValueError):
        return path.is_file()
    return False


def is_same_file(one: Path, other: Path) -> bool:
    """Return whether two names are of one file, on any disk: by links, or by a case that does not count there."""
    with suppress(OSError):  # one of them does not exist
        return os.path.samefile(one, other)
    return os.path.realpath(one) == os.path.realpath(other)


def natural_order(name: str) -> list[tuple[bool, int, str]]:
    """Return a key that sorts names by their numbers: frame_2 before frame_10."""
    parts = re.split(r"([0-9]+)", name)
    return [(part.isdecimal(), int(part[:4000]) if part.isdecimal() else 0, part) for part in parts]


def composed(name: str) -> str:
    """Return a name with composed letters, to compare: macOS may write the accents apart."""
    return unicodedata.normalize("NFC", name)


def visible_files(folder: Path, suffixes: Iterable[str]) -> list[Path]:
    """Return the files of a folder that have one of these lower-case suffixes, in natural_order, without hidden files.

    macOS leaves a ._NAME beside each NAME on shared drives.
    """
    known = tuple(suffixes)
    found = [p for p in folder.iterdir() if p.suffix.lower() in known and not p.name.startswith(".")]
    return sorted(found, key=lambda path: natural_order(path.name))


def absence_of(path: str | os.PathLike[str]) -> str:
    """Say that a file is absent, or that its name is an address; Path makes one slash of two."""
    is_address = re.match(r"[a-z][a-z0-9+]+:/", os.fspath(path), re.IGNORECASE)
    return "expected a file, got an address; download it first" if is_address else "no such file; check the path"


@contextmanager
def open_regular(path: str | os.PathLike[str], fault: type[InputError], what: str = "a file") -> Iterator[BinaryIO]:
    """Open a regular file for reading: pipes may never end, devices do not.

    Args:
        what: the expected kind of file, for messages.
    Raises:
        fault: there is no file, it is not a regular one, or it may not be read.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:
        raise fault(absence_of(path), source=path) from error
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
    """Read a regular file whole; fault, see open_regular, also where it exceeds max_bytes."""
    with open_regular(path, fault, what) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > max_bytes:
            raise fault(f"expected at most {max_bytes / 2**20:g} MiB, got {size / 2**20:.0f}; shrink it", source=name)
        return stream.read(size)


def read_stream(stream: BinaryIO, name: str, fault: type[InputError], max_bytes: int = MAX_BYTES) -> bytes:
    """Read a pipe to its end; fault where it exceeds max_bytes."""
    parts: list[bytes] = []
    size = 0
    while part := stream.read(CHUNK_BYTES):
        parts.append(part)
        size += len(part)
        if size > max_bytes:
            raise fault(f"expected at most {max_bytes / 2**20:g} MiB, got more; shrink it", source=name)
    return b"".join(parts)


def read_rest(stream: BinaryIO) -> bytes:
    """Read the rest of an open file, at most MAX_BYTES; read(n) would allocate n bytes at once."""
    return stream.read(min(os.fstat(stream.fileno()).st_size, MAX_BYTES))
