"""The page in the package is the one its sources make."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"
PAGE = ROOT / "src" / "anyprobe" / "serve" / "page"

CONTRACT = "../src/anyprobe/contract.json"
PARTS = ("api", "build", "index.html", "package-lock.json", "package.json", "page", "src", "vite.config.js")
MAX_BYTES = 10 * 2**20


def source_digest(web: Path) -> str:
    """As web/build/digest.js: SHA-256 over path, length and content of every source file in order."""
    files = [file for part in PARTS for file in ([web / part] if (web / part).is_file() else web.rglob("*"))]
    names = {p.relative_to(web).as_posix() for p in files if p.is_file()}
    found = hashlib.sha256()
    for name in sorted([CONTRACT, *(name for name in names if name.split("/")[0] in PARTS)]):
        content = (web / name).read_bytes()
        found.update(f"{name} {len(content)}\n".encode() + content)
    return found.hexdigest()


@pytest.fixture
def web(tmp_path) -> Path:
    """A small folder of sources."""
    web = tmp_path / "web"
    for part in (*PARTS, CONTRACT):
        path = web / part / "x.js" if "." not in part else web / part
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(part)
    (web / "node_modules").mkdir()
    (web / "node_modules" / "x.js").write_text("others'")
    return web


def test_built_page_is_of_these_sources():
    built = (PAGE / "source.txt").read_text().strip()
    assert built == source_digest(WEB), "the page is not what web/ makes: cd web && npm ci && npm run build"


def test_page_stays_small():
    assert sum(p.stat().st_size for p in PAGE.rglob("*") if p.is_file()) < MAX_BYTES


def test_page_asks_no_other_machine_for_anything():
    html = (PAGE / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)=["'](https?:)?//""", html)


def test_npm_package_is_of_the_same_release():
    package = json.loads((WEB / "package.json").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert [package["version"], package["license"]] == [project["version"], project["license"]]


def test_digest_sees_every_change_and_nothing_else(web):
    before = source_digest(web)
    (web / "node_modules" / "x.js").write_text("newer")
    assert source_digest(web) == before
    (web / "src" / "x.js").write_text("src!")
    changed = source_digest(web)
    assert changed != before
    (web / CONTRACT).write_text("{}")
    assert source_digest(web) not in (before, changed)
