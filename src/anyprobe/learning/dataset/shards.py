"""Shards: tars of samples in WebDataset's order, each with an index that is written last.

shard-000000.tar holds <key>.photo.png, <key>.irradiance.png, <key>.normals.png, <key>.json, the next key, and so on.
shard-000000.json beside it is written last: names, offsets and sizes, and the tar's SHA-256.
The same samples give the same bytes: no times, owners or paths are stored.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tarfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError, OutputError
from anyprobe.files.atomic import atomic_path
from anyprobe.learning.dataset.recipe import Recipe
from anyprobe.learning.dataset.samples import DATASET_FORMAT, SAMPLE_ARRAYS, Sample, decode_part

_BLOCK = 512
_TEMPORARY = re.compile(r"^\.(shard-\d{6}|dataset)-[0-9a-f]{8}\.(tar|json)$")


@dataclass(frozen=True, kw_only=True, slots=True)
class ShardIndex:
    """Contents of a shard: parts[key][name] = (offset, size) of the bytes inside the tar."""

    shard: int
    size: int
    sha256: str
    groups: dict[str, int]
    parts: dict[str, dict[str, tuple[int, int]]]

    @property
    def pairs(self) -> int:
        """Number of samples."""
        return len(self.parts)


def tar_path(folder: Path, shard: int) -> Path:
    """Return the path of a shard's tar, shard-000000.tar."""
    return folder / f"shard-{shard:06}.tar"


def index_path(folder: Path, shard: int) -> Path:
    """Return the path of a shard's index, shard-000000.json."""
    return folder / f"shard-{shard:06}.json"


def is_temporary(path: Path) -> bool:
    """Return whether a file was left unfinished by a writer."""
    return bool(_TEMPORARY.match(path.name))


def remove_temporaries(folder: Path) -> None:
    """Delete the unfinished files of killed writers in a folder."""
    for path in list(folder.iterdir()):
        if is_temporary(path):
            path.unlink(missing_ok=True)


def write_shard(folder: Path, shard: int, samples: Iterable[Sample]) -> ShardIndex:
    """Write a shard and then its index, each whole or not at all.

    A shard that is already there loses its index first, so that at no moment an index
    stands beside a tar that it does not describe.

    Raises:
        OutputError: the folder cannot be written.
        ValueError: two samples of one name, or a name that WebDataset would split elsewhere.
    """
    remove_shard(folder, shard, index_only=True)
    digest, offset = hashlib.sha256(), 0
    groups: Counter[str] = Counter()
    parts: dict[str, dict[str, tuple[int, int]]] = {}
    with atomic_path(tar_path(folder, shard)) as temporary, temporary.open("wb") as stream:

        def write(block: bytes) -> None:
            nonlocal offset
            stream.write(block)
            digest.update(block)
            offset += len(block)

        for sample in samples:
            if sample.key in parts or "." in sample.key:
                raise ValueError(f"shard {shard}: expected keys without dots, each once, got {sample.key!r}")
            groups.update(sample.groups)
            parts[sample.key] = {}
            for name, data in sample.parts.items():
                write(_header(f"{sample.key}.{name}", len(data)))
                parts[sample.key][name] = (offset, len(data))
                write(data + bytes(-len(data) % _BLOCK))
        end = 2 * _BLOCK
        write(bytes(end + -(offset + end) % tarfile.RECORDSIZE))
        stream.flush()
        os.fsync(stream.fileno())
    index = ShardIndex(
        shard=shard, size=offset, sha256=digest.hexdigest(), groups=dict(sorted(groups.items())), parts=parts
    )
    write_durably(index_path(folder, shard), _index_text(index))
    return index


