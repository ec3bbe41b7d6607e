"""anyprobe match: the panoramas of a folder that light like a photo."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from anyprobe import session
from anyprobe.cli.app import print_table
from anyprobe.cli.export import target_names
from anyprobe.cli.options import OPTIONS, JsonOption, ModelOptions, ObjectOptions, QuietOption, bounded, folder_option
from anyprobe.cli.photo_files import result_stem, shot_of
from anyprobe.errors import InputError
from anyprobe.estimate.result import Light
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.match.ranking import OWN_ERROR, MatchedMap, log_odds, same_kind, shading_apart
from anyprobe.notices import Notice, give

CLEAR_MARGIN = 1.0
"""Difference of misfits from which on one map is clearly better than another."""
UNLIKE = 0.4
"""Probability up to which a place and a map are hardly of one kind."""


def match(
    photo: Annotated[Path, Parameter(name="PHOTO")],
    folder: Annotated[Path | None, Parameter(name="FOLDER")] = None,
    /,
    *,
    given: ObjectOptions = ObjectOptions(),
    models: ModelOptions = ModelOptions(),
    out: Annotated[Path, folder_option("Folder for the results.")] = Path("match"),
    best: Annotated[int, bounded(1, 50)] = 3,
    outdoors: Annotated[bool | None, Parameter(negative="--indoors")] = None,
    apply: Annotated[str | None, Parameter(metavar="TARGET[,TARGET...]")] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Find the panoramas of a folder that light like a photo.

    Writes the best ones turned, exposed and tinted to fit the photo, a contact sheet with spheres and a list (.json).

    Args:
        photo: A photo, or - for standard input.
        folder: Folder of .hdr and .exr panoramas.
        best: Number of panoramas to write and show, up to 50.
        outdoors: The place is outdoors, or indoors; else as the networks say.
        apply: Also export the best one, as anyprobe export does.
    """
    from anyprobe.estimate.ground import pitch_words
    from anyprobe.estimate.sheet import draw_matches
    from anyprobe.export.targets import write_export
    from anyprobe.files.atomic import atomic_files
    from anyprobe.match.library import open_library
    from anyprobe.pictures.images import write_png

    if folder is None:
        raise InputError(
            "expected a folder of .hdr or .exr panoramas after the photo, got none; put some of your own or of a site "
            "such as polyhaven.com into one"
        )
    targets = [] if apply is None else target_names(apply, "apply")
    console = Console(stderr=True, quiet=quiet, markup=False, emoji=False, highlight=False)
    with console.status("reading the panoramas"):
        library = open_library(folder)
    if out.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"-o {out}: expected a folder outside the panoramas, got one among them; choose another")
    estimator = models.estimator(given.segmenter)
    loaded = session.mark(shot_of(photo, given.hints()), estimator.segmenter)
    light = session.estimate(estimator, [loaded])
    if outdoors is not None:
        light = replace(light, outdoors=float(outdoors))
    with console.status("comparing"):
        ranked = light.match(library)
    stem, chosen = result_stem(photo, [photo]), ranked[:best]
    safe = {candidate.rank: re.sub(r"[^\w.-]+", "_", candidate.name)[-80:] for candidate in chosen}
    files = {rank: f"{stem}_{rank + 1}_{name}.exr" for rank, name in safe.items()}
    warnings = [*light.warnings, *library.warnings]
    with atomic_files(out) as scratch, console.status("writing"):
        for candidate in chosen:
            candidate.write(scratch / files[candidate.rank])
        pictured = [("estimate", light.panorama(256, frame="camera").radiance)]
        pictured += [(f"{candidate.rank + 1}: {candidate.name}", candidate.radiance(256)) for candidate in chosen]
        warnings += match_doubts(light, chosen[0])
        write_png(scratch / f"{stem}_match.png", draw_matches(loaded, pictured))
        report = {
            "photo": loaded.name,
            "folder": str(folder),
            "maps": len(ranked),
            "warnings": [OPTIONS.line(warning) for warning in warnings],
            "matches": [
                candidate.sidecar() | ({"written": files[candidate.rank]} if candidate in chosen else {})
                for candidate in ranked
            ],
        }
        (scratch / f"{stem}_match.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    for target in targets:
        first = chosen[0]
        origin = {"photo": loaded.name, "match": first.sidecar()}
        warnings += write_export(first.radiance(), target, out, stem, origin=origin)[1]
    if as_json:
        print(json.dumps(report), flush=True)
    table = Table("", "panorama", "misfit", "turned", "exposure", box=None, pad_edge=False)
    for candidate in chosen:
        table.add_row(
            str(candidate.rank + 1),
            candidate.name,
            f"{candidate.misfit - ranked[0].misfit:+z.2f}" if candidate.rank else "best",
            f"{candidate.yaw_deg:+z.0f}°, camera {pitch_words(candidate.pitch_deg, '°')}",
            f"{candidate.exposure_ev:+z.1f} EV",
        )
    print_table(console, table)
    num_close = sum(candidate.misfit < ranked[0].misfit + CLEAR_MARGIN for candidate in ranked)
    if num_close > 1:
        close = f"{num_close} of {len(ranked)} panoramas explain the photo about equally well"
        console.print(f"{close}; see {out / stem}_match.png", soft_wrap=True)
    for warning in warnings:
        console.print(f"warning: {OPTIONS.line(warning)}", soft_wrap=True)
    console.print(f"results: {out / stem}_*", soft_wrap=True)
    if given.strict and warnings:
        sys.exit(2)


def match_doubts(light: Light, first: MatchedMap) -> list[Notice]:
    """Return what is doubtful about a light's first map."""
    to_camera = light.map_from_camera.T
    radiance, estimate = rotate(first.radiance(MAP_HEIGHT), to_camera), rotate(light.radiance, to_camera)
    doubts = fit_doubts(estimate, radiance)
    if light.pitch_deg is None:
        text = "the camera's pitch is unknown, so maps may be tilted"
        doubts.append(Notice(text, code="pitch-unknown", remedy=give("pitch_deg")))
    return doubts + kind_doubts(light.outdoors, first.library.lights[first.index], first.name)


def fit_doubts(estimate: np.ndarray, radiance: np.ndarray) -> list[Notice]:
    """Return a warning if the first map shades a matte sphere further from the estimate than the estimate's own error.

    Then no other map shades it as the estimate does, either. Both maps [H, 2H, 3] are in the camera's frame.
    """
    apart = shading_apart(radiance, estimate)
    if apart <= OWN_ERROR:
        return []
    text = (
        f"no panorama fits: the first one shades a matte sphere {apart:.1f} stops off the estimate, more than the "
        "estimate's own error; use the estimate itself, or other panoramas"
    )
    return [Notice(text, code="match-fit")]


def kind_doubts(outdoors: float | None, radiance: np.ndarray, name: str) -> list[Notice]:
    """Return a warning if a panorama [H, 2H, 3] is hardly of the same kind of place as a light's, which is outdoors
    with this probability, see match.ranking."""
    theirs = log_odds(radiance[None])
    if same_kind(outdoors, theirs)[0] > UNLIKE:
        return []
    kinds = ("outdoors", "indoors") if theirs[0] > 0 else ("indoors", "outdoors")
    text = "looks {}, but the light is as {}; check the map before using it".format(*kinds)
    return [Notice(text, code="match-kind", source=name)]
