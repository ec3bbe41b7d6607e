"""Models and baselines on real photos.

python -m research.real_photos DIR...              # under a lamp of known direction, or with measured maps
python -m research.real_photos hidden DIR...       # what a crop of each photo hides
python -m research.real_photos stability DIR...    # the same photos mirrored, cropped, brighter, with other masks
python -m research.real_photos balls MAPS          # mirror balls drawn under maps
python -m research.real_photos outdoors DIR...     # indoors or outdoors, beside kinds.csv
python -m research.real_photos.sheet DIR... -o OUT # pages to look at

research/real_photos/README.md describes folders and figures.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app, print_table
from anyprobe.errors import InputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.runtime import Models, model_id
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe_train.evaluate.methods import baselines, model_methods
from research.figure_tables import print_figures
from research.model_names import titles_of
from research.real_photos import hidden as hidden_ring
from research.real_photos import stability as changes
from research.real_photos.balls import ball_angle, balls_under
from research.real_photos.folders import masked_photos
from research.real_photos.lamps import Angle, lamp_angles, lamp_groups, load_lamps
from research.real_photos.maps import load_real, read_real, score_real
from research.real_photos.matched import WORDS, kinds_by_eye
from research.real_photos.sheet import write_pages
from research.results import commit, write_result

Folders = Annotated[Path, Parameter(required=True, help="Folders of photos.")]
Model = Annotated[str, Parameter(help="Bundled model or folder.")]


app = new_app(__doc__)


@app.default  # folders without a command
@app.command()
def score(
    *folders: Folders,
    model: Annotated[list[str] | None, Parameter(help="Bundled model or folder; repeat for more.")] = None,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write.")] = Path("runs/real.json"),
) -> None:
    """Score models and baselines on photos with a known lamp, by object, and on photos with measured maps."""
    names = model or [DEFAULT_MODEL]
    titles = titles_of(names)
    listed = {folder: read_real(folder) for folder in folders}
    methods = baselines()
    for name, title in zip(names, titles, strict=True):
        methods |= model_methods(Models(name), title)
    pairs = (pair for folder, rows in listed.items() for pair in load_real(folder, rows))
    estimators = {
        f"{title}, " if len(names) > 1 else "": Estimator(name) for name, title in zip(names, titles, strict=True)
    }
    objects: dict[str, str] = {}
    angles: dict[str, dict[str, Angle]] = {}
    for folder, rows in listed.items():
        for photo in load_lamps(folder, rows):
            objects[photo.name] = photo.object
            angles[photo.name] = lamp_angles(photo, {CHROME: baselines()[CHROME]}, estimators)
    content = {
        "commit": commit(),
        "models": {Path(name).name: model_id(name) for name in names},
        "maps": score_real(pairs, methods),
        "lamps": lamp_groups(objects, angles) if angles else {},
        "photos": {name: {method: _plain(one) for method, one in row.items()} for name, row in angles.items()},
    }
    for kind, one in content["maps"].items():
        for row in one["rows"]:
            figures = ", ".join(f"{name} {value:.3f}" for name, value in row.items() if name != "method")
            print(f"{kind}, {one['pairs']} photos, {row['method']}: {figures}")
    for group, one in content["lamps"].items():
        if one["objects"] > 1:
            print_figures(f"{group}: {one['photos']} photos of {one['objects']} objects", one["rows"], LAMP_COLUMNS)
    if angles:
        _print_by_object(content["lamps"])
    write_result(out, content)
    print(out)


CHROME = "chrome sphere"
"""The baseline that takes the object for a mirror; the mean map has one light for all photos."""
LAMP_COLUMNS = {
    "mean_deg": "mean",
    "median_deg": "median",
    "upper_decile_deg": "90 %",
    "said_deg": "said, median",
    "holds": "holds in",
    "ranks": "rank correlation",
}


@app.command()
def hidden(
    *folders: Folders,
    model: Model = DEFAULT_MODEL,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write.")] = Path("runs/hidden.json"),
    sheets: Annotated[Path | None, Parameter(help="Folder for pages of pictures.")] = None,
) -> None:
    """Compare what a crop of each photo hides with the map that is estimated from the crop; masks are given."""
    estimator = Estimator(model)
    scores, pictures = {}, []
    for name, (path, mask) in masked_photos(folders).items():
        ring = hidden_ring.load_ring(path, mask)
        if isinstance(ring, str):
            print(f"{name}: left out, {ring}", file=sys.stderr)
            continue
        maps = hidden_ring.maps_of(ring, estimator)
        scores[name] = hidden_ring.score_ring(ring, maps)
        if sheets is not None:
            pictures.append(hidden_ring.draw(name, ring, maps))
    rows = hidden_ring.summary(scores)
    print_figures(f"hidden ring: {len(scores)} photos", rows, hidden_ring.COLUMNS)
    write_result(out, {"commit": commit(), "model": model_id(model), "rows": rows, "photos": scores})
    print(out)
    for page in write_pages(pictures, sheets) if sheets is not None else ():
        print(page)


@app.command()
def stability(
    *folders: Folders,
    model: Model = DEFAULT_MODEL,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write.")] = Path("runs/stability.json"),
) -> None:
    """Measure how far the dominant light moves where the same photo is given in another way; masks are given."""
    estimator, moved = Estimator(model), {}
    for name, (path, mask) in masked_photos(folders).items():
        moved[name] = changes.moved_lights(path, mask, estimator)
    rows = changes.summary(moved)
    print_figures(f"change of the dominant light, degrees: {len(moved)} photos", rows, changes.COLUMNS)
    write_result(out, {"commit": commit(), "model": model_id(model), "rows": rows, "photos": moved})
    print(out)


@app.command()
def balls(
    maps: Annotated[Path, Parameter(help="Folder of .exr and .hdr maps.")],
    /,
    *,
    model: Model = DEFAULT_MODEL,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write.")] = Path("runs/balls.json"),
) -> None:
    """Measure the dominant light of mirror balls, drawn under maps that have one, without any option."""
    estimator = Estimator(model)
    found = {}
    for ball in balls_under(maps):
        known, degrees = ball_angle(ball, estimator)
        clipped = round(ball.clipped_deg, 2)
        found[ball.name] = {"recognised": known, "deg": round(degrees, 2), "clipped_map_deg": clipped}
        print(f"{ball.name}: {degrees:.1f} degrees{'' if known else ', not recognised'}")
    angles = np.array([one["deg"] for one in found.values()])
    if not len(angles):
        raise InputError("expected maps with a dominant light, found none; choose another folder", subject=str(maps))
    known = sum(bool(one["recognised"]) for one in found.values())
    limit = sum(one["clipped_map_deg"] <= 8 for one in found.values())
    print(
        f"{known} of {len(found)} recognised; {(angles <= 8).sum()} within 8 degrees, median {np.median(angles):.1f}; "
        f"the true maps, clipped as the photos: {limit}"
    )
    write_result(out, {"commit": commit(), "model": model_id(model), "balls": found})
    print(out)


@app.command()
def outdoors(*folders: Folders, model: Model = DEFAULT_MODEL) -> None:
    """Count the photos that are rightly said to show indoors or outdoors, where kinds.csv has one; masks are given."""
    estimator, kinds, right = Estimator(model), kinds_by_eye(), {}
    for path, mask in masked_photos(folders).values():
        name = f"{path.parent.name}/{path.name}"
        if (kind := kinds.get(name)) in WORDS.values():
            right[name] = kind == WORDS[(estimator.from_photo(load_photo(path, mask=mask)).outdoors or 0.0) > 0.5]
    print("wrong:", ", ".join(name for name, is_right in right.items() if not is_right) or "none")
    print(f"{sum(right.values())} of {len(right)} right")


def _print_by_object(groups: dict[str, dict[str, Any]]) -> None:
    """Print mean, median and 90 % of every method side by side, one object a line."""
    methods = next(iter(groups.values()))["rows"]
    table = Table("", "photos", *methods, title="mean, median, 90 % [degrees] by object", title_justify="left")
    keys = ("mean_deg", "median_deg", "upper_decile_deg")
    for group, one in groups.items():
        cells = (", ".join(f"{row[key]:.1f}" for key in keys) for row in one["rows"].values())
        table.add_row(group, str(one["photos"]), *cells)
    print_table(Console(highlight=False), table)


def _plain(angle: Angle) -> dict[str, float]:
    said = {} if angle.said_deg is None else {"said_deg": round(angle.said_deg, 2)}
    return {"deg": round(angle.deg, 2), **said}


if __name__ == "__main__":
    run_command(app)