def write_durably(path: Path, text: str, *, new: bool = False) -> None:
    """Write a small file whole, and return once it will survive a power cut.

    Raises:
        InputError: it is to be new, and there is one, for instance of a process that was a moment faster.
    """
    with atomic_path(path) as temporary:
        with temporary.open("w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        if new:
            _claim(path, temporary)
    if hasattr(os, "O_DIRECTORY"):
        descriptor = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        with suppress(OSError):  # some shared file systems do not sync folders
            os.fsync(descriptor)
        os.close(descriptor)


def _claim(path: Path, content: Path) -> None:
    """Give a file its name unless the name is taken; of several processes one succeeds."""
    try:
        try:
            os.link(content, path)
        except FileExistsError:
            raise
        except OSError:  # a file system without links: the name first, its content by a rename a moment later
            path.touch(exist_ok=False)
    except FileExistsError as error:
        raise InputError(
            "expected no such file, but another process has just written it; "
            "continue that dataset, or choose another folder",
            source=path,
        ) from error


def remove_shard(folder: Path, shard: int, *, index_only: bool = False) -> None:
    """Delete a shard, its index first."""
    paths = [index_path(folder, shard)] + ([] if index_only else [tar_path(folder, shard)])
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be deleted ({error.strerror}); check its permissions", source=path) from error


def _header(name: str, size: int) -> bytes:
    info = tarfile.TarInfo(name)
    info.size, info.mode = size, 0o644
    return info.tobuf(format=tarfile.USTAR_FORMAT)


def _index_text(index: ShardIndex) -> str:
    head = {
        "format": DATASET_FORMAT,
        "shard": index.shard,
        "size": index.size,
        "sha256": index.sha256,
        "groups": index.groups,
    }
    lines = [f"{json.dumps(key)}: {json.dumps(parts)}" for key, parts in index.parts.items()]
    return json.dumps(head)[:-1] + ', "pairs": {\n' + ",\n".join(lines) + "\n}}\n"


def read_index(folder: Path, shard: int) -> ShardIndex:
    """Read the index of a shard; InputError if it is absent or damaged."""
    path = index_path(folder, shard)
    try:
        text = path.read_text(encoding="utf-8")
        fields = json.loads(text)
        index = ShardIndex(
            shard=int(fields["shard"]),
            size=int(fields["size"]),
            sha256=str(fields["sha256"]),
            groups={str(name): int(count) for name, count in fields["groups"].items()},
            parts={
                key: {name: (int(place[0]), int(place[1])) for name, place in parts.items()}
                for key, parts in fields["pairs"].items()
            },
        )
    except FileNotFoundError as error:
        raise InputError("expected the index of a shard, found none", source=path) from error
    except (OSError, ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
        raise InputError(f"expected the index of a shard, got a damaged file ({error})", source=path) from error
    if fields.get("format") != DATASET_FORMAT or index.shard != shard:
        raise InputError(
            f"expected format {DATASET_FORMAT} of shard {shard}, got {fields.get('format')} of {index.shard}",
            source=path,
        )
    return index


def is_done(folder: Path, shard: int) -> bool:
    """Return whether a shard has a readable index and a tar of the indexed size."""
    try:
        return read_index(folder, shard).size == tar_path(folder, shard).stat().st_size
    except (InputError, OSError):
        return False


def read_samples(path: Path) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield the samples of a tar in WebDataset's convention: the key ends at the first dot, its parts are adjacent.

    Raises:
        InputError: not such a tar.
    """
    key: str | None = None
    parts: dict[str, bytes] = {}
    seen: set[str] = set()
    try:
        with tarfile.open(path, "r:") as tar:
            for member in tar:
                prefix, _, name = member.name.partition(".")
                if prefix != key:
                    if key is not None:
                        yield key, parts
                    if prefix in seen:
                        raise InputError(f"expected the parts of {prefix} together, got them apart", source=path.name)
                    seen.add(prefix)
                    key, parts = prefix, {}
                file = tar.extractfile(member) if member.isfile() else None
                if file is None or not name or name in parts:
                    raise InputError(f"expected files <key>.<part>, got {member.name!r}", source=path.name)
                parts[name] = file.read()
    except (OSError, tarfile.TarError) as error:
        raise InputError(f"expected a tar, got a damaged file ({error})", source=path.name) from error
    if key is not None:
        yield key, parts


def fault(folder: Path, shard: int, kind: str, pairs: int) -> str:
    """Return what is wrong with a shard that should hold `pairs` pairs of a kind; empty if nothing."""
    arrays = SAMPLE_ARRAYS[kind]
    try:
        index = read_index(folder, shard)
        path = tar_path(folder, shard)
        if not path.is_file():
            return f"{path.name} is missing"
        data = path.read_bytes()
        if len(data) != index.size:
            return f"expected {index.size} bytes, got {len(data)}"
        if hashlib.sha256(data).hexdigest() != index.sha256:
            return "its bytes changed since it was written (SHA-256)"
        if index.pairs != pairs:
            return f"expected {pairs} pairs, got {index.pairs}"
        found = dict(read_samples(path))
        if list(found) != list(index.parts):
            return "its pairs are not those of its index"
        return next(filter(None, (_sample_fault(key, found[key], index, arrays, data) for key in found)), "")
    except (InputError, OSError) as error:
        return " ".join(str(error).split())


def _sample_fault(
    key: str, parts: dict[str, bytes], index: ShardIndex, arrays: Mapping[str, tuple], data: bytes
) -> str:
    if set(parts) != {*arrays, "json"}:
        return f"{key}: expected {', '.join([*arrays, 'json'])}, got {', '.join(parts)}"
    places = {name: data[start : start + size] for name, (start, size) in index.parts[key].items()}
    if places != parts:
        return f"{key}: its offsets in the index are wrong"
    for name, (shape, dtype) in arrays.items():
        array = decode_part(name, parts[name])
        if array.shape != shape or array.dtype != np.dtype(dtype):
            return f"{key}.{name}: expected {list(shape)} {dtype}, got {list(array.shape)} {array.dtype}"
        if not np.isfinite(array).all():
            return f"{key}.{name}: expected finite numbers"
    fields = decode_part("json", parts["json"])
    if not isinstance(fields, dict) or Recipe.from_hex(str(fields.get("recipe"))).key != key:
        return f"{key}.json: expected this pair's recipe, got another"
    return ""
