"""Python and JavaScript read the same numbers."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

from anyprobe.core.contract import contract

WEB = Path(__file__).parents[2] / "web" / "src" / "core" / "contract.js"


def test_javascript_has_the_contract_that_python_reads():
    text = WEB.read_text(encoding="utf-8")
    _, _, written = text.partition("export const CONTRACT = ")
    stored = json.loads((resources.files("anyprobe") / "contract.json").read_text(encoding="utf-8"))
    assert json.loads(written.rstrip().removesuffix(";")) == stored, "cd web && npm run contract"
    assert contract("mask") == stored["mask"]
