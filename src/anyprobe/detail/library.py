"""The detail library: 8-bit environment maps and a few smooth features of each, in one file.

A map is kept without a scale of its own: divided by its geometric mean, and coded by a curve that has steps of a few
percent from a thousandth to a thousand times that mean. Its light sources need no more: their power is the estimate's.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import AnyprobeError, InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import visible_files
from anyprobe.files.radiance import read_radiance
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cosine_power

SUFFIXES = (".exr", ".hdr")
ROWS = 512
"""The most rows of a picture."""
FEATURE_ROWS = 16
EXPONENT, SIGMA = 0.6, 0.6
"""Parameters of the code x^n / (x^n + s): half of it lies below 0.43 of the mean, and 254 of 255 stands for 4,000."""
QUALITY = 90
"""Quality of the JPEG pictures."""
DARKEST = 1e-3
"""Radiance over the geometric mean below which all is black."""
PATTERN, SHADING = 12.0, 6.0
"""Sharpness (light.filtering) of the blurs of the features: of ln radiance, about what an estimate holds of it, orders
up to 6; and of radiance itself, about what a dull object shows of it."""
DETAIL = 48.0
"""Sharpness of the blur that separates an estimate from detail: exp(-l (l + 1) / 96) of order l, a half at order 8."""
VERSION = 1
"""Version of the file; another is made anew."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Library:
    """Candidates for the detail of a map.

    path: the file. names [N]; features [N, 16, 32, 4] float32, see features_of; richness [N], see richness_of.
    """

    path: Path
    names: tuple[str, ...]
    features: np.ndarray
    richness: np.ndarray

    def digest(self) -> str:
        """16 hexadecimal digits that identify its maps."""
        return hashlib.sha256(self.features.tobytes()).hexdigest()[:16]

    def candidate(self, index: int) -> np.ndarray:
        """Codes of a map, [H, 2H, 3] uint8, the last two kept for the next call; see decode."""
        return _picture(str(self.path), index)


def features_of(radiance: np.ndarray) -> np.ndarray:
    """What maps are compared by, [16, 32, 4] of [H, 2H, 3]: blurred ln radiance of each channel, and ln of blurred
    luminance."""
    small = np.maximum(reduced(radiance, FEATURE_ROWS), 1e-6)
    shading = blur_cosine_power(luminance(small)[..., None], SHADING)
    return np.concatenate([blur_cosine_power(np.log(small), PATTERN), np.log(shading)], axis=-1)


def encode(radiance: np.ndarray) -> bytes:
    """A map [H, 2H, 3] without its scale as a picture of its codes.

    Raises:
        InputError: next to no light.
    """
    small = reduced(radiance, ROWS)
    weights = pixel_solid_angles(small.shape[0])
    bright = luminance(small)
    floor = DARKEST * float((bright * weights).sum() / (4 * np.pi))
    if not 0 < floor < np.inf:
        raise InputError("expected light, got a black map; take it out of the library")
    mean = np.exp(float((np.log(np.maximum(bright, floor)) * weights).sum() / (4 * np.pi)))
    power = np.maximum(small / np.float32(mean), DARKEST) ** EXPONENT
    stream = io.BytesIO()
    picture = Image.fromarray(np.round(255.0 * power / (power + SIGMA)).astype(np.uint8))
    picture.save(stream, format="JPEG", quality=QUALITY, optimize=True)
    return stream.getvalue()


def codes_of(picture: bytes) -> np.ndarray:
    """Codes [H, 2H, 3] uint8 of a picture."""
    return np.asarray(Image.open(io.BytesIO(picture), formats=["JPEG"]))


def richness_of(code: np.ndarray) -> float:
    """How much detail a map has: the deviation of its codes [H, 2H, 3], 0 to 1, in orders above 8 (to 32)."""
    small = reduced(code, 4 * FEATURE_ROWS)
    fine = small - blur_cosine_power(small, DETAIL)
    weights = pixel_solid_angles(len(fine))[..., None]
    return float(np.sqrt((fine**2 * weights).sum() / (12 * np.pi)))


