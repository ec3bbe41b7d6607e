"""anyprobe estimate: photos in, lights out."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Column, Table

from anyprobe.cli.options import (
    AlbedoOption,
    BoxOption,
    ClickOption,
    DepthOption,
    EmittersOption,
    FarOption,
    MaskOption,
    MaterialOption,
    NearOption,
    NormalsOption,
    NotOption,
    SurroundingsOption,
    list_photos,
    read_material,
    read_normals_option,
    read_surroundings_option,
    read_where,
    where_for,
)
from anyprobe.errors import AnyprobeError, InputError, OutputError
from anyprobe.estimate.runtime import DEFAULT_MODEL, MODE


@dataclass(frozen=True, kw_only=True, slots=True)
class Done:
    """One photo's outcome: the dominant light and files, or the error's line."""

    photo: Path
    direction: np.ndarray | None = None
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
    error: str = ""


def estimate(
    photos: Annotated[list[Path], typer.Argument(metavar="PHOTO...", help="Photos, or folders of photos.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path("light"),
    mask: MaskOption = None,
    click: ClickOption = None,
    click_off: NotOption = None,
    box: BoxOption = None,
    depth: DepthOption = None,
    near: NearOption = None,
    far: FarOption = None,
    fov: Annotated[
        float | None, typer.Option(help="Field of view of the photo's longer side, degrees.")
    ] = None,
    normals: NormalsOption = None,
    material: MaterialOption = None,
    albedo: AlbedoOption = None,
    surroundings: SurroundingsOption = None,
    emitters: EmittersOption = MODE,
    poses: Annotated[
        Path | None,
        typer.Option(
            help="JSON of how the photos' cameras are turned: all show one object in one place and give one light."
        ),
    ] = None,
    model: Annotated[str, typer.Option(help="Bundled model, or a folder of graphs.")] = DEFAULT_MODEL,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object per photo on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
) -> None:
    """Estimate the light around an object: <stem>.exr, .hdr, .json and .png per photo."""
    from anyprobe.estimate.estimator import Estimator

    where = read_where(mask, box, click, click_off, depth, near, far) | {
        "normals": read_normals_option(normals),
        "surroundings": read_surroundings_option(surroundings),
    }
    known = read_material(material, albedo)
    listed = list_photos(photos)
    estimator = Estimator(model, emitters=emitters)
    talk = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    steps = track(
        listed, "estimating", console=talk, transient=True, disable=len(listed) < 2 or not talk.is_terminal
    )
    if poses is not None:
        done = _together(estimator, steps, poses, out, where, fov, known, as_json, listed)
        return _report([done], talk, out)
    done = [_one(estimator, path, out, where, fov, known, as_json, listed) for path in steps]
    failed = [one for one in done if one.error]
    if len(done) > 1 or not failed:
        _report(done, talk, out)
    for one in failed:
        print(f"anyprobe: {one.error}", file=sys.stderr)
    if failed:
        raise typer.Exit(2)


def _one(
    estimator, path: Path, out: Path, where: dict, fov, known, as_json: bool, listed: list[Path]
) -> Done:
    """Estimate one photo and write its files; an error of ours ends this photo alone."""
    from anyprobe.estimate.outputs import write_results
    from anyprobe.estimate.photo import load_photo

    start = time.perf_counter()
    try:
        twins = [other for other in listed if other.stem == path.stem]
        if twins[0] != path:
            raise OutputError(
                f"{path}: expected names that differ, got {twins[0]} before it; rename one of them"
            )
        hints = where_for(path, where)
        _check_files(path, out, listed, hints)
        photo = load_photo(path, fov_deg=fov, **hints)
        light = estimator.from_photo(photo, start, material=known)
        written = write_results(photo, light, out, path.stem)
    except AnyprobeError as error:
        line = _line(path, error)
        if as_json:
            print(json.dumps({"photo": str(path), "error": line}), flush=True)
        return Done(photo=path, error=line)
    if as_json:
        files = {kind: str(target) for kind, target in written.items()}
        print(json.dumps({**light.sidecar(), "photo": str(path), "files": files}), flush=True)
    seconds = sum(light.info["seconds"].values())
    return Done(
        photo=path, direction=light.dominant_light().direction, seconds=seconds, warnings=light.warnings
    )


def _together(
    estimator, steps, poses: Path, out: Path, where: dict, fov, known, as_json: bool, listed: list[Path]
) -> Done:
    """One light of all photos, under the first one's name; any error ends all of it."""
    from anyprobe.estimate.multiview import estimate_together
    from anyprobe.estimate.outputs import write_results
    from anyprobe.estimate.photo import Photo, load_photo
    from anyprobe.files.poses import read_poses

    start = time.perf_counter()
    given_poses = read_poses(poses)
    turned, fovs = given_poses.of(listed), dict(zip(listed, given_poses.fovs_deg(listed), strict=True))

    def load(path: Path) -> Photo:
        hints = where_for(path, where)
        _check_files(listed[0], out, [*listed, poses], hints)
        try:
            return load_photo(path, fov_deg=fovs[path] if fov is None else fov, **hints)
        except AnyprobeError as error:
            raise InputError(_line(path, error)) from error

    photos = map(load, steps)
    first = next(photos)
    light = estimate_together(estimator, chain([first], photos), turned, start=start, material=known)
    written = write_results(first, light, out, listed[0].stem)
    if as_json:
        files = {kind: str(target) for kind, target in written.items()}
        print(json.dumps({**light.sidecar(), "photo": str(listed[0]), "files": files}), flush=True)
    seconds = time.perf_counter() - start
    direction = light.dominant_light().direction
    return Done(photo=listed[0], direction=direction, seconds=seconds, warnings=light.warnings)


