"""Documents point at what is there: links at files, the Python reference at names, and it has every public one."""

from __future__ import annotations

import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import anyprobe

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"\]\(([^)#\s:]+)(?:#[^)\s]*)?\)")
DEFINED = (
    r"(?:def|class|function|const) {0}\b|^(?:\w+, )*{0}\b(?:, \w+)*(?:: [^=]+)? =|^ +{0}: |"
    r"^ *(?:async )?{0}\(.*\{{$"
)
"""Pattern of a definition, or of a field, in Python and JavaScript."""
REFERENCE = ROOT / "docs" / "reference" / "python.md"


def dead_links(page: Path) -> list[str]:
    """Return the relative links of a page whose files are not there."""
    return [link for link in LINK.findall(page.read_text(encoding="utf-8")) if not (page.parent / link).exists()]


def documented() -> list[str]:
    """Return the names that the Python reference is made of."""
    return re.findall(r"^::: (\S+)$", REFERENCE.read_text(encoding="utf-8"), re.MULTILINE)


def test_links_of_every_page_lead_somewhere():
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    pages = [ROOT / name for name in listed.stdout.split() if (ROOT / name).is_file()]
    generated = {"command-line.md", "http.md"}  # by docs/site
    found = {str(page.relative_to(ROOT)): dead_links(page) for page in pages}
    dead = {name: [one for one in links if Path(one).name not in generated] for name, links in found.items()}
    assert {name: links for name, links in dead.items() if links} == {}
    assert len(pages) > 30


def test_reference_has_every_public_name_and_no_other():
    shown = [pkgutil.resolve_name(":".join(name.rsplit(".", 1))) for name in documented()]
    assert [name for name in anyprobe.__all__ if getattr(anyprobe, name) not in shown] == []


def test_pages_of_the_site_are_listed():
    """Each page of docs/ is in the navigation of mkdocs.yml, which lists none that is not there."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = set(re.findall(r": ((?:[\w-]+/)*[\w-]+\.(?:md|ipynb))$", text, re.MULTILINE))
    docs = ROOT / "docs"
    there = {str(page.relative_to(docs)) for page in docs.rglob("*") if page.suffix in {".md", ".ipynb"}}
    own = {name for name in listed if not name.startswith("project/")}
    assert there == own - {"reference/command-line.md", "reference/http.md"}
    for name in listed - own:
        assert (ROOT / name.removeprefix("project/")).is_file(), name


def named_places(text: str) -> list[tuple[Path, str]]:
    """Files that rows of tables name, each with the name that follows it, empty where none does.

    A file may be named within the package, or within the folder of the one before it in the row.
    """
    found = []
    for row in re.findall(r"^\|.*\|$", text, re.MULTILINE):
        folder = ROOT / "src" / "anyprobe" / (re.findall(r"`(\w+)`", row) or ["none"])[0]
        for name, symbol in re.findall(r"`([\w/.-]+\.(?:py|js|json|txt))`(?:: `([\w.]+)`)?", row):
            places = [ROOT / "src" / "anyprobe" / name, ROOT / "train" / name, ROOT / name, folder / name]
            path = next((place for place in places if place.is_file()), places[2])
            folder = path.parent
            found.append((path, symbol.rpartition(".")[2]))
    return found


def missing_places(text: str) -> list[str]:
    """Those files that are absent, or that do not define the name."""
    return [
        f"{path.relative_to(ROOT)} {symbol}"
        for path, symbol in named_places(text)
        if not path.is_file()
        or symbol
        and not re.search(DEFINED.format(symbol), path.read_text(encoding="utf-8"), re.M)
    ]


def test_the_map_for_contributors_names_what_is_there():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert len(named_places(page)) > 30
    assert missing_places(page) == []


def test_every_listed_benchmark_starts():
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    names = re.findall(r"^\| `(\w+\.py)", page, re.M)
    assert "render.py" in names
    for name in names:
        script = [sys.executable, str(ROOT / "benchmarks" / name), "--help"]
        done = subprocess.run(script, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=False)
        needs_an_extra = "No module named 'mitsuba'" in done.stderr or "No module named 'torch'" in done.stderr
        assert needs_an_extra or done.stdout.startswith("usage: "), done.stderr
