"""The Dockerfile: its rules, and with --slow the image itself, or its steps where nothing builds images."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.container import ROOT, build_by_steps, exec_words, read_steps


def words(name: str) -> list[str]:
    return [step.text for step in read_steps() if step.word == name]


def test_it_runs_as_nobody_and_says_how_it_is():
    (user,) = words("USER")
    assert all(number.isdecimal() and int(number) > 0 for number in user.split(":"))  # a name proves nothing to others
    last = [step.word for step in read_steps()]
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
    assert exec_words(ROOT)[1:] == ["serve"]


def test_what_it_copies_is_there_and_is_not_ignored():
    kept = {line[1:] for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if line[:1] == "!"}
    copied = [name for text in words("COPY") if not text.startswith("--from") for name in text.split()[:-1]]
    assert set(copied) == kept
    assert all((ROOT / name).exists() for name in copied)


def test_its_steps_are_those_of_the_file(tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(subprocess, "run", lambda order, **named: ran.append(order))
    prefix = build_by_steps(tmp_path, "python-of-mine")
    assert len(ran) == len(words("RUN"))
    assert ran[0] == f"python-of-mine -m venv {prefix}"
    assert not any("/opt/" in order for order in ran)
    assert (tmp_path / "source" / "src" / "anyprobe" / "__init__.py").is_file()


@pytest.mark.slow
def test_it_serves_and_ends_in_time():
    done = subprocess.run(
        [sys.executable, "-m", "tests.container"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
