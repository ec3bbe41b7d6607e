"""anyprobe relight: a virtual object beside the real one, lit by the estimate."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Timer
from typing import Annotated, Any

import numpy as np
from cyclopts import Group, Parameter

from anyprobe import session
from anyprobe.cli import options
from anyprobe.cli.photo_files import hints_for, photo_name, photo_source, result_stem
from anyprobe.core.color import to_bytes
from anyprobe.errors import InputError, InvalidMask, OutputError, arguments_named
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import USUAL_ERROR_DEG, pitch_words
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.sidecar import Origin
from anyprobe.estimate.sun_hint import place_of_sun
from anyprobe.export.exported_light import read_with_origin
from anyprobe.files.atomic import check_writable
from anyprobe.files.objects import MESH_SUFFIXES, open_object
from anyprobe.files.paths import is_same_file
from anyprobe.inputs.description import numbers_in
from anyprobe.inputs.hints import HINTS
from anyprobe.light.environment import rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import opaque_linear
from anyprobe.pictures.headers import MAX_PIXELS
from anyprobe.pictures.images import read_image, write_png
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import PHOTO_MATERIAL, Arrangement, Stage
from anyprobe.relight.passes import passes_of, write_passes
from anyprobe.relight.placement import check_foot, check_height
from anyprobe.render.mesh import Mesh
from anyprobe.scatter.materials import material_named

_SUFFIXES = (".png", ".exr")
TRANSPARENT = (
    "the photo is partly transparent: the result is opaque there, and the object does not mirror those parts; "
    "give an opaque photo, or take object and shadow from an .exr"
)
SHOWN_AFTER_S = 1.0
OF_ESTIMATES = [*(name for name, hint in HINTS.items() if hint.about == "light"), *("model", "providers", "threads")]
"""Parameters that only affect an estimate."""
PANORAMA_ROWS = 512
"""Rows of the panorama that an inserted object mirrors."""
PLACING = {"size": "scale", "turn_deg": "turn"}
"""The options of an object's placement, by their names in Python."""
placing = arguments_named(**PLACING)
"""Decorator that renames arguments in errors on an object's placement."""
SHAPES = "sphere, vase, pebble, block, solid"
MESHES = ", ".join(MESH_SUFFIXES)


@Parameter(name="*", group=Group("Inserted object", sort_key=0))
@dataclass(frozen=True, kw_only=True)
class InsertOptions:
    """The inserted object's material and place."""

    insert_material: Annotated[
        str,
        Parameter(help="chrome, gold, plastic, matte, one of `anyprobe materials`, or photo: like the real object."),
    ] = "chrome"
    at: Annotated[
        str | None,
        Parameter(
            metavar="X,Y",
            allow_leading_hyphen=True,
            help="Its ground contact point, in pixels; default: beside the object.",
        ),
    ] = None
    scale: Annotated[float, Parameter(help="Its height, relative to the real object's.")] = 0.5

    def foot(self) -> tuple[float, float] | None:
        """Return the pixel of --at, or None."""
        if self.at is None:
            return None
        numbers = numbers_in(self.at, 2)
        if not numbers:
            raise InvalidMask(f"expected X,Y in pixels, got {self.at!r}; for instance 400,380", subject="at")
        return numbers[0], numbers[1]

    def mesh(self, insert: str) -> Mesh:
        """Open the object that --insert names. InputError if it or its material is unknown."""
        with arguments_named(material="insert_material", object="insert", mesh="insert"):
            if self.insert_material != PHOTO_MATERIAL:
                material_named(self.insert_material, PHOTO_MATERIAL)
            mesh = open_object(insert)
            check_height(mesh)
            return mesh


