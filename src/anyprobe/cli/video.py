"""anyprobe video: a clip in, a track of lights and a relit clip out."""

from __future__ import annotations

import json
import shlex
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console
from rich.progress import Progress

from anyprobe.cli import options
from anyprobe.cli.relight import PLACING, SHAPES, InsertOptions, placing, progress
from anyprobe.errors import InputError, arguments_named

named_as_options = arguments_named(clip_digest="clip", insert_digest="insert", object_material="material")
"""Decorator that renames a run's settings in errors as the command's options."""
LINE_S = 5
"""Interval between lines of progress without a terminal [s]."""


def video(
    clip: Annotated[Path, Parameter(name="CLIP")],
    /,
    *,
    given: options.ObjectOptions = options.ObjectOptions(),
    models: options.ModelOptions = options.ModelOptions(),
    inserting: InsertOptions = InsertOptions(),
    out: Annotated[Path | None, options.folder_option("Folder for the results; default: <stem>_light.")] = None,
    insert: Annotated[
        str | None, Parameter(metavar="SHAPE|FILE", help=f"Also write relit.mp4 with {SHAPES}, or a mesh file.")
    ] = None,
    every: Annotated[int, Parameter(metavar="N"), options.bounded(1)] = 1,
    exr: bool = False,
    poses: Path | None = None,
    restart: bool = False,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Estimate the light in every frame of a clip.

    Writes track.json, light.mp4 (map and spheres of each frame), and relit.mp4 with --insert; an interrupted run
    resumes. Clicks and box refer to the first frame; --mask, --depth and --normals are folders with one file per frame,
    sorted by name (--normals may be sphere).

    Args:
        clip: A video file.
        every: Estimate a light for every Nth frame.
        exr: Also write the maps as lights/<frame>.exr.
        poses: transforms.json with the camera of each frame; see docs/how-to/video.md.
        restart: Restart, discarding earlier progress.
    """
    from anyprobe.estimate.poses import read_poses
    from anyprobe.files.atomic import check_writable
    from anyprobe.relight.insert import Arrangement
    from anyprobe.video.clip import clip_size, open_clip
    from anyprobe.video.following import HINT_SUFFIXES, MaskFollower
    from anyprobe.video.run import ClipRun, VirtualObject
    from anyprobe.video.track import digest_of, forget_run, sampled_digest

    if insert is None:
        options.refuse_unused("without --insert", "insert_material", "at", "scale")
    out = out or Path(f"{clip.stem}_light")
    name, material, size = insert, inserting.insert_material, inserting.scale
    hints, segmenter = given.hints(), given.open_segmenter()
    object_material = hints.surface()
    folders = {kind: path for kind, path in hints.files().items() if kind in HINT_SUFFIXES}
    first_frame: dict[str, Any] = {key: value for key, value in hints.given() if key in ("click", "exclude", "box")}
    if given.segmenter:
        first_frame["segmenter"] = given.segmenter
    contact = inserting.foot()
    if poses is not None and name is not None:
        text = "expected one of them, got both; relit clips need a static camera"
        raise InputError(text, subject=("poses", "insert"))
    mesh = None if name is None else inserting.mesh(name)
    given_mesh = (mesh.positions, mesh.faces) if mesh is not None and Path(insert or "").suffix else None  # of a file
    header = open_clip(clip)
    given_poses = None if poses is None else read_poses(poses)
    rotations = None if given_poses is None else given_poses.in_order()
    if rotations is not None and len(rotations) < header.num_frames:
        raise InputError(f"expected {header.num_frames} poses, one per frame, got {len(rotations)}", source=poses)
    if given_poses is not None and hints.fov_deg is None:
        hints = replace(hints, fov_deg=given_poses.clip_fov_deg(*clip_size(header)))
    virtual = None
    if mesh is not None:
        virtual = VirtualObject(mesh=mesh, material=material, arrangement=placing(Arrangement)(size=size, at=contact))
    handled = {*first_frame, *folders, "surroundings", "material", "albedo", "roughness"}
    every_frame = {key: value for key, value in hints.given() if key not in handled}
    check_writable(out / "track.json")
    shown = first_frame if segmenter is None else {**first_frame, "segmenter": segmenter}
    follower = MaskFollower(folders, shown, every_frame, hints.surroundings)
    with progress("opening the model", quiet):
        estimator = models.estimator()
    settings = {
        "clip": clip.name,
        "clip_digest": sampled_digest(clip),
        "model": estimator.model_id,
        "every": every,
        "exr": exr,
        "first_frame": first_frame,
        "every_frame": {key: value for key, value in every_frame.items() if isinstance(value, float | str)},
        "poses": None if rotations is None else digest_of([rotations.tobytes()]),
        **follower.content(),
        "object_material": None if object_material is None else repr(object_material),
        "insert": name,
        "insert_digest": None if given_mesh is None else digest_of([part.tobytes() for part in given_mesh]),
        "insert_material": material,
        "at": contact,
        "scale": size,
    }
    if restart:
        forget_run(out)
    run = named_as_options(ClipRun)(
        header,
        out,
        estimator,
        follower,
        settings,
        every=every,
        exr=exr,
        virtual=virtual,
        poses=rotations,
        material=object_material,
    )
    console = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    num_done, start = run.progress.next_index, time.monotonic()
    if num_done and num_done == header.num_frames:
        console.print(f"{out}: all {num_done} frames are done already; --restart starts over", soft_wrap=True)
    elif num_done:
        console.print(f"{out}: resumes at frame {num_done}")
    try:
        outcome = _watched(run, header.num_frames or None, num_done, console)
    except KeyboardInterrupt:
        console.print(f"anyprobe: stopped; resume with {shlex.join(['anyprobe', *sys.argv[1:]])}", soft_wrap=True)
        raise
    seconds = time.monotonic() - start
    for index, line in outcome.bad:
        text = _named(index, options.OPTIONS.line(line))
        console.print(f"warning: {text} (the previous light is kept)", soft_wrap=True)
    if outcome.damaged:
        console.print(f"warning: {clip.name}: {outcome.damaged} damaged pieces skipped", soft_wrap=True)
    warnings = [*outcome.notes, *(one.naming(PLACING) for one in run.place_warnings)]
    for line in warnings:
        console.print(f"warning: {options.OPTIONS.line(line)}", soft_wrap=True)
    summary = {
        "track": str(out / "track.json"),
        "light": str(out / "light.mp4"),
        "relit": str(out / "relit.mp4") if virtual else None,
        "frames": outcome.frames,
        "bad": [{"index": index, "error": options.OPTIONS.line(line)} for index, line in outcome.bad],
        "damaged": outcome.damaged,
        "warnings": [options.OPTIONS.line(line) for line in warnings],
        "seconds": round(seconds, 2),
    }
    if as_json:
        print(json.dumps(summary))
    rate = (outcome.frames - num_done) / max(seconds, 1e-9)
    speed = f", {rate:.1f} frames per second" if outcome.frames > num_done else ""
    failed = f", {len(outcome.bad)} of them without a light of their own" if outcome.bad else ""
    console.print(f"{out}: {outcome.frames} frames{failed}{speed}", soft_wrap=True)
    if given.strict and (warnings or outcome.bad or outcome.damaged):
        sys.exit(2)


def _named(index: int, line: str) -> str:
    """Prefix a frame's warning with the frame's number, once."""
    name = f"frame {index}"
    return line if line.startswith((f"{name}: ", f"{name} with ")) else f"{name}: {line}"


@placing
def _watched(run, total: int | None, num_done: int, console: Console):
    """Run with a progress bar on a terminal, else with a line for the first frame and every LINE_S."""
    last_line: float = -LINE_S
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("frames", total=total, completed=num_done)

        def watch(done: int) -> None:
            nonlocal last_line
            bar.update(task, completed=done)
            if not console.is_terminal and time.monotonic() - last_line >= LINE_S:
                last_line = time.monotonic()
                console.print(f"{done}{f' of {total}' if total else ''} frames done")

        return run(watch)
