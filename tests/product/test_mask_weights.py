"""U2-Net-p's weights: where they are looked for, in which order, and that no other file is taken for them."""

from __future__ import annotations

import hashlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from anyprobe.errors import MissingExtra, ModelError
from anyprobe.masks import networks, weights
from anyprobe.masks.segmenters import load_segmenter

CONTENT = b"the weights"


@pytest.fixture
def nowhere(tmp_path, monkeypatch):
    """No weights on this machine; their hash is that of CONTENT."""
    monkeypatch.setattr(weights, "SHA256", hashlib.sha256(CONTENT).hexdigest())
    monkeypatch.setattr(weights, "PACKAGES", ())
    monkeypatch.setenv("U2NET_HOME", str(tmp_path / "cache"))
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
    with pytest.raises(ModelError, match="no such file"):
        weights.find_weights(nowhere / "gone")


def test_without_weights_the_small_network_is_used(nowhere):
    networks.shared_network.cache_clear()
    try:
        assert networks.shared_network().name == "small"
        with pytest.raises(ModelError, match=r"pip install '\.\[masks\]'"):
            load_segmenter("u2netp")
    finally:
        networks.shared_network.cache_clear()


def test_fetching_downloads_once_and_checks_what_came(nowhere, monkeypatch, command):
    pytest.importorskip("pooch", reason="needs the masks extra")
    put(nowhere / "far")
    monkeypatch.setattr(weights, "URL", (nowhere / "far" / weights.NAME).as_uri())
    asked = []

    def retrieve(url, known_hash, fname, path):
        asked.append(url)
        assert known_hash == f"sha256:{weights.SHA256}"
        put(path)

    monkeypatch.setattr("pooch.retrieve", retrieve)
    assert str(nowhere / "cache" / weights.NAME) in command("mask", "--fetch").out
    assert asked == [weights.URL]
    monkeypatch.setattr("pooch.retrieve", lambda *given, **more: 1 / 0)
    assert "could not be fetched" in command("mask", "--fetch").complaint
    assert "PHOTO" in command("mask").complaint


def test_fetching_without_pooch_names_the_extra(nowhere, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(MissingExtra, match="masks"):
        weights.fetch_weights()


def test_the_real_weights_find_a_vase(request):
    if weights.find_weights() is None:
        pytest.skip("needs the masks extra")
    from anyprobe.files.images import read_image
    from anyprobe.masks.find import find_mask

    pixels = read_image(request.config.rootpath / "examples" / "vase.png")
    found = find_mask(read_image(pixels.rgb), segmenter="u2netp")
    a, b = found.mask > 0.5, pixels.alpha > 0.5
    assert (a & b).sum() / (a | b).sum() > 0.95
    assert found.warnings == ()
    grey = networks.U2NetP().cover(np.full((90, 120, 3), 0.5, np.float32))
    assert not (grey > 0.5).any()
