"""Boxes and clicks for the photos of a folder: a CSV file with a row for each photo."""

from __future__ import annotations

import csv
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe.files.paths import read_regular
from anyprobe.inputs.hints import HINTS

COLUMNS = ("photo", "box", "click", "exclude")
MAX_BYTES = 2**24
"""Longest file of marks."""

Marks = Mapping[str, Mapping[str, Any]]
"""Hints by a photo's name without folders."""


def read_marks(path: Path) -> Marks:
    """Read a CSV file with the columns photo, and any of box, click and exclude.

    box holds X0,Y0,X1,Y1; click and exclude X,Y, several with ; between. Numbers with commas are quoted, or another
    delimiter, ; or a tab, is used, and spaces between clicks.

    Raises:
        InputError: no such file, another encoding, an unknown column, a photo named twice, or numbers that are none;
            names the row.
    """
    data = read_regular(path, str(path), InputError, "a CSV file", MAX_BYTES)
    try:
        text = data.decode("utf-16" if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("expected text in UTF-8, got other bytes; save it as CSV UTF-8", source=path) from error
    lines = text.splitlines(keepends=True)
    first = "".join(lines[:1]).strip('\r\n"')
    said = first.lower().startswith("sep=")
    delimiter = next((one for one in ("\t", ";") if one in first), ",")
    reader = csv.DictReader(lines[said:], delimiter=delimiter, skipinitialspace=True)
    names = [name.strip().lower() for name in reader.fieldnames or ()]
    unknown = [name for name in names if name and name not in COLUMNS]
    if unknown or "photo" not in names:
        got = f"{unknown[0]!r}{did_you_mean(unknown[0], COLUMNS)}" if unknown else "no column photo"
        raise InputError(f"expected the columns {', '.join(COLUMNS)}, got {got}", source=path)
    reader.fieldnames = names
    marks: dict[str, dict[str, Any]] = {}
    for number, row in enumerate(reader, start=2 + said):
        if not any(row.values()):
            continue  # spreadsheets write rows of delimiters alone
        try:
            name, given = _read_row(row)
        except InputError as error:
            raise InputError(error, source=f"{path}, row {number}") from error
        if name in marks:
            raise InputError(f"expected each photo once, got {name} again", source=f"{path}, row {number}")
        marks[name] = given
    return marks


def _read_row(row: Mapping[str | None, Any]) -> tuple[str, dict[str, Any]]:
    if None in row:
        raise InputError('expected a cell for each column, got more; quote the numbers: "40,30,220,260"')
    cells = {str(name): (text or "").strip() for name, text in row.items()}
    given: dict[str, Any] = {"box": HINTS["box"].read(cells["box"])} if cells.get("box") else {}
    for name in ("click", "exclude"):
        points = cells.get(name, "").replace(";", " ").split()
        if points:
            given[name] = [HINTS[name].read(point) for point in points]
    return Path(cells["photo"].replace("\\", "/")).name, given


def marks_of(path: Path | None, photos: list[Path]) -> Marks:
    """Read the marks of photos; none without a path.

    Raises:
        InputError: see read_marks; or a name that none of the photos has, as it may be mistyped.
    """
    if path is None:
        return {}
    marks, names = read_marks(path), [photo.name for photo in photos]
    for name in marks:
        if name not in names:
            raise InputError(f"expected names of the photos, got {name!r}{did_you_mean(name, names)}", source=path)
    return marks
