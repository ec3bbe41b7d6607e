"""What differs on Windows and macOS: names of one file, encodings, renames that are refused for a moment."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from PIL import Image

from anyprobe.files import atomic
from anyprobe.files.atomic import atomic_files, atomic_path
from anyprobe.files.paths import is_same_file


@pytest.mark.ci
@pytest.mark.parametrize(
    ("order", "encoding"),
    [(("estimate", "--size", "64"), "ascii"), (("mask",), "cp1252"), (("mask", "--json"), "ascii")],
)
def test_a_name_that_the_terminal_cannot_show_ends_nothing(work, photo_rgba, order, encoding):
    """By a table, a line and JSON."""
    name = "\u0444\u043e\u0442\u043e \u65e5\u672c.png"
    Image.fromarray(photo_rgba).save(name)
    start = "from anyprobe_command import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", start, order[0], name, *order[1:]],
        env={**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert b"Traceback" not in done.stderr
    if "--json" in order:
        assert json.loads(done.stdout)["photo"] == name


def test_names_of_one_file_are_known_by_links(tmp_path):
    (tmp_path / "photo.png").touch()
    (tmp_path / "link.png").symlink_to(tmp_path / "photo.png")
    assert is_same_file(tmp_path / "link.png", tmp_path / "photo.png")
    assert not is_same_file(tmp_path / "photo.png", tmp_path / "other.png")
    assert is_same_file(tmp_path / "not" / ".." / "yet.png", tmp_path / "yet.png")


@pytest.mark.parametrize("times", [1, 3])
def test_a_rename_that_is_refused_for_a_moment_is_tried_again(tmp_path, monkeypatch, times):
    real, tries = os.replace, []

    def replace(source, target):
        if len(tries) < times:
            tries.append(target)
            raise PermissionError(13, "in use by another process")
        real(source, target)

    monkeypatch.setattr(atomic, "RETRIES_RENAME", True)
    monkeypatch.setattr(atomic, "RETRY_DELAYS_S", (0.001, 0.001, 0.001))
    monkeypatch.setattr(os, "replace", replace)
    with atomic_path(tmp_path / "a.txt") as temporary:
        temporary.write_text("a", encoding="utf-8")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "a"
    with atomic_files(tmp_path) as folder:
        (folder / "b.txt").touch()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b.txt"]
