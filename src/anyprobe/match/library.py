"""The library of `match`: 8-bit environment maps and a few smooth features of each, in one file.

A map is stored without its scale: divided by its geometric mean, and coded by a curve that has steps of a few
percent from a thousandth to a thousand times that mean. Its light sources need no more: their power is the estimate's.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.match.likeness import MATCH_ROWS, light_of

_ROWS = 512
"""Largest number of rows of a stored picture."""
FEATURE_ROWS = 16
EXPONENT, SIGMA = 0.6, 0.6
"""Parameters of the code x^n / (x^n + s): half of it lies below 0.43 of the mean, and 254 of 255 stands for 4,000."""
QUALITY = 90
"""Quality of the JPEG pictures."""
DARKEST = 1e-3
"""Radiance over the geometric mean that the smallest code stands for."""
PATTERN, SHADING = 12.0, 6.0
"""Sharpness (light.filtering) of the features' blurs: of ln radiance, roughly the detail of an estimate, orders up to
6; and of radiance itself, roughly the detail that a dull object shows."""
DETAIL = 48.0
"""Sharpness of the blur that separates an estimate from detail: exp(-l (l + 1) / 96) of order l, a half at order 8."""
_VERSION = 3
"""Version of a stored library; others are rebuilt."""


class Entry(NamedTuple):
    """A map of a library: picture as written by encode; light and level, see likeness.light_of; digest of its file."""

    name: str
    picture: bytes
    light: np.ndarray | None = None
    level: float = 1.0
    digest: str = ""


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
        features: [N, 16, 32, 4] float32, see features_of.
        richness: [N], see richness_of.
        lights, levels: [N, 32, 64, 3] float32 and [N], see likeness.light_of.
        files: paths of the N maps.
        relative: the same within the folder.
        digests: SHA-256 of their bytes.
        faults: a line for each file that could not be read.
        data: all bytes of the library's file, where that cannot be written.
        unkept: a warning that it cannot be written; or empty.
    """

    path: Path
    names: tuple[str, ...]
    features: np.ndarray
    richness: np.ndarray
    lights: np.ndarray
    levels: np.ndarray
    files: tuple[Path, ...] = ()
    relative: tuple[str, ...] = ()
    digests: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    data: bytes = field(default=b"", repr=False)
    unkept: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each fault."""
        return (*(f"left out: {fault}" for fault in self.faults), *([self.unkept] if self.unkept else []))

    def digest(self) -> str:
        """16 hexadecimal digits that identify its maps."""
        return hashlib.sha256(self.features.tobytes()).hexdigest()[:16]

    def candidate(self, index: int) -> np.ndarray:
        """Return the codes of a map, [H, 2H, 3] uint8, see decode; the last two are cached.

        Raises:
            InputError: the file was rewritten since it was opened and holds another map there.
        """
        return _picture(self.data or str(self.path), index, self.digests[index] if self.digests else "")


def features_of(radiance: np.ndarray) -> np.ndarray:
    """Compute the features [16, 32, 4] by which maps [H, 2H, 3] are compared: blurred ln radiance of each channel,
    and ln of blurred luminance."""
    small = np.maximum(reduced(radiance, FEATURE_ROWS), 1e-6)
    shading = blur_cosine_power(luminance(small)[..., None], SHADING)
    return np.concatenate([blur_cosine_power(np.log(small), PATTERN), np.log(shading)], axis=-1)


def encode(radiance: np.ndarray, name: str = "map") -> bytes:
    """Encode a map [H, 2H, 3] without its scale as a picture of codes; name: its name in errors.

    Raises:
        InputError: a map with next to no light.
    """
    small = reduced(radiance, _ROWS)
    weights = pixel_solid_angles(small.shape[0])
    bright = luminance(small)
    floor = DARKEST * float((bright * weights).sum() / (4 * np.pi))
    if not 0 < floor < np.inf:
        raise InputError("expected a map with light, got a black one; remove it from the library", source=name)
    mean = np.exp(float((np.log(np.maximum(bright, floor)) * weights).sum() / (4 * np.pi)))
    power = np.maximum(small / np.float32(mean), DARKEST) ** EXPONENT
    stream = io.BytesIO()
    picture = Image.fromarray(np.round(255.0 * power / (power + SIGMA)).astype(np.uint8))
    picture.save(stream, format="JPEG", quality=QUALITY, optimize=True)
    return stream.getvalue()


def codes_of(picture: bytes) -> np.ndarray:
    """Decode a picture to its codes [H, 2H, 3] uint8."""
    return np.asarray(Image.open(io.BytesIO(picture), formats=["JPEG"]))


def richness_of(code: np.ndarray) -> float:
    """Measure a map's detail: the standard deviation of its codes [H, 2H, 3], 0 to 1, in orders above 8 (to 32)."""
    small = reduced(code, 4 * FEATURE_ROWS)
    fine = small - blur_cosine_power(small, DETAIL)
    weights = pixel_solid_angles(len(fine))[..., None]
    return float(np.sqrt((fine**2 * weights).sum() / (12 * np.pi)))