def _line(path: Path, error: AnyprobeError) -> str:
    """One line that says which photo an error is of; that of its mask may not."""
    text = str(error)
    if not text.startswith((f"{path}: ", f"{path.name}: ")):
        text = f"{path}: {text}"
    return " ".join(text.splitlines())  # a name may hold a line break


def _check_files(path: Path, out: Path, listed: list[Path], hints: dict) -> None:
    """Refuse a result that would replace one of the inputs."""
    from anyprobe.estimate.outputs import SUFFIXES

    files = (*listed, hints["mask"], hints["depth"], hints["normals"], hints["surroundings"])
    inputs = {given.resolve(): given for given in files if isinstance(given, Path)}
    for target in (out / f"{path.stem}{suffix}" for suffix in SUFFIXES):
        if target.resolve() in inputs:
            lost = inputs[target.resolve()]
            raise OutputError(f"{path}: the result would replace {lost}; choose another folder with -o")


def _report(done: list[Done], talk: Console, out: Path) -> None:
    """A table of all photos; warnings below it."""
    columns = (
        Column("photo", overflow="fold"),
        "dominant light",
        "seconds",
        Column("result", overflow="fold"),
    )
    table = Table(*columns, box=None, pad_edge=False)
    for one in done:
        if one.error:
            table.add_row(str(one.photo), "", "", "failed")
            continue
        x, y, z = one.direction
        azimuth, elevation = np.degrees(np.arctan2(x, -z)), np.degrees(np.arcsin(np.clip(y, -1, 1)))
        side = "right" if azimuth >= 0 else "left"
        where = f"{abs(azimuth):.0f}° {side}, {abs(elevation):.0f}° {'up' if elevation >= 0 else 'down'}"
        table.add_row(
            str(one.photo), where, f"{one.seconds:.2f}", str(out / one.photo.stem) + ".{exr,hdr,json,png}"
        )
    talk.print(table)
    for one in done:
        for warning in one.warnings:
            talk.print(f"warning: {warning}", soft_wrap=True)
