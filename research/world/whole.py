"""Whole photos: render those that a folder lacks, score a model and baselines on them.

python -m research.world.whole render --data DATA --kept DIR [--part test]
python -m research.world.whole score --data DATA --kept DIR [--part test] [--predictions MAPS]
python -m research.world.whole write-photos --data DATA --kept DIR --out PHOTOS [--part test]

Rendering needs Mitsuba 3 (`.[judge]`) and an LLVM of 17 or newer.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import model_id
from anyprobe.files.atomic import atomic_files
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe_train.evaluate.benchmark import read_predictions, write_photo
from research.results import commit, write_result
from research.world.judgement import ALL, CUT_OUTS, Judgement, print_groups
from research.world.whole_photos import COUNT, PARTS, recipes_of, renders, store_of, whole_photos
from research.world.whole_rows import SHIPPED, predicted_rows, rows_of
from research.world.whole_scores import score as score_photo

app = new_app(__doc__)
Data = Annotated[Path, Parameter(help="Folder with hdri and meshes.")]
Kept = Annotated[Path, Parameter(help="Folder for the renders.")]
Part = Annotated[str, Parameter(help=f"One of {', '.join(PARTS)}.")]


@app.command()
def render(*, data: Data, kept: Kept, part: Part = "test", count: int = COUNT, first: int = 0) -> None:
    """Render what is missing, from number `first` on, and print one line a photo."""
    store = store_of(data, part)
    for number, (recipe, scene, _) in enumerate(renders(store, part, kept, count, first), first + 1):
        names = store.map(recipe.map_id).name, store.shape(recipe.shape_id).name
        print(f"{number} {recipe.key} {' '.join(names)}, pitch {scene.phone.pitch_deg:.0f} deg {scene.cut_out}")


@app.command()
def score(
    *,
    data: Data,
    kept: Kept,
    part: Part = "test",
    count: int = COUNT,
    model: Annotated[str, Parameter(help="Bundled model or folder.")] = DEFAULT_MODEL,
    predictions: Annotated[
        Path | None, Parameter(help="Folder of maps KEY.exr or KEY.hdr to score in the model's place.")
    ] = None,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="File to write.")] = None,
) -> None:
    """Print the figures of every row with standard errors by map: of photos, of each family, and of cut-outs."""
    if predictions is None:
        first, rows_on = SHIPPED, partial(rows_of, estimator=Estimator(model, threads=1))
    else:
        keys = [one.key for one in recipes_of(part, count)]
        first = predictions.resolve().name
        rows_on = partial(predicted_rows, name=first, maps=read_predictions(predictions, keys))
    judged = Judgement()
    for number, photo in enumerate(whole_photos(data, part, kept, count), 1):
        rows = score_photo(photo, rows_on(photo))
        judged.add([CUT_OUTS] if photo.cut_out else [ALL, photo.family], photo.map_name, rows)
        print(f"{number} {photo.recipe.key} LDR RMSE {rows[first]['ldr_rmse']:.3f}", file=sys.stderr)
    groups = judged.table()
    print_groups(groups, part)
    content = {"commit": commit(), "model": model_id(model) if predictions is None else first, "groups": groups}
    write_result(out or Path(f"runs/whole-{part}.json"), content)


@app.command()
def write_photos(
    *,
    data: Data,
    kept: Kept,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder to write to.")],
    part: Part = "test",
    count: int = COUNT,
) -> None:
    """Write photo, mask and camera of every photo, by key: all that a method is given."""
    with atomic_files(out) as scratch:
        for photo in whole_photos(data, part, kept, count):
            fov_deg = photo.long_fov_deg if photo.fov_known else None
            write_photo(scratch, photo.recipe.key, photo.picture, photo.mask, fov_deg)
    print(f"{out}: photos written; maps go to a folder of their own, named by key")


if __name__ == "__main__":
    run_command(app)
