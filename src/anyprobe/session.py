"""A request's way to its light, in the four steps that the command line and the server take; Blender takes two.

shots, turns = open(shots, poses)           # photos as given, completed by their cameras' poses
photos = (mark(shot) for shot in shots)     # read, the object found
light = estimate(estimator, photos, turns)  # one light, in the first photo's camera
deliver(light, folder, stem, photo=photo)   # files, all or none
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.extract import Extract, extracts_of
from anyprobe.estimate.multiview import estimate_views
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.poses import Poses
from anyprobe.estimate.result import LEVEL, Light
from anyprobe.estimate.sheet import draw_preview
from anyprobe.files.atomic import atomic_files
from anyprobe.inputs.hints import Hints
from anyprobe.masks.networks import NetworkSource
from anyprobe.pictures.images import ImageSource, Pixels, write_png
from anyprobe.place.panorama import DRAWN_ROWS

FILES = {"exr": ".exr", "hdr": ".hdr", "json": ".json", "png": ".png"}
"""Ends of the names of a light's files by kind."""
PICTURED = {"panorama": "_panorama.exr", "origin": "_origin.png", **FILES}
"""The same with those that show the place; png is then a preview."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shot:
    """A photo as it is given.

    Attributes:
        source: a path, the file's bytes, or pixels, also ones that are read.
        name: without folders, for messages and to find its pose.
        hints: of it alone; files as paths, bytes or pixels.
    """

    source: ImageSource | Pixels
    name: str
    hints: Hints = Hints()


def open(shots: Sequence[Shot], poses: Poses | None = None) -> tuple[list[Shot], np.ndarray | None]:
    """Complete photos by their cameras' poses: a field of view where none is given.

    Returns:
        The shots, and world_from_camera [N, 3, 3] of each; None without poses.
    Raises:
        InputError: a photo without a pose, or one that cannot be read.
    """
    if poses is None:
        return list(shots), None
    names = [Path(shot.name) for shot in shots]
    completed = [
        replace(shot, hints=replace(shot.hints, fov_deg=fov)) if shot.hints.fov_deg is None else shot
        for shot, fov in zip(shots, poses.fovs_deg(names, [shot.source for shot in shots]), strict=True)
    ]
    return completed, poses.of(names)


def mark(shot: Shot, segmenter: NetworkSource | None = None) -> Photo:
    """Read a photo and find its object. Errors: see load_photo."""
    return load_photo(shot.source, shot.hints, name=shot.name, segmenter=segmenter)


def estimate(
    estimator: Estimator, photos: Iterable[Photo | Extract], world_from_camera: np.ndarray | None = None
) -> Light:
    """Estimate the light of one photo, or one light of several whose cameras stood so.

    Args:
        photos: asked for one after another, so that each may be marked then; Extracts are of other processes.
    """
    if world_from_camera is not None:
        return estimate_views(estimator.from_extract, extracts_of(photos), world_from_camera)
    (extract,) = extracts_of(photos, is_alone=True)
    return estimator.from_extract(extract)


def deliver(
    light: Light,
    folder: Path,
    stem: str,
    kinds: Iterable[str] = FILES,
    *,
    photo: Photo | None = None,
    colorspace: str = "rec709",
    size: int = DRAWN_ROWS,
    frame: str = LEVEL,
) -> dict[str, Path]:
    """Write files of a light into a folder, replacing older ones.

    Args:
        kinds: of FILES.
        photo: with it, also the panorama and its origin, and as png a preview.
        colorspace: of every .exr, see Light.save.
        size, frame: of the panorama, see Light.panorama.
    Returns:
        kind -> path.
    Raises:
        OutputError: the folder cannot be made or written; what was there stays as it was.
    """
    panorama = None if photo is None else light.panorama(size, frame=frame)
    files = {kind: f"{stem}{FILES[kind]}" for kind in kinds}
    with atomic_files(folder) as scratch:
        for kind, name in files.items():
            if kind != "png" or panorama is None:
                light.save(scratch / name, colorspace=colorspace)
        if panorama is not None:
            files = {kind: f"{stem}{end}" for kind, end in PICTURED.items()}
            panorama.save(scratch / files["panorama"], colorspace=colorspace)
            panorama.save_origin(scratch / files["origin"])
            ringed = None if light.is_soft else light.dominant_light().direction
            write_png(scratch / files["png"], draw_preview(panorama, photo, ringed))
    return {kind: folder / name for kind, name in files.items()}
