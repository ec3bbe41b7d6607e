"""MkDocs hook: pages and pictures of the clone outside docs/ join the site under project/.

A page links to files as they lie in the clone. Links to Markdown files and pictures are followed, links to other files
(a Dockerfile, a script) become plain text. A link to a file that does not exist stays, so that a strict build fails.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(!?)\[([^\]\n]*(?:\n[^\]\n]+)*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")
PICTURES = {".png", ".jpg", ".jpeg", ".webp", ".gif", ".svg"}


def on_files(files: Files, config: Any) -> Files:
    """Add every page and picture outside docs/ that a page of the site links to."""
    known = {Path(file.abs_src_path) for file in files if file.abs_src_path}
    pages = [page for page in known if page.suffix == ".md"]
    while pages:
        page = pages.pop()
        for match in LINK.finditer(page.read_text(encoding="utf-8")):
            target = resolved(page, match[3])
            if target in known or not target.is_file() or target.suffix not in {".md", *PICTURES}:
                continue
            known.add(target)
            path = f"project/{target.relative_to(ROOT).as_posix()}"
            files.append(File.generated(config, path, abs_src_path=str(target)))
            pages += [target] if target.suffix == ".md" else []
    return files


def on_page_markdown(markdown: str, page: Page, config: Any, files: Files) -> str:
    """Point a page's links to where their files are on the site."""
    if page.file.abs_src_path is None:
        return markdown
    places = {Path(file.abs_src_path): file.src_uri for file in files if file.abs_src_path}
    source = Path(page.file.abs_src_path)

    def replaced(match: re.Match[str]) -> str:
        mark, text, path, anchor = match.groups(default="")
        target = resolved(source, path)
        if target in places:
            path = os.path.relpath(places[target], os.path.dirname(page.file.src_uri))
            return f"{mark}[{text}]({path}{anchor})"
        return text if target.exists() else match[0]

    return LINK.sub(replaced, markdown)


def resolved(page: Path, link: str) -> Path:
    """Return the file that a page's relative link means."""
    return Path(os.path.normpath(page.parent / link))
