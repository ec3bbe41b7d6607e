"""anyprobe evaluate --real: a model and the baselines on real photos with measured maps."""

from __future__ import annotations

from pathlib import Path

import typer

from anyprobe.cli.compare import open_methods, write_result

NOTE = (
    "Real photos; LDR maps and mirror balls (ball_...) against the measured map at the photo's exposure, "
    "main_light_deg the angle between main lights."
)


def evaluate_real(folder: Path, model: str, out: Path) -> None:
    """Score the folder's photos (docs/evaluation.md says how it looks) into real.json."""
    from anyprobe.evaluate.real import load_real, read_real, score_real

    rows = read_real(folder)
    methods, trained = open_methods([model])
    groups = score_real(load_real(folder, rows), methods)
    content = {
        "command": f"anyprobe evaluate --real {folder.name} --model {Path(model).name}",
        "note": NOTE,
        **trained,
        "groups": groups,
    }
    write_result(out / "real.json", content)
    for kind, one in groups.items():
        for row in one["rows"]:
            figures = ", ".join(f"{name} {value:.3f}" for name, value in row.items() if name != "design")
            typer.echo(f"{kind}, {one['pairs']} photos, {row['design']}: {figures}")
    typer.echo(out / "real.json")
