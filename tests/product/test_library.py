"""Libraries of folders of maps: read once, and again when they change."""

from __future__ import annotations

import pytest
from support.places import place

from anyprobe.errors import InputError
from anyprobe.maps.radiance import write_exr
from anyprobe.match.library import open_library


def test_a_folder_is_indexed_once_and_again_when_it_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "maps"
    folder.mkdir()
    write_exr(folder / "one.exr", place(0))
    (folder / "broken.hdr").write_bytes(b"no picture")
    assert open_library(folder).names == ("one",)
    (made,) = (tmp_path / "cache").rglob("*.npz")
    stamp = made.stat().st_mtime_ns
    open_library(folder)
    assert made.stat().st_mtime_ns == stamp
    write_exr(folder / "two.exr", place(1))
    assert open_library(folder).names == ("one", "two")


def test_a_damaged_cache_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_exr(tmp_path / "one.exr", place(0))
    open_library(tmp_path)
    (made,) = (tmp_path / "cache").rglob("*.npz")
    made.write_bytes(b"half a file")
    assert open_library(tmp_path).names == ("one",)


def test_a_folder_without_maps_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(InputError, match="expected .exr or .hdr maps in the folder, got none"):
        open_library(tmp_path)