def relight(
    photo: Annotated[Path, Parameter(name="PHOTO")],
    /,
    *,
    given: options.ObjectOptions = options.ObjectOptions(),
    models: options.ModelOptions = options.ModelOptions(),
    inserting: InsertOptions = InsertOptions(),
    insert: Annotated[
        str, Parameter(metavar="SHAPE|FILE", help=f"Object to insert: {SHAPES}, or a mesh ({MESHES}), +Y up.")
    ] = "sphere",
    turn: float = 0.0,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), metavar="FILE")] = None,
    light: Path | None = None,
    colorspace: options.ColorspaceOption = "rec709",
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Insert a virtual object, lit by the estimated light.

    It stands beside the real one and casts a shadow.

    Args:
        photo: The photo with the object; - for stdin.
        turn: Its rotation about the vertical axis, degrees.
        out: File to write, .png, or .exr with passes; or a folder for <stem>_relit.png, by default relit.
        light: Use this .exr or .hdr map that estimate wrote, instead of an estimate.
    """
    if photo.is_dir():
        raise InputError("is a folder; name one photo", subject="photo", source=photo)
    if light is not None:
        options.refuse_unused("with --light", *OF_ESTIMATES)
    material, size, strict = inserting.insert_material, inserting.scale, given.strict
    hints, segmenter = hints_for(photo, given.hints()), given.open_segmenter()
    contact, mesh = inserting.foot(), inserting.mesh(insert)
    place = placing(Arrangement)(size=size, at=contact, turn_deg=turn)
    out = out or Path("relit")
    if not out.suffix:
        out /= f"{result_stem(photo, [photo])}_relit.png"
    kind = out.suffix.lower()
    if kind not in _SUFFIXES:
        raise OutputError(f"expected a name that ends in {', '.join(_SUFFIXES)}, got {kind}; change it", source=out)
    if kind != ".exr":
        options.refuse_unused("without an .exr", "colorspace")
    inputs = (photo, light, *hints.files().values())
    if any(is_same_file(out, path) for path in inputs if isinstance(path, Path)):
        raise OutputError("the result would replace an input; choose another name with -o", source=out)
    check_writable(out)
    source_of_light = read_with_origin(light) if light else models.estimator()
    silent = quiet or as_json
    with progress(f"reading {photo}", silent):
        source = photo_source(photo)
        pixels = read_image(source, photo_name(photo))
        hints = replace(hints, sun=place_of_sun(hints.sun, source))
        check_foot(contact, *pixels.rgb.shape[:2])
        loaded = session.mark(session.Shot(source=pixels, name=pixels.name, hints=hints), segmenter)
    with progress("estimating the light", silent):
        radiance, gain, place, doubts = _lit(place, loaded, source_of_light, models)
    stage, ground = placing(Stage)(loaded, mesh, place), place.ground
    if kind == ".exr":
        with progress(f"drawing the {insert}", silent):
            passes = passes_of(stage, radiance, material)
        with progress(f"writing {out}", silent):
            write_passes(out, passes, colorspace, opaque_linear(source, colorspace, MAX_PIXELS))
    else:
        picture = to_bytes(loaded.rgb)
        with progress(f"drawing the {insert}", silent):
            region, changed = stage.change(radiance, material)
            picture[region] = to_bytes(changed)
        with progress(f"writing {out}", silent):
            write_png(out, picture)
    contact_px = stage.view.pixels(stage.placement.foot)
    caveats = [] if loaded.hidden is None else [TRANSPARENT]
    warnings = list(dict.fromkeys([*doubts, *(one.naming(PLACING) for one in stage.warnings), *caveats]))
    summary = {
        "photo": str(photo),
        "picture": str(out),
        "object": insert,
        "material": material,
        "foot_px": [round(float(v), 1) for v in contact_px],
        "pitch_deg": round(stage.placement.pitch_deg, 2),
        "long_fov_deg": round(stage.view.long_fov_deg, 2),
        "light_gain": round(gain, 3),
        "scale": round(size * stage.placement.share, 3),
        "warnings": [options.OPTIONS.line(line) for line in warnings],
    }
    for line in warnings:
        if not silent:
            print(f"warning: {options.OPTIONS.line(line)}", file=sys.stderr)
    if as_json:
        print(json.dumps(summary))
    elif not quiet:
        is_known = loaded.pitch_deg is not None or (ground is not None and ground.is_known)
        error_deg = None if is_known else USUAL_ERROR_DEG if ground is None else ground.pitch_error_deg
        camera = pitch_words(stage.placement.pitch_deg, error_deg=error_deg)
        said = f"{insert} of {material} at {contact_px[0]:.0f},{contact_px[1]:.0f}, camera {camera}"
        print(f"{out}: {said}", file=sys.stderr)
    if strict and summary["warnings"]:
        sys.exit(2)


@contextmanager
def progress(text: str, silent: bool) -> Iterator[None]:
    """Print a line to stderr if the block takes longer than SHOWN_AFTER_S."""
    timer = Timer(SHOWN_AFTER_S, lambda: print(f"{text} ...", file=sys.stderr, flush=True))
    if not silent:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _lit(
    place: Arrangement,
    photo: Photo,
    source: Estimator | tuple[np.ndarray, dict[str, Any], np.ndarray],
    models: options.ModelOptions,
) -> tuple[np.ndarray, float, Arrangement, tuple[str, ...]]:
    """Return radiance, gain, place with its ground, lens and light, and warnings of the given map, as read_with_origin
    reads it, or of an estimate.

    A given map is turned back to the camera's frame; its ground and lens are those stored with it, or else estimated
    from the photo. An estimate is scaled to the brightness that the object needs.
    """
    if isinstance(source, tuple):
        radiance, origin, turn = source
        if not np.allclose(turn, np.eye(3)):
            radiance = np.maximum(rotate(radiance, turn.T), 0.0)
        is_same_photo = origin.get("photo") == photo.name and "ground" in origin and photo.pitch_deg is None
        about = Origin.from_json(origin) if is_same_photo else session.estimate(models.estimator(), [photo]).origin
        place = replace(place, ground=about.ground, long_fov_deg=about.long_fov_deg)
        return radiance, 1.0, replace(place, toward_light=find_dominant_light(radiance).direction), photo.warnings
    light = session.estimate(source, [photo])
    gain = 1.0 if photo.material is not None else least_scale(photo, light.radiance)  # a material settles the level
    mirrored, likely = light.panorama(PANORAMA_ROWS, frame="camera", lit=True).radiance, light.dominant_light().exists
    place = replace(place, ground=light.ground, long_fov_deg=light.origin.long_fov_deg)
    place = replace(place, toward_light=find_dominant_light(mirrored).direction, likely=likely)
    return mirrored * np.float32(gain), gain, place, light.warnings
