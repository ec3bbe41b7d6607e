"""anyprobe relight: a virtual object beside the real one, lit by the estimate."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.cli.options import (
    BoxOption,
    ClickOption,
    DepthOption,
    EmittersOption,
    FarOption,
    MaskOption,
    NearOption,
    NotOption,
    read_where,
    where_for,
)
from anyprobe.errors import InputError, OutputError
from anyprobe.estimate.runtime import DEFAULT_MODEL, MODE

STRIP = ("chrome", "gold", "plastic", "matte", "photo")
"""What --strip shows after the photo."""


class Renderer(StrEnum):
    """Who draws the object."""

    auto = "auto"
    own = "own"
    mitsuba = "mitsuba"


def relight(
    photo: Annotated[Path, typer.Argument(metavar="PHOTO", help="The photo with the real object.")],
    name: Annotated[
        str,
        typer.Option("--object", help="sphere, vase, pebble, block, solid, or a .glb, .obj or .ply file."),
    ] = "sphere",
    material: Annotated[
        str, typer.Option(help="chrome, gold, plastic, matte, or photo: the real object's own.")
    ] = "chrome",
    at: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Where its foot stands, in pixels; else beside.")
    ] = None,
    size: Annotated[float, typer.Option(help="Its largest extent over the real object's.")] = 0.8,
    turn: Annotated[float, typer.Option(help="About its vertical axis, degrees.")] = 0.0,
    pitch: Annotated[
        float | None,
        typer.Option(help="How far the camera looks down, degrees; else level, or as the base asks."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="The picture; <stem>_relit.png unless given.")
    ] = None,
    strip: Annotated[
        bool, typer.Option("--strip", help=f"The photo, then the object of {', '.join(STRIP)}.")
    ] = False,
    before: Annotated[bool, typer.Option("--before", help="The photo and the result side by side.")] = False,
    renderer: Annotated[
        Renderer, typer.Option(help="mitsuba traces paths; own shades; auto takes what is there.")
    ] = Renderer.auto,
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
    light: Annotated[
        Path | None, typer.Option(help="An .exr or .hdr map that estimate wrote, instead of an estimate.")
    ] = None,
    emitters: EmittersOption = MODE,
    model: Annotated[str, typer.Option(help="Bundled model, or a folder of graphs.")] = DEFAULT_MODEL,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
) -> None:
    """Put a virtual object beside the real one, with its shadow, lit by the estimated light."""
    from anyprobe.estimate.photo import load_photo
    from anyprobe.files.images import write_png
    from anyprobe.files.objects import open_object
    from anyprobe.relight.insert import PHOTO_MATERIAL, Arrangement, Stage, uses_mitsuba
    from anyprobe.scatter.materials import material_named

    where = where_for(photo, read_where(mask, box, click, click_off, depth, near, far))
    foot = point(at)
    if material != PHOTO_MATERIAL:
        material_named(material, PHOTO_MATERIAL)
    out = out or photo.with_name(f"{photo.stem}_relit.png")
    if out.suffix.lower() != ".png":
        raise OutputError(f"{out}: expected the name of a .png, got {out.suffix or 'no suffix'}")
    if out.resolve() in {
        given.resolve() for given in (photo, where["mask"], where["depth"], light) if given is not None
    }:
        raise OutputError(f"{out}: the result would replace an input; choose another name with -o")
    traced = uses_mitsuba(renderer)
    mesh = open_object(name)
    taken = load_photo(photo, fov_deg=fov, **where)
    radiance, gain = _radiance(taken, light, model, emitters)
    stage = Stage(taken, mesh, Arrangement(size=size, at=foot, turn_deg=turn, pitch_deg=pitch))
    shadow = stage.shadow(radiance)
    names = STRIP if strip else (material,)
    pictures = [stage.relit(radiance, one, renderer, shadow) for one in names]
    if strip or before:
        pictures.insert(0, taken.rgb)
    write_png(out, np.concatenate(pictures, axis=1))
    spot = stage.view.pixels(stage.placement.foot)
    hints = {
        "photo": str(photo),
        "picture": str(out),
        "object": name,
        "materials": list(names),
        "renderer": "mitsuba" if traced else "own",
        "foot_px": [round(float(v), 1) for v in spot],
        "pitch_deg": round(stage.placement.pitch_deg, 2),
        "long_fov_deg": round(stage.view.long_fov_deg, 2),
        "light_gain": round(gain, 3),
        "warnings": list(taken.warnings),
    }
    if as_json:
        print(json.dumps(hints))
    elif not quiet:
        print(
            f"{out}: {name} of {', '.join(names)} at {spot[0]:.0f},{spot[1]:.0f}, camera "
            f"{hints['pitch_deg']:g} degrees down, by {'Mitsuba' if traced else 'our own renderer'}",
            file=sys.stderr,
        )


def _radiance(photo, light: Path | None, model: str, emitters: str) -> tuple[np.ndarray, float]:
    """The given map, turned back to the camera; or the estimate, made as bright as the object asks, and its gain."""
    if light is not None:
        from anyprobe.export.exported_light import check_front, map_from_camera
        from anyprobe.files.radiance import read_radiance
        from anyprobe.light.environment import rotate

        radiance = read_radiance(light)
        check_front(light)
        turn = map_from_camera(light)
        if not np.allclose(turn, np.eye(3)):
            radiance = np.maximum(rotate(radiance, turn.T), 0.0)
        return radiance, 1.0
    from anyprobe.estimate.estimator import Estimator
    from anyprobe.relight.appearance import least_scale

    radiance = Estimator(model, emitters=emitters).from_photo(photo).radiance
    gain = least_scale(photo, radiance)
    return radiance * np.float32(gain), gain


def point(text: str | None) -> tuple[float, float] | None:
    """The pixel of --at; None where it is absent."""
    if text is None:
        return None
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != 2 or not np.isfinite(found).all():
        raise InputError(f"--at: expected X,Y in pixels, got {text!r}; for instance --at 400,380")
    return found
