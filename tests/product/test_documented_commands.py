"""Commands that the documentation shows exist with all their options, and help says in short what each does."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from support.command_faults import PROGRAMS, fault_of

from anyprobe.cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHORT = 55
"""Characters of a command's line in the list of commands."""


def commands_in(page: str) -> list[list[str]]:
    """The words of every anyprobe command in the fenced blocks of a page, without comments and pipes."""
    found = []
    for language, block in FENCED.findall(page):
        for line in block.replace("\\\n", " ").splitlines() if language != "python" else ():
            if not re.search(r"\banyprobe\b", line):
                continue
            lexer = shlex.shlex(line.removeprefix("$ "), posix=True, punctuation_chars=True)
            lexer.wordchars += ",:%+@^-"
            command: list[str] = []
            for word in [*lexer, ";"]:
                if set(word) <= set("();<>|&"):
                    found += [command] if command and command[0] in PROGRAMS else []
                    command = []
                else:
                    command.append(word)
    return found


def test_what_pages_show_is_a_command():
    shown = {page.name: commands_in(page.read_text(encoding="utf-8")) for page in PAGES}
    wrong = [(name, " ".join(words), fault_of(words)) for name, found in shown.items() for words in found]
    assert [one for one in wrong if one[2]] == []
    assert sum(map(len, shown.values())) > 40
    assert {"README.md", "video.md", "masks.md"} <= {name for name, found in shown.items() if found}


def test_every_command_says_in_short_what_it_does():
    for command in app.resolved_commands().values():
        line = command.help.partition("\n")[0]
        assert line.endswith("."), line  # not cut off
        assert len(line) <= SHORT, line
