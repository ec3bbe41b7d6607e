"""manifest.csv beside a folder of assets: whose each file is, under which licence, in which split."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path


class Manifest:
    """manifest.csv: one row a file, ours or another's, written whole at every change."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self.path = path
        self.columns, self.rows = list(columns), []
        if path.is_file():
            with path.open(newline="", encoding="utf-8") as stream:
                reader = csv.DictReader(stream)
                self.rows = list(reader)
                found = list(reader.fieldnames or [])
            if "file" not in found:
                raise InputError(f"{path}: expected a table with the column file; move it away")
            self.columns = found + [name for name in columns if name not in found]

    def row(self, source: str) -> dict[str, str] | None:
        """The row of an asset that was fetched from `source`."""
        return next((row for row in self.rows if row.get("source") == source), None)

    def has_other(self, source: str, slug: str) -> bool:
        """Whether a file of that name is listed that did not come from `source`."""
        return any(Path(row["file"] or "").stem == slug and row.get("source") != source for row in self.rows)

    def put(self, row: dict[str, str]) -> None:
        """Add a row, or replace the one with the same source."""
        old = self.row(row["source"])
        if old is None:
            self.rows.append(row)
        elif {**old, **row} == old:
            return
        else:
            self.rows[self.rows.index(old)] = {**old, **row}
        with atomic_path(self.path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, self.columns, restval="", extrasaction="ignore")
            writer.writeheader()
            writer.writerows(self.rows)
