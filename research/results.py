"""Result files: how they are written, and the commit they are of."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from anyprobe.files.atomic import atomic_path


def write_result(path: Path, content: dict[str, Any]) -> None:
    """JSON, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def commit() -> str:
    """Of the working tree, or "unknown" outside one."""
    asked = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=10"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
