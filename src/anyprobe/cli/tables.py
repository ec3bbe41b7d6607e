"""Tables in a terminal or a pipe, whose cells are never broken or cut."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

WIDEST = 10_000
"""Longest line of a table [characters]."""


def print_table(console: Console, table: Table) -> None:
    """Print a table as wide as its cells; only the terminal itself breaks a line that is too long."""
    room = console.options.update(max_width=WIDEST)
    table.width = console.measure(table, options=room).maximum
    console.print(table, soft_wrap=True)
