"""Credits (noun): which files training takes, where they came from and whose they are, as their manifests say."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from anyprobe.dataset.catalog import MAP_SUFFIXES, MESH_SUFFIXES, allows_commercial_use, file_id, listed_rows
from anyprobe.dataset.stock import load_stock

FOLDERS = {
    "hdri/train": ("Maps", MAP_SUFFIXES),
    "hdri/train_extra": ("Maps", MAP_SUFFIXES),
    "meshes/train": ("Shapes", MESH_SUFFIXES),
}
"""Those of load_stock, what they hold, and in which files."""

NOT_STATED = "not stated"

PAGE = """\
# Assets that weights learned from

The {count} files of a data folder that training takes, as the folder's manifests state them; written by
`anyprobe data assets`. A file whose licence forbids commercial use, or is not clear, is not taken
(`anyprobe.dataset.catalog.allows_commercial_use`). None of these files is in the package: networks learned from
pictures made of them, with maps turned, blended and relit, and shapes turned, mirrored, drawn out, bent and joined.
[CC BY 3.0](https://creativecommons.org/licenses/by/3.0/) and
[4.0](https://creativecommons.org/licenses/by/4.0/) ask to name the author, as MIT, BSD and Apache licences do.

Beside these, training draws maps and shapes of anyprobe's own from seeds (`anyprobe.dataset.procedural_light`,
`anyprobe.render.shapes`, `anyprobe.render.parts`): they have no files, and are anyprobe's, Apache-2.0.
"""

_NAMES_NOBODY = re.compile(r"cc[\s_-]?0\b|creative commons zero\b|public domain\b|own\b", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True, slots=True)
class Credit:
    """One file; author: whom its licence asks to name, empty where it asks for nobody."""

    file: str
    name: str
    source: str
    licence: str
    author: str


def asset_page(data: Path, report: Callable[[str], None] | None = None) -> str:
    """The page, in Markdown, of all that load_stock takes of a data folder for weights that ship.

    Args:
        report: as of load_stock.
    Raises:
        InputError: as load_stock.
    """
    stock = load_stock(data, "train", commercial_only=True, report=report)
    taken = {*stock.maps, *stock.shapes}
    tables = {name: list(_credits(data / name, suffixes, taken)) for name, (_, suffixes) in FOLDERS.items()}
    parts = [PAGE.format(count=sum(map(len, tables.values())))]
    for name, credits in tables.items():
        if credits:
            parts.append(f"## {FOLDERS[name][0]} of `{name}`: {len(credits)}\n\n{_table(credits)}")
    return "\n".join(parts)


def _credits(folder: Path, suffixes: tuple[str, ...], taken: set[str]) -> Iterator[Credit]:
    """Of the files of a folder whose ids are among those taken, by name."""
    for path, row in listed_rows(folder, suffixes, ()) if folder.is_dir() else ():
        if allows_commercial_use(row["licence"]) and path.is_file() and file_id(path) in taken:
            yield Credit(
                file=path.name,
                name=row.get("name") or row.get("slug") or path.stem,
                source=_source(row),
                licence=row["licence"],
                author=_author(row),
            )


def _source(row: dict[str, str]) -> str:
    """Repository and path, else an address."""
    stated = ": ".join(row[key] for key in ("source_repo", "source_path") if row.get(key))
    return stated or row.get("source") or row.get("url") or NOT_STATED


def _author(row: dict[str, str]) -> str:
    """Of a column of its own, else what follows the licence's name, as in "CC BY 4.0; Jane Doe"."""
    if _NAMES_NOBODY.match(row["licence"].strip()):
        return ""
    _, *rest = re.split(r"[;(]", row["licence"], maxsplit=1)
    return row.get("authors") or row.get("author") or "".join(rest).strip(" )") or NOT_STATED


def _table(credits: list[Credit]) -> str:
    names = [field.name for field in fields(Credit)]
    lines = [names, ["---"] * len(names), *map(astuple, credits)]
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in lines)


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())
