"""Figures with their standard errors, printed as a table."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rich.console import Console
from rich.table import Table

from anyprobe.cli.app import print_table


def print_figures(
    title: str, rows: Mapping[str, Mapping[str, float | None]], headings: Mapping[str, str], *, down: bool = False
) -> None:
    """Print the figures of headings {key: words} by row, each with its standard error KEY_error where it has one.

    down: one figure a line, the rows side by side.
    """
    cells = {
        name: {key: _cell(row.get(key), row.get(f"{key}_error")) for key in headings} for name, row in rows.items()
    }
    table = Table("", *(rows if down else headings.values()), title=title, title_justify="left")
    if down:
        for key, words in headings.items():
            table.add_row(words, *(row[key] for row in cells.values()))
    else:
        for name, row in cells.items():
            table.add_row(name, *row.values())
    print_table(Console(highlight=False), table)


def _cell(value: float | None, error: float | None) -> str:
    if value is None or np.isnan(value):
        return ""
    return f"{value:.3g}" + ("" if error is None or np.isnan(error) else f" +- {error:.2g}")
