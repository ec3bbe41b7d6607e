"""Help texts of commands."""

from __future__ import annotations


def as_written(text: str | None) -> str:
    """Return a module's docstring with the lines of its list of commands kept apart, which Click else fills up."""
    return (text or "").replace("\n\npython -m", "\n\n\b\npython -m")
