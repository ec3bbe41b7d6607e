"""The library of `match`: a few numbers of each map of a folder, which the user's cache keeps until the map changes."""

import hashlib
import os
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from anyprobe.errors import AnyprobeError, InputError, OutputError
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import home_folder, natural_order
from anyprobe.maps.radiance import read_radiance
from anyprobe.match.likeness import MATCH_ROWS, light_of

_VERSION = 5
"""Version of what is kept; another is not read."""
_SUFFIXES = (".exr", ".hdr")
MOST_MAPS = 5000
"""Largest number of maps in a folder, subfolders included."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Library:
    """Maps that a light is compared with.

    Attributes:
        folder: that they are in.
        names: [N].
        files: paths of the N maps.
        stamps: path within the folder, size [bytes] and time of change [ns] of each.
        lights, levels: [N, 32, 64, 3] float32 and [N], see likeness.light_of.
        faults: a line for each file that could not be read.
    """

    folder: Path
    names: tuple[str, ...]
    files: tuple[Path, ...]
    stamps: tuple[str, ...]
    lights: np.ndarray
    levels: np.ndarray
    faults: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each fault."""
        return tuple(f"left out: {fault}" for fault in self.faults)


def open_library(folder: str | Path) -> Library:
    """Open the library of a folder of .exr and .hdr maps, subfolders included.

    Each file is read once (about a second for ten maps of 1,024 x 512), and again when its size or its time changes.
    Where the user's cache cannot be written, it is read each time.

    Raises:
        InputError: no folder, no map in it, or too many.
    """
    folder = Path(folder)
    if folder.suffix == ".zip" and folder.is_file():
        raise InputError("expected a folder of .exr or .hdr maps, got a ZIP archive; unpack it", source=folder)
    if not folder.is_dir():
        raise InputError("no such folder; name one of .exr or .hdr maps", source=folder)
    files, kept_in = _maps_in(folder), _cache_file(folder)
    known = {} if kept_in is None else _kept(kept_in)
    found: dict[Path, tuple[str, np.ndarray, float]] = {}
    faults = []
    for path in files:
        stamp = stamp_of(path, folder)
        try:
            found[path] = (stamp, *(known[stamp] if stamp in known else _read(path, folder)))
        except AnyprobeError as error:
            faults.append(" ".join(str(error).splitlines()))
    if not found:
        if faults:
            raise InputError(faults[0])
        raise InputError("expected .exr or .hdr maps in the folder, got none; check the path", source=folder)
    stamps, lights, levels = (list(parts) for parts in zip(*found.values(), strict=True))
    if kept_in is not None and stamps != list(known):
        with suppress(OutputError), atomic_path(kept_in) as temporary:
            np.savez_compressed(temporary, stamps=stamps, lights=np.stack(lights), levels=levels)
    stems = [path.relative_to(folder).with_suffix("").as_posix() for path in files]
    named = zip(files, stems, strict=True)
    names = {p: stem if stems.count(stem) == 1 else p.relative_to(folder).as_posix() for p, stem in named}
    return Library(
        folder=folder,
        names=tuple(names[path] for path in found),
        files=tuple(found),
        stamps=tuple(stamps),
        lights=np.stack(lights).astype(np.float32),
        levels=np.array(levels),
        faults=tuple(faults),
    )


def _maps_in(folder: Path) -> list[Path]:
    """Return the maps of a folder and its subfolders, without hidden ones, in natural order."""
    maps = (path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES)
    seen = (path for path in maps if not any(part.startswith(".") for part in path.relative_to(folder).parts))
    found = list(islice(seen, MOST_MAPS + 1))
    if len(found) > MOST_MAPS:
        raise InputError(f"expected at most {MOST_MAPS} maps, got more; name a folder within it", source=folder)
    return sorted(found, key=lambda path: natural_order(path.relative_to(folder).as_posix()))


def stamp_of(path: Path, folder: Path) -> str:
    """Return what changes with a file; of a link to nowhere, its name."""
    name = path.relative_to(folder).as_posix()
    with suppress(OSError):
        stat = path.stat()
        return f"{name} {stat.st_size} {stat.st_mtime_ns}"
    return name


def _read(path: Path, folder: Path) -> tuple[np.ndarray, float]:
    """Return a map's light and level; InputError if it cannot be compared."""
    radiance, name = read_radiance(path), path.relative_to(folder).as_posix()
    if len(radiance) < MATCH_ROWS:
        raise InputError(f"expected at least {MATCH_ROWS} rows, got {len(radiance)}; use a larger map", source=name)
    light, level = light_of(radiance)
    if not light.any():
        raise InputError("expected a map with light, got a black one; remove it from the library", source=name)
    return light.astype(np.float16), level


def _cache_file(folder: Path) -> Path | None:
    """Return where a folder's library is kept; None where nothing can be."""
    home = home_folder()
    base = os.environ.get("XDG_CACHE_HOME") or (home and home / ".cache")
    if base is None:
        return None
    name = hashlib.sha256(f"{_VERSION} {os.path.realpath(folder)}".encode(errors="surrogateescape")).hexdigest()[:16]
    return Path(base) / "anyprobe" / "maps" / f"{name}.npz"


def _kept(path: Path) -> dict[str, tuple[np.ndarray, float]]:
    """Return lights and levels by stamp; none of a file that is absent or damaged."""
    with (
        suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile),
        np.load(path, allow_pickle=False) as file,
    ):
        kept = zip(file["stamps"], file["lights"], file["levels"], strict=True)
        return {str(stamp): (light, level) for stamp, light, level in kept}
    return {}
