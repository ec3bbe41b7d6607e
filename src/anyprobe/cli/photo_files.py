"""Photos given to a command, the files and marks that belong to each, and the names of their results.

Marks are boxes and clicks, in a CSV file with a row for each photo.
"""

from __future__ import annotations

import csv
import re
import sys
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from os.path import commonprefix
from pathlib import Path
from typing import Any

from anyprobe.cli.options import OPTIONS
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import AnyprobeError, InputError, InvalidMask, InvalidPhoto, OutputError
from anyprobe.files.paths import composed, is_same_file, open_regular, read_regular, read_stream, visible_files
from anyprobe.inputs.hints import HINTS, PICTURES, Hints
from anyprobe.maps.image_io import open_image
from anyprobe.notices import Notice, as_notice
from anyprobe.session import Shot

STDIN = Path("-")
"""Path that stands for standard input."""

COLUMNS = ("photo", "box", "click", "exclude")
MAX_BYTES = 2**24
"""Longest file of marks."""

MOST_NAMED = 20
"""Most photos that are named: whose results are, or that a warning is about."""

Marks = Mapping[str, Mapping[str, Any]]
"""Hints by a photo's name without folders, composed."""


def photo_source(path: Path) -> Path | bytes:
    """Return a photo's path, or the bytes of standard input if the path is `-`."""
    if path != STDIN:
        return path
    if sys.stdin is None:  # closed, as a service's may be
        text = "expected a photo, got a closed standard input; give a file, or pipe a photo in"
        raise InvalidPhoto(text, source="stdin")
    return read_stream(sys.stdin.buffer, "stdin", InvalidPhoto)


def photo_name(path: Path) -> str:
    """Return a photo's name in messages."""
    return "stdin" if path == STDIN else path.name


def photo_line(photo: Path, error: AnyprobeError) -> str:
    """Return an error as one line that begins with the photo."""
    notice = error.notice
    if notice.source in (str(photo), photo_name(photo)):
        line = f"{notice.source}: {OPTIONS.line(notice.of(''))}"
    else:
        line = f"{photo}: {OPTIONS.line(notice)}"
    return " ".join(line.splitlines())  # a name may hold a line break


def joined(warnings: Iterable[str]) -> Iterator[Notice]:
    """Return one warning of each kind, about all photos that it concerns; words in which they differ are listed."""
    kinds: dict[Any, dict[Notice, dict[str, None]]] = {}
    for warning in map(as_notice, warnings):
        text = warning.of("")
        kind = (warning.code, warning.subject, warning.remedy) if warning.code not in ("", "doubt") else text
        kinds.setdefault(kind, {}).setdefault(text, {})[warning.source] = None
    for texts in kinds.values():
        (first, photos), *others = texts.items()
        if not others:
            yield first.of(_about(photos))
            continue
        words = [re.findall(r"[^\s;:]+|[\s;:]", one.text) for one in texts]
        head = commonprefix(words)
        tail = commonprefix([one[len(head) :][::-1] for one in words])[::-1]
        own = ["".join(one[len(head) : len(one) - len(tail)]) for one in words]
        listed = ", ".join(f"{one} ({_about(photos)})" for one, photos in zip(own, texts.values(), strict=True))
        yield Notice("".join([*head, listed, *tail]), code=first.code, subject=first.subject, remedy=first.remedy)


def _about(names: Collection[str]) -> str:
    return f"{len(names)} photos" if len(names) > MOST_NAMED else ", ".join(names)


def some(names: Sequence[str]) -> str:
    """Return up to MOST_NAMED names, and how many more there are."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def hints_for(photo: Path, hints: Hints, marks: Marks | None = None) -> Hints:
    """Return the hints of one photo: folders of masks, depth images, normals or panoramas become the file of its
    name; marks: of all photos, those of its name are added."""
    given = hints.files().items()
    files: dict[str, Any] = {name: _file_for(photo, path, name, HINTS[name].suffixes) for name, path in given}
    return replace(hints, **files, **(marks or {}).get(composed(photo.name), {}))


def shot_of(photo: Path, hints: Hints, marks: Marks | None = None) -> Shot:
    """Return a photo as it is given, with its own hints of a call's; standard input is read."""
    return Shot(source=photo_source(photo), name=photo_name(photo), hints=hints_for(photo, hints, marks))


