"""Names of files in the order that people count in."""

from __future__ import annotations

import re


def natural_order(name: str) -> list[tuple[bool, int, str]]:
    """A key to sort names by: frame_2 stands before frame_10."""
    return [
        (part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in re.split(r"([0-9]+)", name)
    ]
