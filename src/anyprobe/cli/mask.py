"""anyprobe mask: masks from photos, and a picture that shows each."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

from anyprobe.cli import photo_files
from anyprobe.cli.options import OPTIONS, JsonOption, MarksOption, Photos, PlaceOptions, QuietOption, folder_option
from anyprobe.errors import AnyprobeError, InputError
from anyprobe.files.atomic import check_folder
from anyprobe.inputs.hints import Hints
from anyprobe.masks.networks import NetworkSource


def mask(
    *photos: Photos,
    place: PlaceOptions = PlaceOptions(),
    out: Annotated[Path, folder_option("Folder for the results.")] = Path("masks"),
    marks: MarksOption = None,
    fetch: bool = False,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Find the object.

    Writes <stem>_mask.png and, for inspection, <stem>_overlay.png per photo.

    Args:
        fetch: First download U2-Net-p (4.6 MB), the better mask network, if it is missing.
    """
    if fetch:
        from anyprobe.masks.weights import fetch_weights

        print(f"U2-Net-p: {fetch_weights().path}")
    if not photos:
        if fetch:
            return
        raise InputError("expected photos or folders of photos, got none; give one, or --fetch", subject="photo")
    hints, segmenter = place.hints(), place.open_segmenter()
    paths = photo_files.list_photos(photos)
    marked = photo_files.marks_of(marks, paths)
    photo_files.check_distinct(paths)
    check_folder(out)
    failed, warnings = False, []
    for path in paths:
        try:
            summary, doubts = _write(path, out, photo_files.hints_for(path, hints, marked), paths, segmenter)
            if as_json:
                print(json.dumps(summary), flush=True)
            elif not quiet:
                said = f", {summary['said']}" if summary["said"] else ""
                share = f"{100 * summary['share']:.0f} % of the photo"
                print(f"{summary['mask']}: by {summary['source']}, {share}{said}")
            warnings += doubts
        except AnyprobeError as error:
            print(f"anyprobe: {photo_files.photo_line(path, error)}", file=sys.stderr)
            failed = True
    for warning in () if quiet else photo_files.joined(warnings):
        print(f"warning: {OPTIONS.line(warning)}", file=sys.stderr)
    if failed or (place.strict and warnings):
        sys.exit(2)


def _write(
    path: Path, out: Path, hints: Hints, listed: list[Path], segmenter: NetworkSource | None
) -> tuple[dict[str, Any], list[str]]:
    """Write one photo's two files; return how the mask was found, for JSON, and what is doubted."""
    from anyprobe.estimate.doubts import scale_doubts
    from anyprobe.estimate.sheet import draw_overlay
    from anyprobe.masks.find import find_mask
    from anyprobe.pictures.images import read_image, write_png

    targets = {kind: out / f"{photo_files.result_stem(path, listed)}_{kind}.png" for kind in ("overlay", "mask")}
    photo_files.check_names(path, listed, targets.values(), hints.files().values())
    pixels = read_image(photo_files.photo_source(path), photo_files.photo_name(path))
    found = find_mask(pixels, **hints.place(), segmenter=segmenter)
    write_png(targets["overlay"], draw_overlay(pixels.rgb, found.mask, found.prompts.on, found.prompts.off))
    write_png(targets["mask"], found.mask)
    doubts = [*pixels.warnings, *scale_doubts(pixels.radiance, pixels.name), *found.warnings]
    summary = {
        "photo": str(path),
        "mask": str(targets["mask"]),
        "source": found.source,
        "confidence": None if found.confidence is None else round(float(found.confidence), 4),
        "said": found.verdict,
        "share": round(float((found.mask > 0.5).mean()), 4),
        "warnings": [OPTIONS.line(one) for one in doubts],
    }
    return summary, doubts