def list_photos(photos: Iterable[Path]) -> list[Path]:
    """List photos: files as given, folders as the photos in them, in natural order.

    Left out of folders are hidden files, environment maps, and what anyprobe wrote: NAME_mask, NAME_overlay, NAME_relit
    and NAME_origin beside NAME, NAME.png beside a map of that name, and NAME.jpg.png, a mask of NAME.jpg.
    """
    chosen: list[Path] = []
    for path in photos:
        if not path.is_dir():
            chosen.append(path)
            continue
        found = visible_files(path, PICTURES)
        written = {f"{p.stem}_{kind}" for p in found for kind in ("mask", "overlay", "relit", "origin")}
        written |= {p.name for p in found}
        maps = {p for p in found if p.suffix.lower() == ".exr" and _is_map(p)}
        previews = {p.with_suffix(".png") for p in maps if p.with_suffix(".json").is_file()}
        if not (found := [p for p in found if p.stem not in written and p not in maps | previews]):
            raise InputError("no photos in this folder; check the path", source=path)
        chosen += found
    return list(dict.fromkeys(chosen))


def _is_map(path: Path) -> bool:
    """Return whether an .exr is twice as wide as high, as environment maps are, without decoding it."""
    with suppress(ValueError), open_regular(path, InputError) as stream, open_image(stream, "openexr") as image:
        return image.spec().full_width == 2 * image.spec().full_height
    return False  # what reads it says why


def result_stem(photo: Path, listed: list[Path]) -> str:
    """Return the stem of a photo's results; with its suffix (photo_heic) where another photo has the same stem."""
    if photo == STDIN:
        return photo_name(photo)
    alike = any(other.stem == photo.stem and other.suffix != photo.suffix for other in listed)
    return f"{photo.stem}_{photo.suffix[1:]}" if alike and photo.suffix else photo.stem


def check_distinct(listed: list[Path]) -> None:
    """Refuse photos whose results would have equal names."""
    first: dict[str, Path] = {}
    for photo in listed:
        other = first.setdefault(result_stem(photo, listed), photo)
        if other != photo:
            text = f"expected distinct result names, got {other} before it; rename one of them"
            raise OutputError(text, source=photo)


def check_names(photo: Path, listed: list[Path], targets: Iterable[Path], given: Iterable[Any]) -> None:
    """Refuse results that would replace a photo or another input."""
    inputs = [path for path in (*listed, *given) if isinstance(path, Path)]
    for target in targets:
        if replaced := next((path for path in inputs if is_same_file(path, target)), None):
            raise OutputError(f"the result would replace {replaced}; choose another folder with -o", source=photo)


def _file_for(photo: Path, source: Path, kind: str, suffixes: tuple[str, ...]) -> Path:
    """Return the file itself, or from a folder the one of the photo's stem: NAME.*, NAME_<kind>.*, or the photo's whole
    name and a suffix."""
    if not source.is_dir():
        return source
    for stem in (f"{photo.stem}_{kind}", photo.stem, photo.name):
        for candidate in visible_files(source, suffixes):
            if composed(candidate.stem) == composed(stem) and not is_same_file(candidate, photo):
                return candidate
    text = f"expected {photo.stem}.png or {photo.stem}_{kind}.png in {source}, got neither"
    raise InvalidMask(text, subject=kind, source=photo)


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
        if points := cells.get(name, "").replace(";", " ").split():
            given[name] = [HINTS[name].read(point) for point in points]
    return composed(Path(cells["photo"].replace("\\", "/")).name), given


def marks_of(path: Path | None, photos: list[Path]) -> Marks:
    """Read the marks of photos; none without a path.

    Raises:
        InputError: see read_marks; or a name that none of the photos has, as it may be mistyped.
    """
    if path is None:
        return {}
    marks, names = read_marks(path), [composed(photo.name) for photo in photos]
    for name in marks:
        if name not in names:
            raise InputError(f"expected names of the photos, got {name!r}{did_you_mean(name, names)}", source=path)
    return marks
