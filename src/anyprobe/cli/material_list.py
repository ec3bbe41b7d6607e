"""anyprobe materials: the names that --material takes, of scatter.materials.MATERIALS."""

from __future__ import annotations

import json
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from anyprobe.cli.app import print_table
from anyprobe.cli.options import JsonOption


def materials(*words: Annotated[str, Parameter(name="WORD")], as_json: JsonOption = False) -> None:
    """List the materials that --material takes.

    With linear colour (a metal's reflectance, else the albedo), glTF roughness and reflectance at normal incidence.

    Args:
        words: Only names that contain these words.
    """
    from anyprobe.scatter.materials import MATERIALS, PRESETS

    chosen = {name: material for name, material in MATERIALS.items() if all(word.lower() in name for word in words)}
    rows: dict[str, dict[str, Any]] = {}
    for name, material in chosen.items():
        metal = not np.any(material.albedo)
        rows[name] = {
            "metal": metal,
            "color": [round(float(v), 3) for v in (material.f0 if metal else material.albedo)],
            "roughness": round(float(np.sqrt(material.alpha)), 2),
            "reflectance": round(float(np.mean(material.f0)), 3),
            "source": "anyprobe" if name in PRESETS else "physicallybased.info (CC0)",
        }
    if as_json:
        print(json.dumps(rows))
        return
    table = Table("material", "metal", "colour", "roughness", "reflectance", box=None, pad_edge=False)
    for name, row in rows.items():
        color = " ".join(f"{v:.3f}" for v in row["color"])
        kind = "yes" if row["metal"] else ""
        table.add_row(name, kind, color, f"{row['roughness']:.2f}", f"{row['reflectance']:.3f}")
    print_table(Console(markup=False, highlight=False), table)
