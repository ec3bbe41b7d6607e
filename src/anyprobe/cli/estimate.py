"""anyprobe estimate: photos in, lights out; --json prints a line for each, Light.sidecar and its files, or an error."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import track
from rich.table import Table

from anyprobe import session
from anyprobe.cli import options, photo_files
from anyprobe.cli.app import print_table
from anyprobe.errors import AnyprobeError, InputError, InvalidPhoto
from anyprobe.estimate.doubts import exposure_doubts
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.poses import read_poses
from anyprobe.estimate.result import Light
from anyprobe.files.atomic import check_folder
from anyprobe.files.paths import open_regular
from anyprobe.place.panorama import check_rows

STEEP_DEG, DOUBTED_DEG = 75, 45
"""Elevation beyond which an azimuth says nothing, and error beyond which a direction says no more than a side."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Done:
    """Outcome of one photo: the stem of its files and its cells in the table, or the error as a line."""

    photo: Path
    stem: str = ""
    cells: tuple[str, ...] = ("failed",)
    warnings: tuple[str, ...] = ()
    error: str = ""


def estimate(
    *photos: Annotated[options.Photos, Parameter(required=True)],
    given: options.ObjectOptions = options.ObjectOptions(),
    models: options.ModelOptions = options.ModelOptions(),
    out: Annotated[Path, options.folder_option("Folder for the results.")] = Path("light"),
    marks: options.MarksOption = None,
    poses: Path | None = None,
    size: int = 512,
    frame: options.FrameOption = "level",
    colorspace: options.ColorspaceOption = "rec709",
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Estimate the light around an object.

    Writes a panorama, <stem>_panorama.exr, with <stem>_origin.png (where it is seen, estimated, continued), the
    estimate's own map <stem>.exr and .hdr, a .json, and a preview <stem>.png.

    Args:
        poses: transforms.json of the photos' cameras: all photos, views of one object, give one light.
        size: Rows of the panorama: 64, 128, 256, 512, 1024 or 2048.
    """
    check_rows(size)
    hints = given.hints()
    listed = photo_files.list_photos(photos)
    marked = photo_files.marks_of(marks, listed)
    if poses is None:
        photo_files.check_distinct(listed)
    check_folder(out)
    estimator = models.estimator(given.segmenter)
    console = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    has_bar = len(listed) > 1 and console.is_terminal
    has_lines = len(listed) > 1 and not console.is_terminal
    progress: Any = track(listed, "estimating", console=console, transient=True, disable=not has_bar)

    def marked_photo(path: Path, shot: session.Shot) -> Photo:
        """Find the object; errors of one of several photos name it."""
        try:
            return session.mark(shot, estimator.segmenter)
        except AnyprobeError as error:
            if poses is None:
                raise
            raise InputError(photo_files.photo_line(path, error), code=error.code) from error

    def walk(paths: list[Path], steps: Iterable[Path]) -> tuple[Light, dict[str, Path]]:
        """Open, mark, estimate and deliver; return the light and its files."""
        stem = photo_files.result_stem(paths[0], listed)
        cameras = None if poses is None else read_poses(poses)
        shots = []
        for path in paths:
            if cameras is not None:  # the last may be missing, and finding objects takes a while
                with open_regular(path, InvalidPhoto):
                    pass
            shots.append(photo_files.shot_of(path, hints, marked))
            targets = [out / f"{stem}{end}" for end in session.PICTURED.values()]
            photo_files.check_names(paths[0], listed, targets, (poses, *shots[-1].hints.files().values()))
        shots, turns = session.open(shots, cameras)
        found = (marked_photo(path, shot) for path, shot in zip(steps, shots, strict=True))
        first = next(found)
        light = session.estimate(estimator, chain([first], found), turns)
        return light, session.deliver(light, out, stem, photo=first, colorspace=colorspace, size=size, frame=frame)

    def done(paths: list[Path], steps: Iterable[Path]) -> Done:
        """Estimate one light from a photo, or from several with poses, and write its files, named after the first.

        An AnyprobeError ends a single photo alone, but a call of several. steps: the paths, as work goes on.
        """
        start, first = time.perf_counter(), paths[0]
        try:
            light, written = walk(paths, steps)
        except AnyprobeError as error:
            if poses is not None:
                raise
            line = photo_files.photo_line(first, error)
            if as_json:
                print(json.dumps({"photo": str(first), "error": line, "code": error.code}), flush=True)
            return Done(photo=first, error=line)
        if as_json:
            files = {kind: str(target) for kind, target in written.items()}
            print(json.dumps({**light.sidecar(), "photo": str(first), "files": files}), flush=True)
        cells = (*said_of(light), f"{time.perf_counter() - start:.2f}")
        return Done(photo=first, stem=photo_files.result_stem(first, listed), cells=cells, warnings=light.warnings)

    with contextlib.closing(progress) as steps:  # else its thread outlives an error, and the process never ends
        results: list[Done] = []
        try:
            if poses is not None:
                results.append(done(listed, steps))
            else:
                for number, path in enumerate(steps, start=1):
                    if has_lines:  # a log, which shows no bar
                        console.print(f"{number} of {len(listed)}: {photo_files.photo_name(path)}", soft_wrap=True)
                    results.append(done([path], [path]))
        except KeyboardInterrupt:
            if poses is None and len(listed) > 1:
                text = f"anyprobe: stopped with {len(results)} of {len(listed)} photos done, which are in {out}"
                print(f"{text}; the same command starts over", file=sys.stderr)
            raise
    failed = [result for result in results if result.error]
    if len(results) > 1 or not failed:
        _report(results, console, out)
    for result in failed:
        print(f"anyprobe: {result.error}", file=sys.stderr)
    if failed or (given.strict and any(result.warnings for result in results)):
        sys.exit(2)


def said_of(light: Light) -> tuple[str, str]:
    """Return where a light comes from, if a source dominates, and the uncertainty of its brightness, in words."""
    dominant, ground, uncertainty = light.dominant_light(), light.ground, light.origin.uncertainty
    x, y, z = dominant.direction if ground is None else ground.level_from_camera @ dominant.direction
    azimuth, elevation = np.degrees(np.arctan2(x, -z)), np.degrees(np.arcsin(np.clip(y, -1, 1)))
    text = f"{abs(elevation):.0f}° {'up' if elevation >= 0 else 'down'}"
    if abs(elevation) < STEEP_DEG:
        text = f"{abs(azimuth):.0f}° {'right' if azimuth >= 0 else 'left'}, {text}"
    crop = light.stages["photo"]
    pixels = crop[crop[..., 3] > 0.5]
    if exposure_doubts(pixels[:, :3] / pixels[:, 3:], ""):
        return f"{text}, a guess", ""
    level = "" if uncertainty is None else f"± {uncertainty['level_stops']:.1f} stops"
    if light.is_soft:
        return f"soft light, brightest from {light.brightest_side()}", level
    if dominant.error_deg > DOUBTED_DEG:
        text = f"probably from {light.side_of(dominant.direction)}"
    return f"{text} ± {dominant.error_deg:.0f}°", level


def _report(results: list[Done], console: Console, out: Path) -> None:
    """Print a table of all photos, where their results are, and the warnings."""
    table = Table("photo", "dominant light", "brightness uncertainty", "seconds", box=None, pad_edge=False)
    for result in results:
        table.add_row(result.photo.name, *result.cells)
    print_table(console, table)
    written = [result.stem for result in results if not result.error]
    if written:  # on a line of its own, which a narrow terminal does not cut into pieces
        stems = "" if len(written) == 1 else f"; <stem> is {photo_files.some(written)}"
        stem = "<stem>" if stems else written[0]
        files = ", ".join(f"{stem}{suffix}" for suffix in session.PICTURED.values())
        console.print(f"results: {out / files}{stems}", soft_wrap=True)
    for warning in photo_files.joined(chain.from_iterable(result.warnings for result in results)):
        console.print(f"warning: {options.OPTIONS.line(warning)}", soft_wrap=True)
