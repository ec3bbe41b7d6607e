"""The library of `match`: a few numbers of each map of a folder, in one file."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.match.likeness import MATCH_ROWS, light_of

_VERSION = 4
"""Version of a stored library; others are rebuilt."""


class Entry(NamedTuple):
    """A map of a library: light and level, see likeness.light_of; digest of its file."""

    name: str
    light: np.ndarray
    level: float
    digest: str


@dataclass(frozen=True, kw_only=True, slots=True)
class MapSource:
    """A file in a library's folder.

    Attributes:
        stamp: path within the folder, size [bytes] and time of change [ns].
        digest: SHA-256 of its bytes; empty if it cannot be read.
        fault: why it is not in the library; or empty.
    """

    stamp: tuple[str, int, int]
    digest: str
    fault: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Library:
    """Maps that a light is compared with.

    Attributes:
        path: the library's own file.
        names: [N].
        lights, levels: [N, 32, 64, 3] float32 and [N], see likeness.light_of.
        files: paths of the N maps.
        relative: the same within the folder.
        digests: SHA-256 of their bytes.
        faults: a line for each file that could not be read.
        unkept: a warning that it cannot be written; or empty.
    """

    path: Path
    names: tuple[str, ...]
    lights: np.ndarray
    levels: np.ndarray
    files: tuple[Path, ...] = ()
    relative: tuple[str, ...] = ()
    digests: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    unkept: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each fault."""
        return (*(f"left out: {fault}" for fault in self.faults), *([self.unkept] if self.unkept else []))


def entry_of(name: str, radiance: np.ndarray, digest: str = "") -> Entry:
    """Build the library's entry of a map [H, 2H, 3]; InputError if it has fewer rows than are compared."""
    if len(radiance) < MATCH_ROWS:
        raise InputError(f"expected at least {MATCH_ROWS} rows, got {len(radiance)}; use a larger map", source=name)
    light, level = light_of(radiance)
    if not light.any():
        raise InputError("expected a map with light, got a black one; remove it from the library", source=name)
    return Entry(name, light.astype(np.float16), level, digest)


def write_library(path: Path, entries: Iterable[Entry], sources: list[MapSource]) -> None:
    """Write the file of a library; the same maps give the same bytes.

    Args:
        sources: files of the folder that the entries come from; complete once the last entry is drawn.
    Raises:
        InputError: no maps. OutputError: cannot be written.
    """
    with atomic_path(path) as temporary:
        pack_library(temporary, entries, sources)


def pack_library(target: Path | io.BytesIO, entries: Iterable[Entry], sources: list[MapSource]) -> None:
    """Write the file of a library to a path or into memory, see write_library."""
    kept = list(entries)
    if not kept:
        raise InputError("expected at least one map, got none; check the folder", subject="library")
    index = {
        "version": _VERSION,
        "names": [entry.name for entry in kept],
        "levels": [entry.level for entry in kept],
        "digests": [entry.digest for entry in kept],
        "sources": [[list(source.stamp), source.digest, source.fault] for source in sources],
    }
    with zipfile.ZipFile(target, "w") as file:
        _put_array(file, "lights.npy", np.stack([entry.light for entry in kept]))
        _put(file, "index.json", json.dumps(index).encode())


def _put_array(file: zipfile.ZipFile, name: str, values: np.ndarray) -> None:
    stream = io.BytesIO()
    np.save(stream, values)
    _put(file, name, stream.getvalue())


def _put(file: zipfile.ZipFile, name: str, data: bytes) -> None:
    """Store data without a time stamp, so that the same library gives the same file."""
    file.writestr(zipfile.ZipInfo(name), data, compress_type=zipfile.ZIP_DEFLATED)


def stored_index(path: Path) -> dict[str, Any] | None:
    """Read the index of a file of this version; None where it is absent, damaged or of another version."""
    try:
        with zipfile.ZipFile(path) as file:
            return index_in(file)
    except (OSError, zipfile.BadZipFile):
        return None


def index_in(file: zipfile.ZipFile) -> dict[str, Any] | None:
    """Read the index of an open file; see stored_index."""
    try:
        index = json.loads(file.read("index.json"))
        return index if index["version"] == _VERSION and len(index["digests"]) == len(index["names"]) else None
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None


def lights_in(file: zipfile.ZipFile) -> np.ndarray:
    """Read the lights of a library's open file."""
    return np.load(io.BytesIO(file.read("lights.npy")))


def read_library(path: Path, stored: Path | io.BytesIO) -> Library:
    """Read a library; stored: its file, a path, or its bytes."""
    with zipfile.ZipFile(stored) as file:
        index, lights = json.loads(file.read("index.json")), lights_in(file)
    return Library(
        path=path,
        names=tuple(index["names"]),
        lights=lights.astype(np.float32),
        levels=np.array(index["levels"]),
        relative=tuple(stamp[0] for stamp, _, fault in index["sources"] if not fault),
        digests=tuple(index["digests"]),
        faults=tuple(fault for *_, fault in index["sources"] if fault),
    )
