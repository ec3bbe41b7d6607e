"""manifest.csv beside a folder of assets: whose each file is, under which licence, in which split."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path

Row = dict[str, str]


def read_table(path: Path) -> tuple[list[str], list[Row]]:
    """Columns and rows of a manifest.csv, none if there is none; a short row's missing fields are empty.

    Raises:
        InputError: no table in UTF-8 with the column file.
    """
    if not path.is_file():
        return [], []
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:  # spreadsheets put a mark before
            reader = csv.DictReader(stream)
            rows = [{key: value or "" for key, value in row.items() if key} for row in reader]
            columns = [name for name in reader.fieldnames or [] if name]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path}: expected a table in UTF-8, got a damaged file ({error}); repair it"
        ) from error
    if "file" not in columns:
        raise InputError(f"{path}: expected a table with the column file; move it away")
    return columns, rows


class Manifest:
    """manifest.csv: one row a file, ours or another's, written whole at every change.

    Several processes may change one table at a time.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self.path, self._ours = path, list(columns)
        self._read()

    def _read(self) -> None:
        found, self.rows = read_table(self.path)
        self.columns = found + [name for name in self._ours if name not in found]

    def row(self, source: str) -> Row | None:
        """The row of an asset that was fetched from `source`."""
        return next((row for row in self.rows if row.get("source") == source), None)

    def has_other(self, source: str, slug: str) -> bool:
        """Whether a file of that name is listed that did not come from `source`."""
        return any(Path(row["file"]).stem == slug and row.get("source") != source for row in self.rows)

    def put(self, row: Row) -> None:
        """Add a row, or replace the one with the same source; rows that others added meanwhile stay. The folder is
        there."""
        with _alone_in(self.path.parent):
            self._read()
            old = self.row(row["source"])
            if old is None:
                self.rows.append(row)
            elif {**old, **row} == old:
                return
            else:
                self.rows[self.rows.index(old)] = {**old, **row}
            self._write()

    def _write(self) -> None:
        with atomic_path(self.path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, self.columns, restval="", extrasaction="ignore")
            writer.writeheader()
            writer.writerows(self.rows)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other process is inside such a block for the folder; the table itself is replaced by each."""
    try:
        import fcntl
    except ImportError:  # Windows: the user sees to it
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a shared file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
