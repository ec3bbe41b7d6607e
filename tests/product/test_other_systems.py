"""What differs on Windows and macOS: names of one file, encodings, renames that are refused for a moment."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image
from support.refused import refused

from anyprobe.cli import photo_files
from anyprobe.files import atomic, paths
from anyprobe.files.atomic import atomic_files, atomic_path
from anyprobe.files.paths import folds_case, same_file_key


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


def test_results_that_differ_by_case_alone_are_refused_where_that_is_one_file(command, work, photo_rgba, monkeypatch):
    for name in ("Vase.png", "vase.webp"):
        Image.fromarray(photo_rgba).save(name, lossless=True)
    arguments = ("mask", "Vase.png", "vase.webp", "-q")
    assert command(*arguments).status == (2 if folds_case(work) else 0)
    monkeypatch.setattr(photo_files, "folds_case", lambda folder: True)
    outcome = command(*arguments)
    assert outcome.status == 2
    assert "expected distinct result names" in outcome.err


def test_one_file_has_one_key_whatever_its_case_where_that_does_not_count(tmp_path, monkeypatch):
    (tmp_path / "Photo.png").touch()
    assert same_file_key(tmp_path / "Photo.png") != same_file_key(tmp_path / "photo.PNG") or folds_case(tmp_path)
    monkeypatch.setattr(paths, "folds_case", lambda folder: True)
    assert same_file_key(tmp_path / "Photo.png") == same_file_key(tmp_path / "photo.PNG")


@pytest.mark.skipif(sys.platform != "linux", reason="of a system whose names have cases")
def test_whether_case_counts_is_seen_of_the_nearest_folder_that_is_there(tmp_path, monkeypatch):
    (tmp_path / "Folder").mkdir()
    if (tmp_path / "fOLDER").exists():
        assert folds_case(tmp_path / "Folder" / "not" / "yet")
        return
    assert not folds_case(tmp_path / "Folder" / "not" / "yet")
    (tmp_path / "fOLDER").symlink_to(tmp_path / "Folder")  # as such a system answers
    assert folds_case(tmp_path / "Folder" / "not" / "yet")


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


def test_a_rename_that_is_refused_for_good_is_one_line(tmp_path, monkeypatch):
    def replace(source, target):
        raise PermissionError(13, "in use by another process")

    monkeypatch.setattr(atomic, "RETRIES_RENAME", True)
    monkeypatch.setattr(atomic, "RETRY_DELAYS_S", (0.001,))
    monkeypatch.setattr(os, "replace", replace)
    with (
        refused(code="not-written", source="a.txt", naming="in use by another process"),
        atomic_path(tmp_path / "a.txt") as temporary,
    ):
        temporary.write_text("a", encoding="utf-8")
    assert list(tmp_path.iterdir()) == []


def test_no_text_is_opened_in_the_encoding_of_the_system():
    """Which is cp1252 on Windows; ruff's PLW1514 finds them."""
    source = Path(photo_files.__file__).parents[1]
    order = [sys.executable, "-m", "ruff", "check", "--preview", "--isolated", "--select", "PLW1514", str(source)]
    done = subprocess.run(order, capture_output=True, text=True, check=False)
    if "No module named" in done.stderr:
        pytest.skip("needs ruff")
    assert done.returncode == 0, done.stdout
