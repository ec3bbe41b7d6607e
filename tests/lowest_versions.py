"""The lowest versions that pyproject.toml allows, as pip's constraints: python tests/lowest_versions.py EXTRA ..."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path


def lowest(extras: list[str]) -> list[str]:
    """NAME==VERSION of the direct dependencies of the package and of these extras."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *(one for name in extras for one in project["optional-dependencies"][name])]
    found = (re.fullmatch(r"([\w.-]+)>=([\w.]+)", one) for one in wanted)
    return [f"{one[1]}=={one[2]}" for one in found if one]


if __name__ == "__main__":
    print("\n".join(lowest(sys.argv[1:])))
