"""What one photo leaves on disk: .exr, .hdr, .json and .png, all four or none."""

from __future__ import annotations

from pathlib import Path

from anyprobe.files.atomic import atomic_files
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
        OutputError: the folder cannot be made or written; what was there stays as it was.
    """
    with atomic_files(folder) as scratch:
        for kind in ("exr", "hdr", "json"):
            light.save(scratch / f"{stem}.{kind}")
        write_png(scratch / f"{stem}.png", draw_preview(photo, light))
    return {suffix[1:]: folder / f"{stem}{suffix}" for suffix in SUFFIXES}
