"""MkDocs hook: the page reference/command-line.md, from the help of every command."""

from __future__ import annotations

import re
from typing import Any

from mkdocs.structure.files import File, Files

from anyprobe.cli.app import app

PAGE = "reference/command-line.md"
PLACEHOLDER = re.compile(r"<(\w+)>")
OPTION_LINK = re.compile(r"\(#anyprobe-(\w+-completion)\)")
"""A link to a command that is spelled as an option; its heading, and so its anchor, keeps the dashes."""


def on_files(files: Files, config: Any) -> Files:
    """Add the page, which cyclopts writes from the application."""
    page = app.generate_docs().replace("# anyprobe\n", "# Command line\n", 1)
    page = OPTION_LINK.sub(r"(#anyprobe---\1)", page)
    files.append(File.generated(config, PAGE, content=escaped(page)))
    return files


def escaped(page: str) -> str:
    """Return the page with <stem> and its like readable, which outside code would be HTML."""
    parts = re.split(r"(`[^`\n]+`)", page)
    return "".join(part if part.startswith("`") else PLACEHOLDER.sub(r"&lt;\1&gt;", part) for part in parts)
