"""anyprobe estimate: photos in, lights out."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Column, Table

from anyprobe.errors import AnyprobeError, InputError, InvalidMask, OutputError
from anyprobe.infer.runtime import DEFAULT_MODEL

PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".gif", ".heic", ".heif", ".exr")


@dataclass(frozen=True, kw_only=True, slots=True)
class Done:
    """One photo's outcome: the main light and files, or the error's line."""

    photo: Path
    direction: np.ndarray | None = None
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
    error: str = ""


def estimate(
    photos: Annotated[list[Path], typer.Argument(metavar="PHOTO...", help="Photos, or folders of photos.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path("light"),
    mask: Annotated[
        Path | None,
        typer.Option(help="Mask image, white = object; or a folder of masks named like the photos."),
    ] = None,
    box: Annotated[
        str | None, typer.Option(metavar="X0,Y0,X1,Y1", help="Box around the object, in pixels.")
    ] = None,
    fov: Annotated[
        float | None, typer.Option(help="Field of view of the photo's longer side, degrees.")
    ] = None,
    model: Annotated[str, typer.Option(help="Bundled model, or a folder of graphs.")] = DEFAULT_MODEL,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object per photo on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
) -> None:
    """Estimate the light around an object: <stem>.exr, .hdr, .json and .png per photo."""
    from anyprobe.infer.estimate import Estimator

    corners = _parse_box(box)
    if mask is not None and corners is not None:
        raise InputError("--mask and --box: expected one of them, got both")
    if mask is not None and not mask.exists():
        raise InvalidMask(f"{mask}: expected a mask file or folder, found none; check the path")
    listed = _list_photos(photos)
    estimator = Estimator(model)
    talk = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    steps = track(
        listed, "estimating", console=talk, transient=True, disable=len(listed) < 2 or not talk.is_terminal
    )
    done = [_one(estimator, path, out, mask, corners, fov, as_json, listed) for path in steps]
    failed = [one for one in done if one.error]
    if len(done) > 1 or not failed:
        _report(done, talk, out)
    for one in failed:
        print(f"anyprobe: {one.error}", file=sys.stderr)
    if failed:
        raise typer.Exit(2)


def _one(estimator, path: Path, out: Path, mask, corners, fov, as_json: bool, listed: list[Path]) -> Done:
    """Estimate one photo and write its files; an error of ours ends this photo alone."""
    from anyprobe.infer.outputs import SUFFIXES, write_results
    from anyprobe.infer.photo import load_photo

    try:
        twins = [other for other in listed if other.stem == path.stem]
        if twins[0] != path:
            raise OutputError(
                f"{path}: expected names that differ, got {twins[0]} before it; rename one of them"
            )
        mask_file = _mask_for(path, mask)
        inputs = {given.resolve(): given for given in (*listed, mask_file) if given is not None}
        for target in (out / f"{path.stem}{suffix}" for suffix in SUFFIXES):
            if target.resolve() in inputs:
                lost = inputs[target.resolve()]
                raise OutputError(f"{path}: the result would replace {lost}; choose another folder with -o")
        photo = load_photo(path, mask=mask_file, box=corners, fov_deg=fov)
        light = estimator.from_photo(photo)
        written = write_results(photo, light, out, path.stem)
    except AnyprobeError as error:
        if as_json:
            print(json.dumps({"photo": str(path), "error": str(error)}), flush=True)
        return Done(photo=path, error=" ".join(str(error).splitlines()))  # a name may hold a line break
    if as_json:
        files = {kind: str(target) for kind, target in written.items()}
        print(json.dumps({**light.sidecar(), "photo": str(path), "files": files}), flush=True)
    seconds = sum(light.info["seconds"].values())
    return Done(photo=path, direction=light.main_light().direction, seconds=seconds, warnings=light.warnings)


def _report(done: list[Done], talk: Console, out: Path) -> None:
    """A table of all photos; warnings below it."""
    columns = (Column("photo", overflow="fold"), "main light", "seconds", Column("result", overflow="fold"))
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


def _parse_box(text: str | None) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        corners = tuple(float(part) for part in text.split(","))
    except ValueError:
        corners = ()
    if len(corners) != 4:
        raise InvalidMask(
            f"--box: expected X0,Y0,X1,Y1 in pixels, got {text!r}; for instance --box 40,30,220,260"
        )
    return corners


def _list_photos(photos: list[Path]) -> list[Path]:
    """Files as given; folders as the photos in them, sorted, without NAME_mask pictures."""
    listed: list[Path] = []
    for path in photos:
        if not path.is_dir():
            listed.append(path)
            continue
        found = sorted(p for p in path.iterdir() if p.suffix.lower() in PHOTO_SUFFIXES)
        stems = {p.stem for p in found}
        found = [p for p in found if not (p.stem.endswith("_mask") and p.stem[:-5] in stems)]
        if not found:
            raise InputError(f"{path}: expected a folder with photos, found none; check the path")
        listed += found
    return list(dict.fromkeys(listed))


def _mask_for(photo: Path, mask: Path | None) -> Path | None:
    """The mask file of a photo: the file itself, or by stem from a folder (NAME.* or NAME_mask.*)."""
    if mask is None or not mask.is_dir():
        return mask
    for stem in (f"{photo.stem}_mask", photo.stem):
        for candidate in sorted(mask.glob(f"{_literal(stem)}.*")):
            if candidate.suffix.lower() in PHOTO_SUFFIXES and candidate.resolve() != photo.resolve():
                return candidate
    raise InvalidMask(f"{photo}: expected {photo.stem}.png or {photo.stem}_mask.png in {mask}, found neither")


def _literal(stem: str) -> str:
    """The stem with glob's own signs taken literally."""
    return "".join(f"[{c}]" if c in "[]*?" else c for c in stem)
