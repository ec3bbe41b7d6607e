"""The Dockerfile's rules; nothing here builds its image."""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def read_steps() -> list[tuple[str, str]]:
    """Return the Dockerfile's instructions in order, each a word and its text, lines that go on joined."""
    text = re.sub(r"\\\n\s*", "", (ROOT / "Dockerfile").read_text(encoding="utf-8"))
    lines = [line.partition(" ") for line in text.splitlines() if line and not line.startswith("#")]
    return [(word, rest.strip()) for word, _, rest in lines]


def words(name: str) -> list[str]:
    return [text for word, text in read_steps() if word == name]


def test_it_runs_as_nobody_and_says_how_it_is():
    (user,) = words("USER")
    assert all(number.isdecimal() and int(number) > 0 for number in user.split(":"))  # a name proves nothing to others
    last = [word for word, _ in read_steps()]
    assert last.index("USER") > max(k for k, word in enumerate(last) if word in ("RUN", "COPY"))
    (health,) = words("HEALTHCHECK")
    command = json.loads(health.partition(" CMD ")[2])
    assert "/healthz" in command[-1]
    compile(command[-1], "health", "exec")


def test_it_is_slim_and_gets_signals_itself():
    assert all(text.split()[0].endswith("-slim") for text in words("FROM"))
    assert words("STOPSIGNAL") == ["SIGTERM"]
    for name in ("ENTRYPOINT", "CMD"):
        assert json.loads(words(name)[0])  # no shell between
    assert json.loads(words("CMD")[0])[0] == "serve" or json.loads(words("ENTRYPOINT")[0])[-1] == "serve"


def test_what_it_copies_is_there_and_is_not_ignored():
    kept = {line[1:] for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if line[:1] == "!"}
    copied = [name for text in words("COPY") if not text.startswith("--from") for name in text.split()[:-1]]
    assert set(copied) == kept
    assert all((ROOT / name).exists() for name in copied)
