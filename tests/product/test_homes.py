"""Commands work wherever the user's home is, or is not, as in containers."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from PIL import Image
from support.two_phase import two_phase

from anyprobe.cli import doctor
from anyprobe.files.paths import home_folder, is_there
from anyprobe.maps.radiance import write_exr
from anyprobe.masks import networks, weights
from anyprobe.masks.weights import find_weights, weight_folders
from anyprobe.match.library import open_library

pwd = pytest.importorskip("pwd", reason="needs POSIX")


def no_entry(number):
    raise KeyError(f"getpwuid(): uid not found: {number}")


def none_at_all(tmp_path, monkeypatch):
    monkeypatch.delenv("HOME")
    monkeypatch.setattr(pwd, "getpwuid", no_entry)


def a_file(tmp_path, monkeypatch):
    (tmp_path / "home").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))


def absent(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "nowhere"))


def read_only(tmp_path, monkeypatch):
    (tmp_path / "home").mkdir(mode=0o555)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))


def closed(tmp_path, monkeypatch):
    """As another user's; root may look into it, so it is said by what Python asks."""
    home, real = tmp_path / "home", os.stat
    home.mkdir(mode=0o000)

    def refused(path, *rest, **named):
        if str(path).startswith(f"{home}/"):
            raise PermissionError(13, "Permission denied", str(path))
        return real(path, *rest, **named)

    monkeypatch.setattr(os, "stat", refused)
    monkeypatch.setenv("HOME", str(home))


def empty(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "")


def no_disk(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", "/proc")
    monkeypatch.setenv("U2NET_HOME", "/dev/full")
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")


HOMES = [none_at_all, a_file, absent, read_only, closed, empty, no_disk]


@pytest.fixture(params=HOMES, ids=lambda home: home.__name__)
def home(request, tmp_path, monkeypatch):
    """A home of some kind, without weights of U2-Net-p anywhere."""
    for name in ("U2NET_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(weights, "PACKAGES", ())
    monkeypatch.setattr(weights.sys, "prefix", str(tmp_path / "environment"))
    networks.shared_network.cache_clear()
    request.param(tmp_path, monkeypatch)
    yield
    networks.shared_network.cache_clear()


def test_no_weights_are_found_there_and_all_places_are_named(home):
    assert find_weights() is None
    assert all(not is_there(folder / weights.NAME) for folder, _ in weight_folders())


@pytest.mark.ci
def test_estimate_and_doctor_work_there(home, command, work, photo_rgba, monkeypatch):
    """Masks are found in an estimate as by `anyprobe mask`."""
    monkeypatch.setattr(doctor, "self_test", lambda model: (0.1, 4.0))
    Image.fromarray(photo_rgba[..., :3]).save("photo.png")
    for order in (("estimate", "photo.png"), ("doctor",)):
        outcome = command(*order)
        assert (outcome.status, "Traceback" in outcome.err) == (0, False), (order, outcome.err)
    assert (work / "light" / "photo.exr").is_file()


def test_panoramas_are_read_there_without_their_cache(home, work):
    write_exr(work / "maps" / "a.exr", two_phase(32))
    assert open_library("maps").names == ("a",)
    assert not [one for one in work.iterdir() if one.name == "~"]


def test_the_home_is_the_users(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert home_folder() == tmp_path
    monkeypatch.delenv("U2NET_HOME", raising=False)
    assert weight_folders()[0][0] == tmp_path / ".u2net"
    monkeypatch.setenv("U2NET_HOME", "~/models")
    assert weight_folders()[0][0] == Path(tmp_path / "models")
