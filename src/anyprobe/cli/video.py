"""anyprobe video: a clip in, a track of lights and a relit clip out."""

from __future__ import annotations

import hashlib
import json
import shlex
import sys
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from anyprobe.cli.options import EmittersOption, SurroundingsOption, read_surroundings_option, read_where
from anyprobe.cli.relight import Renderer, point
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import DEFAULT_MODEL, MODE

LINE_S = 30
"""Between two lines of progress where there is no terminal."""


def video(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A video file.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")],
    name: Annotated[
        str | None,
        typer.Option("--object", help="Also write relit.mp4 with this object; see anyprobe relight."),
    ] = None,
    material: Annotated[str, typer.Option(help="Of the object; see anyprobe relight.")] = "chrome",
    at: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Where its foot stands, in pixels; else beside.")
    ] = None,
    size: Annotated[float, typer.Option(help="Its largest extent over the real object's.")] = 0.8,
    pitch: Annotated[
        float | None, typer.Option(help="How far the camera looks down, degrees; see anyprobe relight.")
    ] = None,
    renderer: Annotated[Renderer, typer.Option(help="Who draws the object.")] = Renderer.own,
    every: Annotated[int, typer.Option(min=1, metavar="N", help="A light for every Nth frame.")] = 1,
    exr: Annotated[bool, typer.Option("--exr", help="Also write the maps as lights/<frame>.exr.")] = False,
    masks: Annotated[
        Path | None, typer.Option(help="Folder of one mask a frame, sorted by name; white = object.")
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(metavar="X0,Y0,X1,Y1", help="Box around the object in the first frame, in pixels."),
    ] = None,
    click: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="A point on the object in the first frame; repeatable."),
    ] = None,
    click_off: Annotated[
        list[str] | None, typer.Option("--not", metavar="X,Y", help="A point beside the object; repeatable.")
    ] = None,
    fov: Annotated[
        float | None, typer.Option(help="Field of view of the video's longer side, degrees.")
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(help="JSON of how the camera is turned in each frame; see docs/video.md.")
    ] = None,
    surroundings: SurroundingsOption = None,
    emitters: EmittersOption = MODE,
    restart: Annotated[bool, typer.Option("--restart", help="Begin anew in a folder already begun.")] = False,
    model: Annotated[str, typer.Option(help="Bundled model, or a folder of graphs.")] = DEFAULT_MODEL,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
) -> None:
    """Follow the light through a clip: track.json, and relit.mp4 with --object; goes on where it stopped."""
    from anyprobe.estimate.estimator import Estimator
    from anyprobe.files.objects import open_object
    from anyprobe.files.poses import read_poses
    from anyprobe.relight.insert import PHOTO_MATERIAL, Arrangement, uses_mitsuba
    from anyprobe.scatter.materials import material_named
    from anyprobe.video.clip import open_clip, upright_size
    from anyprobe.video.following import MaskFollower
    from anyprobe.video.run import ClipRun, VirtualObject, forget_run

    given = {name: v for name, v in read_where(None, box, click, click_off, None, None, None).items() if v}
    foot = point(at)
    if masks is not None and given:
        raise InputError("--masks, and a box or clicks: expected one of them, got both")
    if poses is not None and name is not None:
        raise InputError(
            "--poses and --object: expected one of them; relit clips need a camera that stands still"
        )
    if material != PHOTO_MATERIAL:
        material_named(material, PHOTO_MATERIAL)
    header = open_clip(clip)
    given_poses = None if poses is None else read_poses(poses)
    turned = None if given_poses is None else given_poses.in_order()
    if turned is not None and len(turned) < header.num_frames:
        raise InputError(f"{poses}: expected {header.num_frames} poses, one a frame, got {len(turned)}")
    if given_poses is not None and fov is None:
        fov = given_poses.clip_fov_deg(*upright_size(header))
    virtual = None
    if name is not None:
        kind = "mitsuba" if uses_mitsuba(renderer) else "own"
        place = Arrangement(size=size, at=foot, pitch_deg=pitch)
        virtual = VirtualObject(mesh=open_object(name), material=material, arrangement=place, renderer=kind)
    follower = MaskFollower(masks, given, fov, read_surroundings_option(surroundings))
    estimator = Estimator(model, emitters=emitters)
    settings = {
        "clip": clip.name,
        "clip_bytes": clip.stat().st_size,
        "model": estimator.model_id,
        "every": every,
        "exr": exr,
        "first_frame": given,
        "fov_deg": fov,
        "poses": None if turned is None else hashlib.sha256(turned.tobytes()).hexdigest()[:16],
        **follower.content(),
        "emitters": emitters,
        "object": name,
        "material": material if name else None,
        "at": foot,
        "object_size": size,
        "pitch_deg": pitch,
        "renderer": virtual.renderer if virtual else None,
    }
    if restart:
        forget_run(out)
    run = ClipRun(
        header, out, estimator, follower, settings, every=every, exr=exr, virtual=virtual, poses=turned
    )
    talk = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    begun, start = run.progress.next_index, time.monotonic()
    if begun:
        talk.print(f"{out}: goes on at frame {begun}")
    try:
        outcome = _watched(run, header.num_frames or None, begun, talk)
    except KeyboardInterrupt:
        talk.print(f"anyprobe: stopped; go on with {shlex.join(['anyprobe', *sys.argv[1:]])}", soft_wrap=True)
        raise
    seconds = time.monotonic() - start
    for index, line in outcome.bad:
        talk.print(f"warning: frame {index}: kept the light before it: {line}", soft_wrap=True)
    if outcome.damaged:
        talk.print(f"warning: {clip.name}: {outcome.damaged} damaged pieces left out", soft_wrap=True)
    summary = {
        "track": str(out / "track.json"),
        "relit": str(out / "relit.mp4") if virtual else None,
        "frames": outcome.frames,
        "bad": [{"index": index, "error": line} for index, line in outcome.bad],
        "damaged": outcome.damaged,
        "seconds": round(seconds, 2),
    }
    if as_json:
        print(json.dumps(summary))
    rate = (outcome.frames - begun) / max(seconds, 1e-9)
    talk.print(f"{out}: {outcome.frames} frames, {len(outcome.bad)} bad, {rate:.1f} a second", soft_wrap=True)


def _watched(run, total: int | None, begun: int, talk: Console):
    """A bar on a terminal, else a line now and then."""
    said = time.monotonic()
    with Progress(console=talk, transient=True, disable=not talk.is_terminal) as bar:
        task = bar.add_task("frames", total=total, completed=begun)

        def watch(done: int) -> None:
            nonlocal said
            bar.update(task, completed=done)
            if not talk.is_terminal and time.monotonic() - said > LINE_S:
                said = time.monotonic()
                talk.print(f"frame {done}" + (f" of {total}" if total else ""))

        return run(watch)
