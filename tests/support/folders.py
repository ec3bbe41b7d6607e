"""What lies in a folder, to compare before and after."""

from __future__ import annotations

from pathlib import Path


def names(folder: str | Path) -> set[str]:
    """Paths of everything below, hidden files too; empty if there is no such folder."""
    folder = Path(folder)
    return {str(p.relative_to(folder)) for p in folder.rglob("*")} if folder.exists() else set()


def snapshot(folder: Path) -> dict[str, bytes]:
    """Every file below and its bytes."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
