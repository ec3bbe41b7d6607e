"""Constants shared by Python and JavaScript: contract.json, which the page imports."""

import json
from functools import lru_cache
from importlib import resources
from typing import Any


@lru_cache
def contract(section: str) -> dict[str, Any]:
    """Return the section of contract.json of this name; read-only."""
    return json.loads((resources.files("anyprobe") / "contract.json").read_text(encoding="utf-8"))[section]
