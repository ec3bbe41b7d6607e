"""anyprobe evaluate --real: a model and the baselines on real photos with measured maps or known lamps."""

from __future__ import annotations

from pathlib import Path

import typer

from anyprobe.cli.compare import open_methods, write_result

MAP_NOTE = (
    "Real photos; LDR maps and mirror balls (ball_...) against the measured map at the photo's exposure, "
    "main_light_deg the angle between main lights."
)
LAMP_NOTE = (
    "Photos of which only the lamp's direction is known: the angle between the estimate's main light and the "
    "lamp in degrees, mean and median over photos."
)


def evaluate_real(folder: Path, model: str, out: Path) -> None:
    """Score the folder's photos (docs/evaluation.md says how it looks) into real.json."""
    from anyprobe.evaluate.lamps import GROUP, lamp_angles, lamp_group, load_lamps
    from anyprobe.evaluate.real import load_real, read_real, score_real

    rows = read_real(folder)
    methods, trained = open_methods([model])
    groups = score_real(load_real(folder, rows), methods)
    angles = lamp_angles(load_lamps(folder, rows), methods)
    notes = [MAP_NOTE] if groups else []
    if angles:
        groups[GROUP] = lamp_group(angles)
        notes.append(LAMP_NOTE)
    content = {
        "command": f"anyprobe evaluate --real {folder.name} --model {Path(model).name}",
        "note": " ".join(notes),
        **trained,
        "groups": groups,
        **({"photos": angles} if angles else {}),
    }
    write_result(out / "real.json", content)
    for kind, one in groups.items():
        for row in one["rows"]:
            figures = ", ".join(f"{name} {value:.3f}" for name, value in row.items() if name != "design")
            typer.echo(f"{kind}, {one['pairs']} photos, {row['design']}: {figures}")
    typer.echo(out / "real.json")
