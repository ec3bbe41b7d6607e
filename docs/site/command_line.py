"""MkDocs hook: the page reference/command-line.md, from the help of every command."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import Any

from mkdocs.structure.files import File, Files

PAGE = "reference/command-line.md"
PLACEHOLDER = re.compile(r"<(\w+)>")


def on_files(files: Files, config: Any) -> Files:
    """Add the page, which Typer writes from the application."""
    command = [sys.executable, "-m", "typer", "anyprobe.cli.app", "utils", "docs", "--name", "anyprobe"]
    written = subprocess.run([*command, "--title", "Command line"], check=True, capture_output=True, text=True)
    files.append(File.generated(config, PAGE, content=escaped(written.stdout)))
    return files


def escaped(page: str) -> str:
    """Return the page with <stem> and its like readable, which outside code would be HTML."""
    parts = re.split(r"(`[^`\n]+`)", page)
    return "".join(part if part.startswith("`") else PLACEHOLDER.sub(r"&lt;\1&gt;", part) for part in parts)
