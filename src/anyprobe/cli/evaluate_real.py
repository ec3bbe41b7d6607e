"""anyprobe evaluate --real: models, trained designs and baselines on real photos with measured maps or known lamps."""

from __future__ import annotations

from pathlib import Path

import typer

from anyprobe.cli.results import commit, open_designs, open_methods, tail, write_result

MAP_NOTE = (
    "Real photos; LDR maps and mirror balls (ball_...) against the measured map at the photo's exposure, "
    "main_light_deg the angle between main lights."
)
LAMP_NOTE = (
    "Photos of which only the lamp's direction is known: the angle between the estimate's main light and the "
    "lamp in degrees, mean and median over photos; towards the camera: of who always says so."
)
IDEAL = "ideal"
"""Is given true irradiance, which no real photo has."""


def evaluate_real(folder: Path, models: list[str], run: Path | None, out: Path) -> None:
    """Score the folder's photos (docs/evaluation.md says how it looks) into real.json, and draw real.jpg."""
    from anyprobe.evaluate.figures import RealBalls
    from anyprobe.evaluate.lamps import GROUP, lamp_angles, lamp_group, load_lamps
    from anyprobe.evaluate.real import load_real, read_real, score_real

    rows = read_real(folder)
    methods, trained = open_methods(models, None if run is None else open_designs(run))
    methods.pop(IDEAL, None)
    drawn = RealBalls()
    groups = score_real(load_real(folder, rows), methods, drawn.add)
    angles = lamp_angles(load_lamps(folder, rows), methods)
    notes = [MAP_NOTE] if groups else []
    if angles:
        groups[GROUP] = lamp_group(angles)
        notes.append(LAMP_NOTE)
    command = [
        "anyprobe evaluate",
        f"--real {folder.name}",
        *(f"--model {Path(name).name}" for name in models),
    ]
    content = {
        "command": " ".join([*command, *([f"--run {tail(run)}"] if run is not None else [])]),
        "commit": commit(),
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
    for path in (out / "real.json", *drawn.save(out)):
        typer.echo(path)
