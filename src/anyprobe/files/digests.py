"""Digests that identify files and arrays."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from anyprobe.errors import InputError
from anyprobe.files.paths import open_regular

BLOCKS, BLOCK_BYTES = 64, 1 << 16
"""Number and size [bytes] of the blocks of a large file that are hashed, spread evenly over it."""


def digest_of(parts: Iterable[bytes]) -> str:
    """Return 16 hexadecimal digits that identify these parts in this order."""
    whole = hashlib.sha256()
    for part in parts:
        whole.update(hashlib.sha256(part).digest())
    return whole.hexdigest()[:16]


def sampled_digest(path: Path) -> str:
    """Return the digest of a file's size and of BLOCKS blocks of it, which are all its bytes where it is small."""
    with open_regular(path, InputError) as stream:
        size = os.fstat(stream.fileno()).st_size
        parts = [str(size).encode()]
        for number in range(BLOCKS):
            stream.seek(max(number * BLOCK_BYTES, number * (size - BLOCK_BYTES) // (BLOCKS - 1)))
            parts.append(stream.read(BLOCK_BYTES))
    return digest_of(parts)
