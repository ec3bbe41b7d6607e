"""How results are printed: JSON lines, or tables."""

from __future__ import annotations

import json
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

COLUMNS = ("light", "kind", "alpha", "samples", "error", "ms", "spp", "error", "ms", "faster", "than its default")
WIDTH = 124
"""Columns at least, also where the output is a file."""


class Report:
    """Prints lines as they come: data on stdout, progress on stderr."""

    def __init__(self, as_json: bool) -> None:
        self._json = as_json
        self._talk = Console(stderr=True, highlight=False)
        self._console = Console(highlight=False, width=max(WIDTH, self._talk.width))
        self._cells: list[dict[str, Any]] = []
        self._others: list[dict[str, Any]] = []

    def note(self, line: dict[str, Any]) -> None:
        """Something to know beforehand."""
        if self._json:
            print(json.dumps(line), flush=True)
        else:
            self._talk.print(", ".join(f"{key}: {value}" for key, value in line.items()))

    def add(self, line: dict[str, Any]) -> None:
        """A result."""
        if self._json:
            print(json.dumps(line), flush=True)
            return
        (self._cells if line["part"] == "equal-error" else self._others).append(line)
        self._talk.print(", ".join(str(value) for value in list(line.values())[:5]))

    def finish(self, summary: dict[str, Any]) -> None:
        """The summary, after the tables if there are any."""
        if self._json:
            print(json.dumps(summary), flush=True)
            return
        if self._cells:
            self._console.print(self._table())
        for line in [*self._others, summary]:
            table = Table(title=line["part"], show_header=False)
            for key, value in line.items():
                if key != "part":
                    table.add_row(key.replace("_", " "), "not measured" if value is None else str(value))
            self._console.print(table)

    def _table(self) -> Table:
        first = self._cells[0]
        title = f"a sphere of {first['pixels']} pixels to a relative RMSE of {100 * first['target']:g} %"
        table = Table(title=f"{title}: ours, then Mitsuba's fastest", box=SIMPLE)
        for column in COLUMNS:
            table.add_column(column, justify="left" if column in COLUMNS[:2] else "right", no_wrap=True)
        for line in self._cells:
            table.add_row(
                line["place"],
                line["kind"],
                f"{line['alpha']:g}",
                _way(line),
                f"{100 * line['ours_error']:.2f} %",
                f"{1e3 * line['ours_s']:.1f}",
                str(line["mitsuba_spp"]),
                f"{100 * line['mitsuba_error']:.2f} %",
                f"{1e3 * line['mitsuba_s']:.0f}" + ("*" if line["mitsuba_extrapolated"] else ""),
                f"{line['speedup']:.1f} x" if line["speedup"] else "failed",
                f"{line['speedup_over_independent']:.1f} x" if line["speedup"] else "failed",
            )
        maps = {f"{line['place']}: {line['map']}": None for line in self._cells}
        table.caption = "; ".join([*maps, "*: in proportion to the samples, beyond what was timed"])
        return table


def _way(line: dict[str, Any]) -> str:
    """Samples, and the side of the maps that they are taken for."""
    samples = str(line["ours_samples"])
    if line["ours_diffuse_samples"]:
        samples += f" + {line['ours_diffuse_samples']}"
    return f"{samples} a normal, {line['ours_map_size']}^2" if line["ours_map_size"] else f"{samples} a point"
