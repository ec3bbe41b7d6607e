"""Codes of notices are documented, in Python and JavaScript."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WRITTEN = {
    "src/anyprobe": ("*.py", re.compile(r"""(?:\bcode|default_code(?:: ClassVar\[str\])?) ?= ?"([a-z-]+)\"""")),
    "web/src": ("*.js", re.compile(r"""(?:AnyProbeError|\bnotice)\(\s*"([a-z-]+)\"""")),
}


def codes(folder: str) -> set[str]:
    """Codes that a folder's files write out."""
    pattern, written = WRITTEN[folder]
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / folder).rglob(pattern))
    return {code for text in texts for code in written.findall(text)}


@pytest.mark.parametrize("folder", WRITTEN)
def test_every_code_is_documented(folder):
    found = codes(folder)
    assert len(found) > 8
    page = (ROOT / "docs" / "reference" / "errors.md").read_text(encoding="utf-8")
    assert {code for code in found if f"`{code}`" not in page} == set()
