"""What the commands let you say about where the object is: options, and how their text is read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from anyprobe.errors import InputError, InvalidMask
from anyprobe.files.paths import visible_files

PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".gif", ".heic", ".heif", ".exr")
PANORAMA_SUFFIXES = (*PHOTO_SUFFIXES, ".hdr")
DEPTH_SUFFIXES = (".png", ".tif", ".tiff", ".exr", ".npy")

MaskOption = Annotated[
    Path | None, typer.Option(help="Mask image, white = object; or a folder of masks named like the photos.")
]
BoxOption = Annotated[
    str | None, typer.Option(metavar="X0,Y0,X1,Y1", help="Box around the object, in pixels.")
]
ClickOption = Annotated[
    list[str] | None, typer.Option(metavar="X,Y", help="A point on the object, in pixels; repeatable.")
]
NotOption = Annotated[
    list[str] | None, typer.Option("--not", metavar="X,Y", help="A point beside the object; repeatable.")
]
DepthOption = Annotated[
    Path | None,
    typer.Option(help="Depth image of the same view; or a folder of them named like the photos."),
]
NearOption = Annotated[
    float | None, typer.Option(help="Cut the depth image from here on, in its own unit (often mm).")
]
FarOption = Annotated[float | None, typer.Option(help="Cut the depth image up to here.")]


def read_where(
    mask: Path | None,
    box: str | None,
    click: list[str] | None,
    click_off: list[str] | None,
    depth: Path | None,
    near: float | None,
    far: float | None,
) -> dict:
    """The options as the keywords of load_photo, or one line on what does not go together.

    mask and depth may still be folders: where_for makes them one photo's.
    """
    given = {"--mask": mask, "--depth": depth, "--box": box, "--click": click}
    told = [name for name, value in given.items() if value]
    if len(told) > 1 and told != ["--box", "--click"]:
        raise InputError(f"{' and '.join(told)}: expected one of them, got both")
    if click_off and (mask is not None or depth is not None):
        raise InputError(
            f"--not: expected --click, --box or neither with it, got {told[0]}; leave one of them out"
        )
    if depth is None and (near is not None or far is not None):
        option = "--far" if near is None else "--near"
        raise InputError(f"{option}: expected --depth FILE with it, a depth image to cut, got none; add it")
    if mask is not None and not mask.exists():
        raise InvalidMask(f"{mask}: expected a mask file or folder, found none; check the path")
    if depth is not None and not depth.exists():
        raise InvalidMask(f"{depth}: expected a depth image or folder, found none; check the path")
    return {
        "mask": mask,
        "box": None if box is None else _numbers("--box", box, 4, "X0,Y0,X1,Y1", "40,30,220,260"),
        "click": [_numbers("--click", text, 2, "X,Y", "120,90") for text in click] if click else None,
        "click_off": [_numbers("--not", text, 2, "X,Y", "20,90") for text in click_off]
        if click_off
        else None,
        "depth": depth,
        "near": near,
        "far": far,
    }


def where_for(photo: Path, where: dict) -> dict:
    """The keywords for one photo: folders of masks, depth images, normals or panoramas become the file of its name."""
    files = {
        "mask": _file_for(photo, where["mask"], "mask", PHOTO_SUFFIXES),
        "depth": _file_for(photo, where["depth"], "depth", DEPTH_SUFFIXES),
    }
    if isinstance(where.get("normals"), Path):
        files["normals"] = _file_for(photo, where["normals"], "normals", DEPTH_SUFFIXES)
    if isinstance(where.get("surroundings"), Path):
        files["surroundings"] = _file_for(photo, where["surroundings"], "surroundings", PANORAMA_SUFFIXES)
    return where | files


def list_photos(photos: list[Path]) -> list[Path]:
    """Files as given; folders as the photos in them, in the order one counts in, without hidden files
    and what `anyprobe mask` wrote: NAME_mask and NAME_overlay."""
    chosen: list[Path] = []
    for path in photos:
        if not path.is_dir():
            chosen.append(path)
            continue
        found = visible_files(path, PHOTO_SUFFIXES)
        written = {f"{p.stem}_{kind}" for p in found for kind in ("mask", "overlay")}
        found = [p for p in found if p.stem not in written]
        if not found:
            raise InputError(f"{path}: expected a folder with photos, found none; check the path")
        chosen += found
    return list(dict.fromkeys(chosen))


def _numbers(option: str, text: str, count: int, form: str, example: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise InvalidMask(
            f"{option}: expected {form} in pixels, got {text!r}; for instance {option} {example}"
        )
    return numbers


def _file_for(photo: Path, given: Path | None, kind: str, suffixes: tuple[str, ...]) -> Path | None:
    """The file itself, or by stem from a folder (NAME.*, NAME_<kind>.*, or the photo's whole name and a suffix)."""
    if given is None or not given.is_dir():
        return given
    for stem in (f"{photo.stem}_{kind}", photo.stem, photo.name):
        for candidate in sorted(given.glob(f"{_literal(stem)}.*")):
            # the glob finds stem.0002.png too, which is another photo's
            if candidate.stem != stem or candidate.suffix.lower() not in suffixes:
                continue
            if candidate.resolve() != photo.resolve():
                return candidate
    raise InvalidMask(
        f"{photo}: expected {photo.stem}.png or {photo.stem}_{kind}.png in {given}, found neither"
    )


def _literal(stem: str) -> str:
    """The stem with glob's own signs taken literally."""
    return "".join(f"[{c}]" if c in "[]*?" else c for c in stem)
