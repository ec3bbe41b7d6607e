"""Libraries of folders of maps: each file is read once, into the user's cache."""

from __future__ import annotations

import hashlib
import io
import os
import time
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.files.paths import home_folder, natural_order, open_regular
from anyprobe.maps.radiance import read_radiance
from anyprobe.match.library import (
    Entry,
    Library,
    MapSource,
    entry_of,
    index_in,
    lights_in,
    pack_library,
    read_library,
    stored_index,
    write_library,
)

_SUFFIXES = (".exr", ".hdr")
MOST_MAPS = 5000
"""Largest number of maps in a folder, subfolders included."""
MOST_LIBRARIES = 32
"""Largest number of libraries in the cache; the least recently used is deleted."""


def open_library(folder: str | Path) -> Library:
    """Open the library of a folder of .exr and .hdr maps, subfolders included.

    Each file is read once (about a second for ten maps of 1,024 x 512) into a file of the user's cache. A file that
    changed, by its size and time or by its name, is read again, unless one with the same bytes is already there.
    Where the cache cannot be written, the library is kept in memory only.

    Raises:
        InputError: no folder, no map in it, or too many.
    """
    folder = Path(folder)
    if folder.suffix == ".zip" and folder.is_file():
        raise InputError("expected a folder of .exr or .hdr maps, got a ZIP archive; unpack it", source=folder)
    if not folder.is_dir():
        raise InputError("no such folder; name one of .exr or .hdr maps", source=folder)
    stamps = _stamps(folder)
    name = hashlib.sha256(os.path.realpath(folder).encode(errors="surrogateescape")).hexdigest()[:16]
    path = _cache_folder() / f"{name}.zip"
    before = stored_index(path)
    try:
        if before is None or not _is_current(before, folder, stamps):
            sources: list[MapSource] = []
            write_library(path, _entries(folder, stamps, path, sources), sources)
            with suppress(OSError):
                _make_room(path)
        found = _opened(path, path.stat().st_mtime_ns, tuple(stamps))
    except OSError:
        found = _in_memory(path, folder, tuple(stamps))
    with suppress(OSError):
        os.utime(path, ns=(time.time_ns(), path.stat().st_mtime_ns))  # for _make_room
    return replace(found, files=tuple(folder / path for path in found.relative))


def _stamps(folder: Path) -> list[tuple[str, int, int]]:
    """Return name, size and time of all maps in a folder and its subfolders, without hidden ones."""
    found: list[Path] = []
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        found += [Path(place, name) for name in names if name.lower().endswith(_SUFFIXES) and not name.startswith(".")]
        if len(found) > MOST_MAPS:
            raise InputError(f"expected at most {MOST_MAPS} maps, got more; name a folder within it", source=folder)
    stamps = []
    for path in found:
        size, changed = 0, 0  # a link to nowhere
        with suppress(OSError):
            stat = path.stat()
            size, changed = stat.st_size, stat.st_mtime_ns
        stamps.append((path.relative_to(folder).as_posix(), size, changed))
    return sorted(stamps, key=lambda stamp: natural_order(stamp[0]))


def _is_current(before: dict[str, Any], folder: Path, stamps: Sequence[tuple[str, int, int]]) -> bool:
    """Return whether a folder still has a library's files, and those that could not be read still cannot."""
    if [stamp for stamp, *_ in before["sources"]] != [list(stamp) for stamp in stamps]:
        return False
    return not any(_is_readable(folder / stamp[0]) for stamp, digest, _ in before["sources"] if not digest)


def _is_readable(path: Path) -> bool:
    try:
        with open_regular(path, InputError):
            return True
    except InputError:
        return False


def _entries(
    folder: Path, stamps: Sequence[tuple[str, int, int]], path: Path, sources: list[MapSource]
) -> Iterator[Entry]:
    """Yield all readable maps of a folder, taken from the previous library where their bytes are the same.

    sources: list to fill. InputError where none can be read.
    """
    with ExitStack() as stack:  # keep one file open: another program may replace it
        file = None
        with suppress(OSError, zipfile.BadZipFile):
            file = stack.enter_context(zipfile.ZipFile(path))
        before = (None if file is None else index_in(file)) or {"sources": [], "digests": []}
        known = {tuple(stamp): (digest, fault) for stamp, digest, fault in before["sources"] if digest}
        kept = {digest: number for number, digest in enumerate(before["digests"])}
        lights = lights_in(file) if file is not None and kept else None
        stems = [stamp[0].rpartition(".")[0] for stamp in stamps]
        for stamp, stem in zip(stamps, stems, strict=True):
            name = stem if stems.count(stem) == 1 else stamp[0]
            (digest, fault), entry = known.get(stamp, ("", "")), None
            try:
                digest = digest or _digest(folder / stamp[0])
                if digest in kept and lights is not None and file is not None:
                    number = kept[digest]
                    entry = Entry(name, lights[number], before["levels"][number], digest)
                elif not fault:
                    entry = entry_of(stamp[0], read_radiance(folder / stamp[0]), digest)._replace(name=name)
            except AnyprobeError as error:
                fault = " ".join(str(error).splitlines())
            sources.append(MapSource(stamp=stamp, digest=digest, fault=fault))
            if entry is not None:
                yield entry
        faults = [source.fault for source in sources if source.fault]
        if len(faults) == len(sources) > 0:
            raise InputError(faults[0])
        if not sources:
            raise InputError("expected .exr or .hdr maps in the folder, got none; check the path", source=folder)


def _digest(path: Path) -> str:
    with open_regular(path, InputError) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()  # type: ignore[arg-type]  # any binary file has readinto


def check_unchanged(library: Library, index: int) -> None:
    """Raise InputError if the file of a map has changed since the library read it."""
    if _digest(library.files[index]) != library.digests[index]:
        raise InputError(
            "expected the map that was compared, got another; run match again", source=library.files[index]
        )


def _make_room(path: Path) -> None:
    """Delete the least recently used libraries of the cache, but not this one."""
    others = [other for other in path.parent.glob("*.zip") if other != path]
    for old in sorted(others, key=lambda other: other.stat().st_atime)[: -(MOST_LIBRARIES - 1)]:
        old.unlink(missing_ok=True)


def _cache_folder() -> Path:
    home = home_folder()
    nowhere = Path(os.devnull)  # where nothing can be kept
    base = os.environ.get("XDG_CACHE_HOME") or (nowhere if home is None else home / ".cache")
    return Path(base) / "anyprobe" / "maps"


@lru_cache(maxsize=4)
def _opened(path: Path, changed_ns: int, stamps: tuple = ()) -> Library:
    """Open a library; cached while its file and its folder's stamps are unchanged."""
    return read_library(path, path)


@lru_cache(maxsize=4)
def _in_memory(path: Path, folder: Path, stamps: tuple) -> Library:
    """Build the library of a folder in memory, where its file cannot be written."""
    sources: list[MapSource] = []
    data = io.BytesIO()
    pack_library(data, _entries(folder, stamps, path, sources), sources)
    unkept = f"{path.parent}: cannot be written, so maps are read again each time; set XDG_CACHE_HOME to another folder"
    return replace(read_library(path, data), unkept=unkept)
