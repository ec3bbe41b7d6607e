"""What rows call models, which are named or lie in folders."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from anyprobe.errors import InputError


def titles_of(names: Sequence[str]) -> list[str]:
    """The last part of each path; InputError where two would share a row."""
    titles = [Path(name).name for name in names]
    for title in titles:
        if titles.count(title) > 1:
            raise InputError(
                f"expected models of different names, got two of {title}; rename one's folder", subject="model"
            )
    return titles
