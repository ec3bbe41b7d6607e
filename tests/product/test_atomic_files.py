"""A set of files: all of them or none, and the older ones back when something fails."""

from __future__ import annotations

import os

import pytest

from anyprobe.errors import OutputError
from anyprobe.files.atomic import atomic_files


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def write_new(folder, names, then=None):
    with atomic_files(folder) as scratch:
        for name in names:
            (scratch / f"{name}.txt").write_text("new")
        if then is not None:
            raise then


def test_set_replaces_older_files(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "other.txt").write_text("kept")
    with atomic_files(tmp_path) as scratch:
        (scratch / "a.txt").write_text("new")
        (scratch / "b.txt").write_text("new")
        assert (tmp_path / "a.txt").read_text() == "old"
    assert contents(tmp_path) == {"a.txt": "new", "b.txt": "new", "other.txt": "kept"}


def test_failure_in_the_block_leaves_nothing(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(RuntimeError):
        write_new(tmp_path, "a", then=RuntimeError())
    assert contents(tmp_path) == {"a.txt": "old"}


def test_failure_half_way_through_the_moves_is_undone(tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "c.txt").write_text("old")
    replace = os.replace

    def full_disk(source, target):
        if os.fspath(target) == str(tmp_path / "c.txt") and "new" in os.fspath(source):
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(os, "replace", full_disk)
    with pytest.raises(OutputError, match="No space left") as caught:
        write_new(tmp_path, "abc")
    assert contents(tmp_path) == {"a.txt": "old", "c.txt": "old"}
    assert ".anyprobe-" not in str(caught.value)


def test_what_a_living_run_holds_is_left_alone(tmp_path):
    with atomic_files(tmp_path) as held:
        (held / "b.txt").write_text("mine")
        write_new(tmp_path, "c")
    assert contents(tmp_path) == dict.fromkeys(("b.txt", "c.txt"), "new") | {"b.txt": "mine"}
