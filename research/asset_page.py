"""python -m research.asset_page DATA [--test]: maps and shapes that shipped weights learn from, or that the frozen test
set is rendered from, with source, licence and author, in Markdown."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.dataset.catalog import MAP_SUFFIXES, MESH_SUFFIXES, allows_commercial_use, file_id, listed_rows
from anyprobe_train.dataset.recipe import read_recipes
from anyprobe_train.evaluate.scoring import FROZEN

FOLDERS = {
    "hdri/train": ("Maps", MAP_SUFFIXES),
    "hdri/train_extra": ("Maps", MAP_SUFFIXES),
    "meshes/train": ("Shapes", MESH_SUFFIXES),
}
"""Those of load_asset_store, what they hold, and in which files."""

TEST_FOLDERS = {"hdri/test": ("Maps", MAP_SUFFIXES), "meshes/test": ("Shapes", MESH_SUFFIXES)}

NOT_STATED = "not stated"

PAGE = """\
# Assets that weights learned from

The {count} files that training uses, as the manifests of their folder state them: author; source: files. Written by
`python -m research.asset_page`, which leaves out files whose licence forbids commercial use or is not clear
(`anyprobe_train.dataset.catalog.allows_commercial_use`). None of them is in the package: networks were trained on
images rendered with them. [CC BY 3.0](https://creativecommons.org/licenses/by/3.0/) and
[4.0](https://creativecommons.org/licenses/by/4.0/) require naming the author, as MIT, BSD and Apache licences do.

Training also uses anyprobe's own procedural maps and shapes, which have no files (`sky`, `room` and `random_shapes` of
`anyprobe_train.dataset`); Apache-2.0.
"""

TEST_PAGE = """\
# Test assets

The {count} files that the frozen test set is rendered from: author; file: source, SHA-256. Written by
`python -m research.asset_page DATA --test`. Recipes (`train/anyprobe_train/evaluate/frozen.txt`,
`research/world/test.txt`) name files by the first eight digits of their SHA-256, so `--frozen` needs these very files.
They are not in the repository, and no network is trained on them.

`anyprobe-train data test DIR` fetches all maps, and the shapes drill and goathead, at fixed commits of their sources,
prepares them and checks SHA-256. It writes `DIR/frozen_public.txt`, the 224 of the 1,000 frozen recipes for which these
suffice ([evaluation](evaluation.md)). How the other seven shapes were decimated was not recorded, so they cannot be
had. Preparation:

- **Maps**: read as linear floats; NaN, infinite and negative values set to 0; averaged to 512 x 256 pixels; halved
  until nothing is above 65,504; OpenEXR with half floats and PIZ compression.
- **Shapes**: vertices merged, small loose parts removed, holes closed, decimated to 16,000 triangles at most, +Y up,
  smallest enclosing sphere of radius 1 around the origin; binary PLY.

"By name": the file has the name of an asset of Poly Haven, where all assets are CC0; this was not checked against the
site. "Not stated": the source names no licence; use for research only.
"""

_NAMES_NOBODY = re.compile(r"cc[\s_-]?0\b|creative commons zero\b|public domain\b|own\b", re.IGNORECASE)


def asset_page(data: Path, report: Callable[[str], None] | None = None) -> str:
    """The page, in Markdown, of all that load_asset_store takes of a data folder for weights that ship.

    Args:
        report: as of load_asset_store.
    Raises:
        InputError: as load_asset_store.
    """
    store = load_asset_store(data, "train", commercial_only=True, report=report)
    taken = {*store.maps, *store.shapes}
    credits = {name: list(_credits(data / name, suffixes, taken)) for name, (_, suffixes) in FOLDERS.items()}
    parts = [PAGE.format(count=sum(map(len, credits.values())))]
    parts += [section(FOLDERS[name][0], name, rows) for name, rows in credits.items() if rows]
    return "\n".join(parts)


def frozen_page(data: Path) -> str:
    """The page, in Markdown, of the files that the frozen test set is rendered from.

    Raises:
        InputError: a folder, or a file that a recipe names, is missing.
    """
    wanted = {key for recipe in read_recipes(FROZEN) for key in (recipe.map_id, recipe.shape_id)}
    parts, found = [], set()
    for name, (kind, suffixes) in TEST_FOLDERS.items():
        rows = []
        for path, row in listed_rows(data / name, suffixes):
            if path.is_file() and file_id(path) in wanted:
                found.add(file_id(path))
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
                rows.append((row["licence"], path.name, f"{_source(row)}, `{digest}`"))
        parts.append(section(kind, name, rows))
    if wanted != found:
        raise InputError(
            f"expected all files of the frozen test set, {len(wanted - found)} of {len(wanted)} are missing; "
            "give the folder with hdri/test and meshes/test",
            source=data,
        )
    return "\n".join([TEST_PAGE.format(count=len(found)), *parts])


def section(kind: str, folder: str, credits: list[tuple[str, str, str]]) -> str:
    """The files of a folder as lists in Markdown, one for each licence, with its authors.

    Args:
        credits: licence and author; what a line begins with, and what is listed in it.
    """
    lines: dict[str, dict[str, dict[str, list[str]]]] = {}
    for stated, first, listed in credits:
        licence, author = split_licence(stated)
        lines.setdefault(licence, {}).setdefault(author, {}).setdefault(first, []).append(listed)
    parts = [f"## {kind} of `{folder}`: {len(credits)}\n"]
    for licence, of in lines.items():
        parts.append(f"\n### {licence}\n\n")
        for author, sources in of.items():
            own = len(sources) == 1 or not author
            parts += [] if own else [f"- {author}\n"]
            mark = (f"- {author}; " if author else "- ") if own else "    - "
            parts += [f"{mark}{first}: {', '.join(listed)}\n" for first, listed in sources.items()]
    return "".join(parts)


def split_licence(stated: str) -> tuple[str, str]:
    """A licence's name, and its author: what follows a semicolon, or stands in brackets at the end; else empty."""
    text = " ".join(stated.split())
    found = re.fullmatch(r"([^;(]+(?:\([^)]*\))?); (.+)|([^;(]+) \(([^)]+)\)", text)
    return (found[1] or found[3], found[2] or found[4]) if found else (text, "")


def _credits(folder: Path, suffixes: tuple[str, ...], taken: set[str]) -> Iterator[tuple[str, str, str]]:
    """Licence and author, source, and file of the files of a folder whose ids are among those taken, by name."""
    for path, row in listed_rows(folder, suffixes) if folder.is_dir() else ():
        if allows_commercial_use(row["licence"]) and path.is_file() and file_id(path) in taken:
            name = row.get("name") or row.get("slug") or path.stem
            author = _author(row)
            licence = row["licence"] if author in row["licence"] else f"{row['licence']}; {author}"
            source = row.get("source_repo") or _source(row)
            yield licence, source, path.name if name == path.stem else f"{path.name} ({name})"


def _source(row: dict[str, str]) -> str:
    """Repository and path, else an address."""
    stated = ": ".join(row[key] for key in ("source_repo", "source_path") if row.get(key))
    return stated or row.get("source") or row.get("url") or NOT_STATED


def _author(row: dict[str, str]) -> str:
    """As the licence asks to be named, else empty.

    Of a column of its own, else what follows the licence's name, as in "CC BY 4.0; Jane Doe".
    """
    if _NAMES_NOBODY.match(row["licence"].strip()):
        return ""
    _, *rest = re.split(r"[;(]", row["licence"], maxsplit=1)
    return row.get("authors") or row.get("author") or "".join(rest).strip(" )") or NOT_STATED


def main(
    data: Annotated[Path, Parameter(name="DATA", help="Folder with hdri/ and meshes/.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="The page to write; else it is printed.")] = None,
    test: Annotated[bool, Parameter(name="--test", help="Assets of the frozen test set, with their SHA-256.")] = False,
) -> None:
    """Print or write the page."""
    if test:
        text = frozen_page(data)
    else:
        text = asset_page(data, report=lambda line: print(f"warning: {line}", file=sys.stderr))
    if out is None:
        print(text, end="")
        return
    with atomic_path(out) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    print(out)


if __name__ == "__main__":
    run_command(main)