@lru_cache(maxsize=1)
def decode() -> np.ndarray:
    """Return radiance over the map's geometric mean for every code, [256] float32."""
    share = np.minimum(np.arange(256), 254.5) / 255.0
    return np.maximum((SIGMA * share / (1.0 - share)) ** (1.0 / EXPONENT), DARKEST).astype(np.float32)


def entry_of(name: str, radiance: np.ndarray, digest: str = "") -> Entry:
    """Build the library's entry of a map [H, 2H, 3]; InputError if it has fewer rows than are compared."""
    if len(radiance) < MATCH_ROWS:
        raise InputError(f"expected at least {MATCH_ROWS} rows, got {len(radiance)}; use a larger map", source=name)
    light, level = light_of(radiance)
    return Entry(name, encode(radiance, name), light.astype(np.float16), level, digest)


def write_library(
    path: Path, entries: Iterable[Entry | tuple[str, bytes]], sources: list[MapSource] | None = None
) -> None:
    """Write the file of a library; the same maps give the same bytes.

    Args:
        entries: entries, or names and encoded pictures; lights are then computed from the pictures.
        sources: files of the folder that the entries come from; complete once the last entry is drawn.
    Raises:
        InputError: no maps. OutputError: cannot be written.
    """
    with atomic_path(path) as temporary:
        pack_library(temporary, entries, sources)


def pack_library(
    target: Path | io.BytesIO, entries: Iterable[Entry | tuple[str, bytes]], sources: list[MapSource] | None
) -> None:
    """Write the file of a library to a path or into memory, see write_library."""
    kept: list[Entry] = []  # without their pictures
    features: list[np.ndarray] = []
    richness: list[float] = []
    with zipfile.ZipFile(target, "w") as file:
        for fields in entries:
            entry = Entry(*fields)
            _put(file, f"{len(kept)}.jpg", entry.picture)
            codes = codes_of(entry.picture)
            features.append(features_of(decode()[codes]).astype(np.float16))
            richness.append(round(richness_of(codes / np.float32(255)), 4))
            kept.append(entry._replace(picture=b""))
        if not kept:
            raise InputError("expected at least one map, got none; check the folder", subject="library")
        _put_array(file, "features.npy", np.stack(features))
        lights = [entry.light for entry in kept if entry.light is not None]
        if len(lights) == len(kept):
            _put_array(file, "lights.npy", np.stack(lights))
        index = {
            "version": _VERSION,
            "names": [entry.name for entry in kept],
            "richness": richness,
            "levels": [entry.level for entry in kept],
            "digests": [entry.digest for entry in kept],
            "sources": [[list(source.stamp), source.digest, source.fault] for source in sources or []],
        }
        _put(file, "index.json", json.dumps(index).encode())


def _put_array(file: zipfile.ZipFile, name: str, values: np.ndarray) -> None:
    stream = io.BytesIO()
    np.save(stream, values)
    _put(file, name, stream.getvalue())


def _put(file: zipfile.ZipFile, name: str, data: bytes) -> None:
    """Store data without a time stamp, so that the same library gives the same file."""
    kind = zipfile.ZIP_STORED if name.endswith(".jpg") else zipfile.ZIP_DEFLATED
    file.writestr(zipfile.ZipInfo(name), data, compress_type=kind)


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


def lights_in(file: zipfile.ZipFile) -> np.ndarray | None:
    """Read the lights of a library's file; None for the bundled one, which has none."""
    return np.load(io.BytesIO(file.read("lights.npy"))) if "lights.npy" in file.namelist() else None


def read_library(path: Path, stored: Path | io.BytesIO) -> Library:
    """Read a library; stored: its file, a path, or its bytes."""
    with zipfile.ZipFile(stored) as file:
        index = json.loads(file.read("index.json"))
        if index["version"] != _VERSION:
            raise InputError(
                f"expected a library of version {_VERSION}, got {index['version']}; build it again", source=path
            )
        features = np.load(io.BytesIO(file.read("features.npy"))).astype(np.float32)
        count, lights = len(index["names"]), lights_in(file)
        if lights is None:  # from the pictures, whose light sources are cut off
            pictures = (file.read(f"{number}.jpg") for number in range(count))
            lights = np.stack([light_of(decode()[codes_of(picture)])[0] for picture in pictures])
    sources = index.get("sources", ())
    return Library(
        path=path,
        names=tuple(index["names"]),
        features=features,
        richness=np.array(index["richness"]),
        lights=lights.astype(np.float32),
        levels=np.array(index.get("levels", [1.0] * count)),
        relative=tuple(stamp[0] for stamp, _, fault in sources if not fault),
        digests=tuple(index.get("digests", ())),
        faults=tuple(fault for *_, fault in sources if fault),
    )


@lru_cache(maxsize=2)
def _picture(stored: str | bytes, index: int, digest: str) -> np.ndarray:
    with zipfile.ZipFile(stored if isinstance(stored, str) else io.BytesIO(stored)) as file:
        if digest and json.loads(file.read("index.json"))["digests"][index : index + 1] != [digest]:
            raise InputError(
                "expected the library as it was opened, got one rewritten since; open it again", source=stored
            )
        codes = codes_of(file.read(f"{index}.jpg"))
    codes.setflags(write=False)
    return codes
