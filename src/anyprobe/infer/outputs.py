"""What one photo leaves on disk: .exr, .hdr, .json and .png, all four or none."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from anyprobe.errors import OutputError
from anyprobe.files.images import write_png
from anyprobe.infer.photo import Photo
from anyprobe.infer.preview import draw_preview
from anyprobe.infer.result import Light

SUFFIXES = (".exr", ".hdr", ".json", ".png")


def write_results(photo: Photo, light: Light, folder: Path, stem: str) -> dict[str, Path]:
    """Write <stem>.exr, .hdr, .json and .png into folder, replacing older ones.

    Returns:
        Suffix without dot -> path.
    Raises:
        OutputError: the folder cannot be made or written; nothing new is left in it.
    """
    targets = {suffix[1:]: folder / f"{stem}{suffix}" for suffix in SUFFIXES}
    scratch = ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for target in targets.values():
            if target.is_dir():
                raise OutputError(
                    f"{target}: expected a file to replace, got a folder; choose another with -o"
                )
        with tempfile.TemporaryDirectory(dir=folder, prefix=".anyprobe-") as scratch:
            made = {kind: Path(scratch) / target.name for kind, target in targets.items()}
            for kind in ("exr", "hdr", "json"):
                light.save(made[kind])
            write_png(made["png"], draw_preview(photo, light))
            _move(made, targets)
    except OutputError as error:
        if not scratch:
            raise
        raise OutputError(str(error).replace(scratch, str(folder))) from error
    except OSError as error:
        raise OutputError(
            f"{folder}: expected a folder that can be written, got {error.strerror or error}; choose another with -o"
        ) from error
    return targets


def _move(made: dict[str, Path], targets: dict[str, Path]) -> None:
    """Rename the finished files to their places; if one fails, none of them stays."""
    placed: list[Path] = []
    try:
        for kind, path in made.items():
            os.replace(path, targets[kind])
            placed.append(targets[kind])
    except BaseException:
        for target in placed:
            target.unlink(missing_ok=True)
        raise
