"""Result files: what is scored for them, what they say of how they came about, and how they are written."""

from __future__ import annotations

import csv
import json
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

from anyprobe.cli.need import need_torch
from anyprobe.errors import InputError

if TYPE_CHECKING:
    from anyprobe.train.design_methods import DesignMethods

RESULTS = Path("docs/results")


def open_designs(run: Path, laboratory: bool = False, hdr_run: Path | None = None) -> DesignMethods:
    """The trained designs of a run's folder; InputError if their pairs were not of the kind that they are scored on.

    hdr_run: of hdr_curves, whose network takes the place of the designs' own; None: theirs.
    """
    need_torch("running the trained designs")
    from anyprobe.train.design_methods import DesignMethods

    designs = DesignMethods(run / "checkpoint.pt", None if hdr_run is None else hdr_run / "checkpoint.pt")
    if designs.run["laboratory"] and not laboratory:
        raise InputError(f"--run {run}: expected --laboratory, where it has learned, got none; add it")
    if laboratory and not designs.run["laboratory"]:
        raise InputError(
            f"--laboratory: expected a run of designs_laboratory, got {run}, which has not learned there; leave it out"
        )
    return designs


def open_methods(
    models: list[str], designs: DesignMethods | None = None, told: bool = False
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Methods by name, baselines first, and what the result files say of their training; told: see shipped."""
    from anyprobe.evaluate.methods import baselines, shipped

    methods, trained = baselines(), {}
    if designs is not None:
        trained = {"designs": designs.run}
        methods |= designs.methods()
    for name in models:
        made, trained[Path(name).name] = shipped(name, told)
        methods |= made
    return methods, trained


def curves(log: Path) -> dict[str, Any]:
    """The columns of a run's log: Fig. 6 and the learning curves."""
    if not log.is_file():
        raise InputError(f"{log}: expected the run's log, found none; keep it beside the checkpoint")
    with log.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    if not rows:
        raise InputError(f"{log}: expected rows of a run's log, got none; keep that of its training")
    names = [name for name in rows[0] if name not in ("step", "learning_rate", "pairs_per_second")]
    return {"columns": {name: [round(float(row[name]), 6) for row in rows] for name in names}}


def write_result(path: Path, content: dict[str, Any]) -> None:
    """JSON, whole or not at all."""
    from anyprobe.files.atomic import atomic_path

    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def tail(path: Path) -> str:
    """The end of a path, as far as it says what is there and not where."""
    return Path(*path.resolve().parts[-2:]).as_posix()


def commit() -> str:
    """Of the working tree, or "unknown" outside one."""
    asked = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=10"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
