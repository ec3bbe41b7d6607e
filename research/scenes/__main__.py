"""python -m research.scenes: commands light-pairs, cut-outs, sheet, score, inserted.

Rendering needs Mitsuba 3, mitsuba-oidn and an LLVM of 17 or newer.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.cli.options import bounded
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import model_id
from anyprobe.inputs.settings import DEFAULT_MODEL
from research.results import commit, write_result
from research.scenes.layouts import FAMILIES
from research.scenes.parts import PARTS
from research.scenes.photos import scene_photos
from research.world.judgement import ALL, CUT_OUTS, Judgement, print_groups
from research.world.whole_rows import SHIPPED, rows_of
from research.world.whole_scores import score as score_photo

app = new_app(__doc__)
Data = Annotated[Path, Parameter(help="Folder with hdri and meshes.")]


@app.command(name="light-pairs")
def light_pairs(
    *,
    data: Data,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder of the files.")] = Path("runs/left_out"),
    part: Annotated[str, Parameter(help=f"One of {', '.join(PARTS)}.")] = "left-out",
    scenes: Annotated[int, Parameter(help="Scenes, two photos each."), bounded(1)] = 192,
    first: Annotated[int, Parameter(help="Number of the first scene."), bounded(0)] = 0,
) -> None:
    """Render scenes as the light network sees them; anyprobe-train run light scores by left-out ones."""
    from research.scenes.light_pairs import make_light_pairs

    for path in make_light_pairs(data, out, scenes, part, first):
        print(path)


@app.command(name="cut-outs")
def cut_outs(
    *,
    data: Data,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder of the files.")] = Path("runs/traced"),
    part: Annotated[str, Parameter(help=f"One of {', '.join(PARTS)}.")] = "train",
    count: Annotated[int, Parameter(help="Cut-outs."), bounded(1)] = 10_000,
    first: Annotated[int, Parameter(help="Number of the first one."), bounded(0)] = 0,
) -> None:
    """Render objects without surroundings, seen from any height, for anyprobe-train run light: left-out ones in
    runs/left_out/cut_outs score it."""
    from research.scenes.cut_outs import make_cut_outs

    for path in make_cut_outs(data, out, count, part, first):
        print(path)


@app.command()
def sheet(
    *,
    data: Data,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for FAMILY.jpg.")] = Path("runs/scenes-sheet"),
    part: Annotated[str, Parameter(help=f"One of {', '.join(PARTS)}.")] = "train",
    count: Annotated[int, Parameter(help="Photos of each family."), bounded(1)] = 12,
) -> None:
    """Draw photos with their masks, and their light, of each family."""
    from research.scenes.sheet import draw_sheets

    for path in draw_sheets(data, out, part, FAMILIES, count):
        print(path)


@app.command()
def score(
    *,
    data: Data,
    kept: Annotated[Path, Parameter(help="Folder for the renders.")] = Path("runs/world"),
    part: Annotated[str, Parameter(help="test or left-out.")] = "left-out",
    family: Annotated[list[str] | None, Parameter(help="Only this one; repeat for more.")] = None,
    model: Annotated[str, Parameter(help="Bundled model or folder.")] = DEFAULT_MODEL,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="File to write.")] = None,
) -> None:
    """Print the figures of the object alone and of the whole photo, with standard errors by map, by family."""
    judged, estimator = Judgement(), Estimator(model, threads=1)
    for photo in scene_photos(data, part, kept, tuple(family or FAMILIES)):
        rows = score_photo(photo, rows_of(photo, estimator))
        judged.add([CUT_OUTS] if photo.cut_out else [ALL, photo.family], photo.map_name, rows)
        print(f"{photo.recipe.key} LDR RMSE {rows[SHIPPED]['ldr_rmse']:.3f}", file=sys.stderr)
    groups = judged.table()
    print_groups(groups, part)
    content = {"commit": commit(), "model": model_id(model), "groups": groups}
    write_result(out or Path(f"runs/scenes-{part}.json"), content)


@app.command()
def inserted(
    *,
    data: Data,
    kept: Annotated[Path, Parameter(help="Folder for the renders.")] = Path("runs/world"),
    part: Annotated[str, Parameter(help="test or left-out.")] = "left-out",
    count: Annotated[int, Parameter(help="Photos of each family."), bounded(1)] = 5,
    model: Annotated[str, Parameter(help="Bundled model or folder.")] = DEFAULT_MODEL,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="File to write.")] = None,
) -> None:
    """Print how far inserted spheres and their shadows are from second renders with the spheres in the scene."""
    from research.scenes.inserted import compared, summary

    rows = []
    for row in compared(data, part, kept, Estimator(model, threads=1), count):
        rows.append(row)
        ways = [(name, one) for name, one in row.items() if isinstance(one, dict)]
        figures = [" ".join([name, *(f"{key} {value:.3g}" for key, value in one.items())]) for name, one in ways]
        truly = f"{row['true_depth']:.2f}, off {row['true_off']:.2f}"
        print(f"{row['scene']}: {truly}; {'; '.join(figures)}", file=sys.stderr)
    said = summary(rows)
    print(json.dumps(said, indent=1))
    content = {"commit": commit(), "model": model_id(model), "figures": said, "scenes": rows}
    write_result(out or Path(f"runs/scenes-inserted-{part}.json"), content)


if __name__ == "__main__":
    run_command(app)
