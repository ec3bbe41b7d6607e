"""The bundled networks: their contract, their size, their identity."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.refused import refused

from anyprobe.errors import ModelError
from anyprobe.estimate import runtime
from anyprobe.estimate.light_graph import graph_inputs
from anyprobe.estimate.runtime import CONTRACT, STAGES, Models, file_hashes, model_id, weights_folder

MAX_WEIGHTS_BYTES = 40 * 2**20


@pytest.fixture
def copied(tmp_path, monkeypatch) -> Path:
    """The networks in a folder where they may be spoilt, and taken from there."""
    folder = tmp_path / "paper"
    shutil.copytree(weights_folder("paper"), folder)
    monkeypatch.setattr(runtime, "weights_folder", lambda model: folder)
    return folder


def assert_refused(*words: str) -> None:
    with pytest.raises(ModelError) as caught:
        Models()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def spoil_metadata(path: Path, key: str, value: str | None) -> None:
    onnx = pytest.importorskip("onnx", reason="needs onnx, of './train[torch]'")
    graph = onnx.load(path)
    found = {entry.key: entry.value for entry in graph.metadata_props}
    assert key in found
    kept = {**found, key: value}
    onnx.helper.set_model_props(graph, {k: v for k, v in kept.items() if v is not None})
    onnx.save(graph, path)


def test_contract_names_all_that_would_silently_change_the_map():
    assert set(CONTRACT) == {"contract", "frame", "logarithm", "curve", "map_height"}


@pytest.mark.parametrize("key", [*CONTRACT, "stage"])
@pytest.mark.parametrize("value", ["something else", None])
def test_graph_of_another_contract_is_refused(copied, key, value):
    spoil_metadata(copied / "irradiance.onnx", key, value)
    assert_refused("irradiance.onnx", f"expected {key}", repr(value))


def test_untouched_copy_is_accepted(copied, rng):
    mask = np.zeros((60, 80), np.float32)
    mask[20:50, 20:50] = 1.0
    said = Models("paper", threads=1)(graph_inputs(rng.random((60, 80, 3), dtype=np.float32), mask, 60.0))
    height = int(CONTRACT["map_height"])
    assert said.irradiance.shape == (128, 128, 3)
    assert said.radiance.shape == (height, 2 * height, 3)


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("damage", ["cut", "empty", "other", "gone"])
def test_damaged_file_is_refused(copied, stage, damage):
    path = copied / f"{stage}.onnx"
    data = path.read_bytes()
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes({"cut": data[: len(data) // 2], "empty": b"", "other": b"\x89PNG\r\n" * 99}[damage])
    assert_refused(f"{stage}.onnx", "reinstall anyprobe")


def test_unknown_model_names_the_known():
    for model in ("nobody", "", "paper/../nobody"):
        with refused("model", code="invalid-model"):
            weights_folder(model)


def test_a_model_may_be_a_folder(tmp_path):
    folder = shutil.copytree(weights_folder("paper"), tmp_path / "mine")
    assert Models(str(folder)).name == str(folder)
    assert model_id(str(folder)) == model_id("paper").replace("paper-", "mine-")


def test_weights_fit_into_a_wheel():
    root = weights_folder("paper").parent
    assert sum(p.stat().st_size for p in root.rglob("*") if p.is_file()) <= MAX_WEIGHTS_BYTES
    assert {p.stem for p in root.glob("paper/*.onnx")} == set(STAGES)
    assert (root / "paper" / "README.md").is_file()  # weights never go without their card


def test_hashes_name_the_bytes(copied):
    hashes = file_hashes("paper")
    assert list(hashes) == list(STAGES)
    for stage, digest in hashes.items():
        assert hashlib.sha256((copied / f"{stage}.onnx").read_bytes()).hexdigest().startswith(digest)
        assert len(digest) == 12
    identity = model_id("paper")
    assert identity == model_id("paper")
    assert identity.startswith("paper-")
    for stage in STAGES:
        path = copied / f"{stage}.onnx"
        data = path.read_bytes()
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        assert model_id("paper") != identity
        assert {s for s, digest in file_hashes("paper").items() if digest != hashes[s]} == {stage}
        path.write_bytes(data)
    assert model_id("paper") == identity