@lru_cache(maxsize=1)
def decode() -> np.ndarray:
    """Radiance over the map's geometric mean of every code, [256] float32."""
    share = np.minimum(np.arange(256), 254.5) / 255.0
    return np.maximum((SIGMA * share / (1.0 - share)) ** (1.0 / EXPONENT), DARKEST).astype(np.float32)


def write_library(path: Path, pictures: Iterable[tuple[str, bytes]], signature: str = "") -> None:
    """Write the file of a library of names and pictures, see encode; the same pictures give the same bytes.

    Raises:
        InputError: no maps. OutputError: cannot be written.
    """
    names, features, richness = [], [], []
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as file:
        for name, picture in pictures:
            _put(file, f"{len(names)}.jpg", picture)
            codes = codes_of(picture)
            names.append(name)
            features.append(features_of(decode()[codes]).astype(np.float16))
            richness.append(round(richness_of(codes / np.float32(255)), 4))
        if not names:
            raise InputError("library: expected at least one map, got none; check the folder")
        stream = io.BytesIO()
        np.save(stream, np.stack(features))
        _put(file, "features.npy", stream.getvalue())
        index = {"version": VERSION, "signature": signature, "names": names, "richness": richness}
        _put(file, "index.json", json.dumps(index).encode())


def _put(file: zipfile.ZipFile, name: str, data: bytes) -> None:
    """Without the time of day, so that the same library is the same file."""
    kind = zipfile.ZIP_STORED if name.endswith(".jpg") else zipfile.ZIP_DEFLATED
    file.writestr(zipfile.ZipInfo(name), data, compress_type=kind)


def open_library(folder: str | Path | None = None) -> Library:
    """The library of a folder of .exr and .hdr maps, or for None the project's own rooms, skies and studios.

    A folder is read once (about a second for ten maps of 1,024 x 512) into a file of the user's cache, and again when
    its files change.

    Raises:
        InputError: no folder, or no map in it. OutputError: the cache cannot be written.
    """
    if folder is None:
        return _opened(Path(str(resources.files("anyprobe.detail") / "own.zip")), "")
    folder = Path(folder)
    if folder.suffix == ".zip" and folder.is_file():
        return _opened(folder, "")
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name one of .exr or .hdr maps")
    files = visible_files(folder, SUFFIXES)
    stats = [(file.name, stat.st_size, stat.st_mtime_ns) for file in files for stat in [file.stat()]]
    signature = hashlib.sha256(json.dumps(stats).encode()).hexdigest()
    name = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:16]
    path = _cache_folder() / f"{name}.zip"
    try:
        return _opened(path, signature)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        write_library(path, _readable(folder, files), signature)
    return _opened(path, signature)


def _readable(folder: Path, files: list[Path]) -> Iterator[tuple[str, bytes]]:
    """Pictures of all maps of a folder that can be read; the first one's error where none can."""
    found, fault = 0, None
    for file in files:
        try:
            picture = encode(read_radiance(file))
        except AnyprobeError as error:
            fault = fault or error
            continue
        found += 1
        yield file.stem, picture
    if not found:
        raise fault or InputError(f"{folder}: no .exr or .hdr maps in this folder; check the path")


def _cache_folder() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "anyprobe" / "detail"


@lru_cache(maxsize=4)
def _opened(path: Path, signature: str) -> Library:
    """The library of a file; an error of Python's where it is absent, damaged or of other maps."""
    with zipfile.ZipFile(path) as file:
        index = json.loads(file.read("index.json"))
        if index["version"] != VERSION or index["signature"] != signature:
            raise ValueError("made of other maps")
        features = np.load(io.BytesIO(file.read("features.npy"))).astype(np.float32)
    richness = np.array(index["richness"])
    return Library(path=path, names=tuple(index["names"]), features=features, richness=richness)


@lru_cache(maxsize=2)
def _picture(path: str, index: int) -> np.ndarray:
    with zipfile.ZipFile(path) as file:
        codes = codes_of(file.read(f"{index}.jpg"))
    codes.setflags(write=False)
    return codes
