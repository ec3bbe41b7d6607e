"""Python and JavaScript read the same numbers."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path

from anyprobe.core.contract import contract

CONTRACT = Path(str(resources.files("anyprobe") / "contract.json"))
MODULE = Path(__file__).parents[2] / "web" / "src" / "core" / "contract.js"


def test_javascript_imports_the_contract_that_python_reads():
    (imported,) = re.findall(r'^import contract from "(\S+)"', MODULE.read_text(encoding="utf-8"), re.MULTILINE)
    assert (MODULE.parent / imported).samefile(CONTRACT)
    assert contract("mask") == json.loads(CONTRACT.read_text(encoding="utf-8"))["mask"]
