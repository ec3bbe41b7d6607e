"""anyprobe estimate: photos in, lights out."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import track
from rich.table import Table

from anyprobe.cli.marks import Marks, marks_of
from anyprobe.cli.options import (
    OPTIONS,
    ColorspaceOption,
    FrameOption,
    JsonOption,
    MarksOption,
    ModelOptions,
    ObjectOptions,
    Photos,
    QuietOption,
    folder_option,
)
from anyprobe.cli.photo_files import (
    check_distinct,
    check_names,
    hints_for,
    list_photos,
    photo_line,
    photo_name,
    photo_source,
    result_stem,
)
from anyprobe.cli.tables import print_table
from anyprobe.errors import AnyprobeError, InputError, InvalidPhoto
from anyprobe.files.atomic import check_folder
from anyprobe.files.paths import open_regular
from anyprobe.inputs.hints import Hints
from anyprobe.place.panorama import check_rows

if TYPE_CHECKING:
    from anyprobe.estimate.estimator import Estimator
    from anyprobe.estimate.photo import Photo
    from anyprobe.estimate.result import Light


MOST_NAMED = 20
"""Most photos whose results' names are printed."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Done:
    """Outcome of one photo: the stem of its files and its cells in the table, or the error as a line."""

    photo: Path
    stem: str = ""
    cells: tuple[str, ...] = ("failed",)
    warnings: tuple[str, ...] = ()
    error: str = ""


