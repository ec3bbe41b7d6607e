"""manifest.csv beside the files it lists."""

import csv
from collections.abc import Sequence
from pathlib import Path

from anyprobe.files.atomic import atomic_path
from anyprobe_train.dataset.catalog import Row, read_table


class Manifest:
    """manifest.csv: one row a file, ours or another's, written whole at every change."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self.path, self._ours = path, list(columns)
        self._read()

    def _read(self) -> None:
        found, self.rows = read_table(self.path)
        self.columns = found + [name for name in self._ours if name not in found]

    def row(self, source: str) -> Row | None:
        """Return the row of an asset that was fetched from `source`."""
        return next((row for row in self.rows if row.get("source") == source), None)

    def has_other(self, source: str, slug: str) -> bool:
        """Whether a file of that name is listed that did not come from `source`."""
        return any(Path(row["file"]).stem == slug and row.get("source") != source for row in self.rows)

    def put(self, row: Row) -> None:
        """Add a row, or replace the one with the same source; rows that others added since it was read stay."""
        self._read()
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
