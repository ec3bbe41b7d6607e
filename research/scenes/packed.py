"""Pairs made small enough to be carried to another machine: pictures as lossy WebP, some 7 KB a pair instead of 190.

python -m research.scenes.packed pack SCENES PACKED; python -m research.scenes.packed unpack PACKED SCENES.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from cyclopts.types import ExistingDirectory
from PIL import Image

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.cli.options import bounded
from anyprobe.core.response import inverse_response, response
from anyprobe.files.atomic import atomic_path

QUALITY = 92
"""WebP quality of display values."""
LN_MOST = 11.0
"""Largest ln radiance; what is above white is stored in 255 steps up to it."""
SMALL = ("tan_half", "up", "family", "scene")
"""Arrays that are stored as they are."""

app = new_app(__doc__)
Processes = Annotated[int, Parameter(help="Processes at once."), bounded(1)]


def encode(picture: np.ndarray, lossless: bool = False) -> bytes:
    """Return uint8 [H, W, 1, 3 or 4] as WebP; a fourth channel is kept exactly."""
    stream = io.BytesIO()
    mode = {1: "L", 3: "RGB", 4: "RGBA"}[picture.shape[2]]
    image = Image.fromarray(picture[..., 0] if picture.shape[2] == 1 else picture, mode)
    image.save(stream, "webp", quality=QUALITY, lossless=lossless, exact=True, method=4)
    return stream.getvalue()


def decode(blob: bytes, channels: int) -> np.ndarray:
    """Return what `encode` was given, [H, W, channels]."""
    mode = {1: "L", 3: "RGB", 4: "RGBA"}[channels]
    with Image.open(io.BytesIO(blob)) as image:
        return np.asarray(image.convert(mode)).reshape(image.height, image.width, channels)


def pack_pair(pair: dict[str, np.ndarray]) -> list[bytes]:
    """Return the pictures of one pair: crop, context, its last channel, surroundings, truth below and above white."""
    radiance = np.exp(pair["truth"].astype(np.float32)).transpose(1, 2, 0)
    shown = np.round(255 * response(radiance)).astype(np.uint8)
    above = np.round(255 * (np.log(np.maximum(radiance, 1.0)) / LN_MOST).clip(0, 1)).astype(np.uint8)
    return [
        encode(pair["image"]),
        encode(pair["context"][..., :4]),
        encode(pair["context"][..., 4:], lossless=True),
        encode(np.ascontiguousarray(pair["surroundings"].transpose(1, 2, 0))),
        encode(shown),
        encode(above, lossless=True),
    ]


def unpack_pair(blobs: list[bytes]) -> dict[str, np.ndarray]:
    """Return the pictures of a pair as research.scenes.pairs.Known has them."""
    image, context, present, around, shown, above = (
        decode(blob, channels) for blob, channels in zip(blobs, (4, 4, 1, 4, 3, 3), strict=True)
    )
    dim = inverse_response(np.minimum(shown / np.float32(255), np.float32(254 / 255)))
    ln = np.log(np.maximum(dim, np.exp(-9.0)))
    ln = np.where(above > 0, above * np.float32(LN_MOST / 255), np.minimum(ln, 0.0))
    cut = image[..., 3:] > 0
    return {
        "image": image * cut,
        "context": np.concatenate([context, present], axis=2),
        "surroundings": np.ascontiguousarray((around * (around[..., 3:] > 0)).transpose(2, 0, 1)),
        "truth": ln.transpose(2, 0, 1).astype(np.float16),
    }


def pack_file(out: Path, path: Path) -> Path:
    """Write the packed pairs of one file to out, if they are not there."""
    target = out / path.name
    if target.is_file():
        return target
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in (*SMALL, "image", "context", "surroundings", "truth")}
    pictures = [pack_pair({name: values[k] for name, values in arrays.items()}) for k in range(len(arrays["up"]))]
    sizes = np.array([[len(blob) for blob in blobs] for blobs in pictures], np.int32)
    joined = np.frombuffer(b"".join(blob for blobs in pictures for blob in blobs), np.uint8)
    with atomic_path(target) as temporary, open(temporary, "wb") as stream:
        np.savez(stream, sizes=sizes, pictures=joined, **{name: arrays[name] for name in SMALL})
    return target


def unpack_file(out: Path, path: Path) -> Path:
    """Write the pairs of one packed file to out, if they are not there."""
    target = out / path.name
    if target.is_file():
        return target
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in (*SMALL, "sizes", "pictures")}
    sizes, joined = arrays.pop("sizes"), arrays.pop("pictures").tobytes()
    ends = np.cumsum(sizes).reshape(sizes.shape)
    pairs = [
        unpack_pair([joined[e - n : e] for e, n in zip(ends_of, sizes_of, strict=True)])
        for ends_of, sizes_of in zip(ends, sizes, strict=True)
    ]
    pictures = {name: np.stack([pair[name] for pair in pairs]) for name in pairs[0]}
    with atomic_path(target) as temporary, open(temporary, "wb") as stream:
        np.savez(stream, **arrays, **pictures)
    return target


def _of_all(work, folder: Path, processes: int) -> Iterator[Path]:
    files = sorted(folder.glob("*.npz"))
    with ProcessPoolExecutor(processes) as pool:
        yield from pool.map(work, files)


@app.command()
def pack(scenes: ExistingDirectory, packed: Path, /, *, processes: Processes = 1) -> None:
    """Write small copies of pairs; goes on where it stopped."""
    packed.mkdir(parents=True, exist_ok=True)
    total = sum(path.stat().st_size for path in _of_all(partial(pack_file, packed), scenes, processes))
    print(f"{packed}: {total / 2**20:.1f} MiB")


@app.command()
def unpack(packed: ExistingDirectory, scenes: Path, /, *, processes: Processes = 1) -> None:
    """Write pairs from their small copies."""
    scenes.mkdir(parents=True, exist_ok=True)
    print(f"{scenes}: {sum(1 for _ in _of_all(partial(unpack_file, scenes), packed, processes))} files")


if __name__ == "__main__":
    run_command(app)
