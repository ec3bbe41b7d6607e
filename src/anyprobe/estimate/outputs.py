"""Files of one photo: panorama, map, sidecar and preview, all or none."""

from __future__ import annotations

from pathlib import Path

from anyprobe.estimate.photo import Photo
from anyprobe.estimate.result import LEVEL, Light
from anyprobe.estimate.sheet import draw_preview
from anyprobe.files.atomic import atomic_files
from anyprobe.pictures.images import write_png
from anyprobe.place.panorama import DRAWN_ROWS

OUTPUT_SUFFIXES = ("_panorama.exr", "_origin.png", ".exr", ".hdr", ".json", ".png")


def write_results(
    photo: Photo,
    light: Light,
    folder: Path,
    stem: str,
    colorspace: str = "rec709",
    *,
    size: int = DRAWN_ROWS,
    frame: str = LEVEL,
) -> dict[str, Path]:
    """Write OUTPUT_SUFFIXES of a photo into folder, replacing older ones; every .exr in a colorspace of Light.save.

    Args:
        size, frame: of the panorama, see Light.panorama.
    Returns:
        What a file is ("panorama", "origin", "exr", "hdr", "json", "png") -> path.
    Raises:
        OutputError: the folder cannot be made or written; what was there stays as it was.
    """
    panorama = light.panorama(size, frame=frame)
    with atomic_files(folder) as scratch:
        panorama.save(scratch / f"{stem}_panorama.exr", colorspace=colorspace)
        panorama.save_origin(scratch / f"{stem}_origin.png")
        light.save(scratch / f"{stem}.exr", colorspace=colorspace)
        for kind in ("hdr", "json"):
            light.save(scratch / f"{stem}.{kind}")
        write_png(scratch / f"{stem}.png", draw_preview(panorama, photo, light.dominant_light().direction))
    return {_kind(suffix): folder / f"{stem}{suffix}" for suffix in OUTPUT_SUFFIXES}


def _kind(suffix: str) -> str:
    """Return write_results' name of a file."""
    return suffix[1:].partition(".")[0] if suffix.startswith("_") else suffix[1:]
