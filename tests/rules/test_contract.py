"""Python and JavaScript read the same numbers."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path

from anyprobe.core.contract import contract

ROOT = Path(__file__).parents[2]
CONTRACT = ROOT / "src" / "anyprobe" / "contract.json"
MODULE = ROOT / "web" / "src" / "core" / "contract.js"


def test_javascript_imports_the_contract_that_python_reads():
    (imported,) = re.findall(r'^import contract from "(\S+)"', MODULE.read_text(encoding="utf-8"), re.MULTILINE)
    assert (MODULE.parent / imported).samefile(CONTRACT)
    installed = resources.files("anyprobe").joinpath("contract.json").read_bytes()
    assert installed == CONTRACT.read_bytes(), "the installed package is not this checkout's: pip install -e ."
    assert contract("mask") == json.loads(CONTRACT.read_text(encoding="utf-8"))["mask"]
