"""Which photos a folder has, and the masks of their objects."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

from anyprobe.errors import InputError

ENDINGS = (".jpg", ".jpeg", ".png", ".webp", ".heic")
LIGHTS = "lights.csv"
"""A table of photos under one light source each: file, mask, object, and x, y, z of the direction towards it."""


def photos_of(folder: Path) -> Iterator[Path]:
    """Yield the pictures of a folder that are no masks, by name."""
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in ENDINGS and not path.stem.endswith("_mask"):
            yield path


def masks_of(folder: Path) -> dict[Path, Path]:
    """Return the mask of each photo of a folder that has one: as LIGHTS says, or else NAME_mask.png beside it."""
    found = {path: path.with_name(f"{path.stem}_mask.png") for path in photos_of(folder)}
    if (folder / LIGHTS).is_file():
        with (folder / LIGHTS).open(newline="", encoding="utf-8-sig") as stream:
            found |= {folder / row["file"]: folder / row["mask"] for row in csv.DictReader(stream)}
    return {path: mask for path, mask in found.items() if mask.is_file()}


def masked_photos(folders: list[Path]) -> dict[str, tuple[Path, Path]]:
    """Return all photos with masks of some folders, and those masks, by FOLDER/FILE.

    Raises:
        InputError: a folder without any.
    """
    found = {}
    for folder in folders:
        masks = masks_of(folder) if folder.is_dir() else {}
        if not masks:
            raise InputError(f"{folder}: expected photos with NAME_mask.png beside them, found none; choose another")
        found |= {f"{folder.resolve().name}/{path.name}": (path, mask) for path, mask in masks.items()}
    return found
