"""python -m research.real_photos DIR: models and baselines on photos with measured maps or a light source of known
direction; docs/evaluation.md describes the folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from anyprobe.cli.app import main as run_command
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import DEFAULT_MODEL, Models, model_id
from anyprobe.evaluate.methods import baselines, model_methods
from research.model_names import titles_of
from research.real_photos.lamps import GROUP, lamp_angles, lamp_group, load_lamps
from research.real_photos.maps import load_real, read_real, score_real
from research.results import commit, write_result


def real_photos(
    folder: Annotated[Path, typer.Argument(help="Folder of photos, masks and manifest.csv.")],
    model: Annotated[list[str] | None, typer.Option(help="Bundled model or folder; repeat for more.")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write.")] = Path("runs/real.json"),
) -> None:
    """Score every method on every photo; print means and medians by group."""
    names = model or [DEFAULT_MODEL]
    methods = baselines()
    titles = titles_of(names)
    for name, title in zip(names, titles, strict=True):
        methods |= model_methods(Models(name), title)
    rows = read_real(folder)
    groups = score_real(load_real(folder, rows), methods)
    estimators = {title: Estimator(name) for name, title in zip(names, titles, strict=True)}
    angles = lamp_angles(load_lamps(folder, rows), methods, estimators)
    if angles:
        groups[GROUP] = lamp_group(angles)
    models = {Path(name).name: model_id(name) for name in names}
    write_result(out, {"commit": commit(), "models": models, "groups": groups, "photos": angles})
    for kind, one in groups.items():
        for row in one["rows"]:
            figures = ", ".join(f"{name} {value:.3f}" for name, value in row.items() if name != "method")
            typer.echo(f"{kind}, {one['pairs']} photos, {row['method']}: {figures}")
    typer.echo(out)


if __name__ == "__main__":
    run_command(lambda: typer.run(real_photos))
