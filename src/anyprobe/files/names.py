"""Names of files in the order that people count in, and which of a folder are meant."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path


def natural_order(name: str) -> list[tuple[bool, int, str]]:
    """A key to sort names by: frame_2 stands before frame_10."""
    return [
        (part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in re.split(r"([0-9]+)", name)
    ]


def visible_files(folder: Path, suffixes: Iterable[str]) -> list[Path]:
    """What a folder has of these suffixes, in lower case, by natural_order; without hidden files.

    macOS leaves a ._NAME beside each NAME on shared drives.
    """
    known = tuple(suffixes)
    found = [p for p in folder.iterdir() if p.suffix.lower() in known and not p.name.startswith(".")]
    return sorted(found, key=lambda path: natural_order(path.name))