def estimate(
    *photos: Annotated[Photos, Parameter(required=True)],
    given: ObjectOptions = ObjectOptions(),
    models: ModelOptions = ModelOptions(),
    out: Annotated[Path, folder_option("Folder for the results.")] = Path("light"),
    marks: MarksOption = None,
    poses: Annotated[
        Path | None,
        Parameter(help="transforms.json of the photos' cameras: all photos, views of one object, give one light."),
    ] = None,
    size: Annotated[int, Parameter(help="Rows of the panorama: 64, 128, 256, 512, 1024 or 2048.")] = 512,
    frame: FrameOption = "level",
    colorspace: ColorspaceOption = "rec709",
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Estimate the light around an object.

    Writes a panorama, <stem>_panorama.exr, with <stem>_origin.png (where it is seen, estimated, continued), the
    estimate's own map <stem>.exr and .hdr, a .json, and a preview <stem>.png.
    """
    check_rows(size)
    hints = given.hints()
    listed = list_photos(photos)
    marked = marks_of(marks, listed)
    if poses is None:
        check_distinct(listed)
    check_folder(out)
    estimator = models.estimator(given.segmenter)
    console = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    has_bar = len(listed) > 1 and console.is_terminal
    has_lines = len(listed) > 1 and not console.is_terminal
    progress: Any = track(listed, "estimating", console=console, transient=True, disable=not has_bar)
    call = EstimateCall(
        estimator=estimator,
        out=out,
        hints=hints,
        marks=marked,
        as_json=as_json,
        listed=listed,
        colorspace=colorspace,
        size=size,
        frame=frame,
    )
    with contextlib.closing(progress) as steps:  # else its thread outlives an error, and the process never ends
        results: list[Done] = []
        try:
            if poses is not None:
                results.append(call.estimate_views(steps, poses))
            else:
                for number, path in enumerate(steps, start=1):
                    if has_lines:  # a log, which shows no bar
                        console.print(f"{number} of {len(listed)}: {photo_name(path)}", soft_wrap=True)
                    results.append(call.estimate_photo(path))
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


@dataclass(frozen=True, kw_only=True, slots=True)
class EstimateCall:
    """Options that all photos of a call share."""

    estimator: Estimator
    out: Path
    hints: Hints
    marks: Marks
    as_json: bool
    listed: list[Path]
    colorspace: str
    size: int
    frame: str

    def estimate_photo(self, path: Path) -> Done:
        """Estimate one photo and write its files; an AnyprobeError ends this photo alone."""
        from anyprobe.estimate.photo import load_photo

        start = time.perf_counter()
        try:
            hints = hints_for(path, self.hints, self.marks)
            self._check(path, hints)
            photo = load_photo(photo_source(path), hints, name=photo_name(path), segmenter=self.estimator.segmenter)
            light = self.estimator.from_photo(photo, start)
            return self._write(path, photo, light, sum((light.origin.seconds or {}).values()))
        except AnyprobeError as error:
            line = photo_line(path, error)
            if self.as_json:
                print(json.dumps({"photo": str(path), "error": line, "code": error.code}), flush=True)
            return Done(photo=path, error=line)

    def estimate_views(self, steps: Iterable[Path], poses: Path) -> Done:
        """Estimate one light from all photos, named after the first; any error ends the whole call."""
        from anyprobe.estimate.photo import load_photo
        from anyprobe.estimate.poses import read_poses

        start = time.perf_counter()
        camera_poses = read_poses(poses)
        rotations = camera_poses.of(self.listed)
        fovs = dict(zip(self.listed, camera_poses.fovs_deg(self.listed), strict=True))
        hints = {path: hints_for(path, self.hints, self.marks) for path in self.listed}
        for path in self.listed:
            self._check(self.listed[0], hints[path], poses)
            with open_regular(path, InvalidPhoto):  # the last may be missing, and finding objects takes a while
                pass

        def load(path: Path) -> Photo:
            own = hints[path]
            if own.fov_deg is None:
                own = replace(own, fov_deg=fovs[path])
            try:
                return load_photo(path, own, segmenter=self.estimator.segmenter)
            except AnyprobeError as error:
                raise InputError(photo_line(path, error), code=error.code) from error

        photos = map(load, steps)
        first = next(photos)
        light = self.estimator.multiview(chain([first], photos), list(rotations), start=start)
        return self._write(self.listed[0], first, light, time.perf_counter() - start)

    def _check(self, path: Path, hints: Hints, poses: Path | None = None) -> None:
        """Refuse results that would replace an input."""
        from anyprobe.estimate.outputs import OUTPUT_SUFFIXES

        inputs = (poses, *hints.files().values())
        targets = (self.out / f"{result_stem(path, self.listed)}{suffix}" for suffix in OUTPUT_SUFFIXES)
        check_names(path, self.listed, targets, inputs)

    def _write(self, path: Path, photo: Photo, light: Light, seconds: float) -> Done:
        from anyprobe.estimate.outputs import write_results

        stem = result_stem(path, self.listed)
        write_start = time.perf_counter()
        written = write_results(photo, light, self.out, stem, self.colorspace, size=self.size, frame=self.frame)
        seconds += time.perf_counter() - write_start
        if self.as_json:
            files = {kind: str(target) for kind, target in written.items()}
            print(json.dumps({**light.sidecar(), "photo": str(path), "files": files}), flush=True)
        return Done(photo=path, stem=stem, cells=(*_said(light), f"{seconds:.2f}"), warnings=light.warnings)


def _said(light: Light) -> tuple[str, str]:
    """Return where a light comes from, if a source dominates, and the uncertainty of its brightness, in words."""
    from anyprobe.estimate.doubts import exposure_doubts

    dominant, ground, uncertainty = light.dominant_light(), light.ground, light.origin.uncertainty
    x, y, z = dominant.direction if ground is None else ground.level_from_camera @ dominant.direction
    azimuth, elevation = np.degrees(np.arctan2(x, -z)), np.degrees(np.arcsin(np.clip(y, -1, 1)))
    side = "right" if azimuth >= 0 else "left"
    text = f"{abs(azimuth):.0f}° {side}, {abs(elevation):.0f}° {'up' if elevation >= 0 else 'down'}"
    crop = light.stages["photo"]
    pixels = crop[crop[..., 3] > 0.5]
    if exposure_doubts(pixels[:, :3] / pixels[:, 3:], ""):
        return f"{text}, a guess", ""
    level = "" if uncertainty is None else f"± {uncertainty['level_stops']:.1f} stops"
    if light.is_soft:
        return f"soft light, brightest from {light.brightest_side()}", level
    return f"{text} ± {dominant.error_deg:.0f}°", level


def _report(results: list[Done], console: Console, out: Path) -> None:
    """Print a table of all photos, where their results are, and the warnings."""
    from anyprobe.estimate.outputs import OUTPUT_SUFFIXES

    table = Table("photo", "dominant light", "brightness uncertainty", "seconds", box=None, pad_edge=False)
    for result in results:
        table.add_row(result.photo.name, *result.cells)
    print_table(console, table)
    written = [result.stem for result in results if not result.error]
    if written:  # on a line of its own, which a narrow terminal does not cut into pieces
        stems = "" if len(written) == 1 else f"; <stem> is {_some(written)}"
        stem = "<stem>" if stems else written[0]
        files = ", ".join(f"{stem}{suffix}" for suffix in OUTPUT_SUFFIXES)
        console.print(f"results: {out / files}{stems}", soft_wrap=True)
    for warning in dict.fromkeys(line for result in results for line in result.warnings):
        console.print(f"warning: {OPTIONS.line(warning)}", soft_wrap=True)


def _some(names: list[str]) -> str:
    """Return up to MOST_NAMED names, and how many more there are."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
