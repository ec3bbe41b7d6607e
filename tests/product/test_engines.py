"""Engines: the same answer from each, from many threads, and one clear line where one is absent."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import onnxruntime
import pytest
from support.refused import refused
from support.some_pair import sphere_pair

from anyprobe.errors import InputError
from anyprobe.estimate import runtime
from anyprobe.estimate.runtime import Models


@pytest.fixture(scope="module")
def crops():
    return [sphere_pair(seed).crop for seed in range(6)]


UNREAD = pytest.mark.filterwarnings("ignore:.*OpenVINO cannot read it:RuntimeWarning")


@UNREAD
def test_openvino_says_what_onnx_runtime_says_from_many_threads(crops):
    """It fuses what is in 8 bits otherwise, so that some values are a step of 255 apart."""
    pytest.importorskip("openvino", reason="needs the openvino extra")
    known, other = Models(threads=1), Models(threads=1, engine="openvino")
    expected = [known(crop, 0.2) for crop in crops]
    alone = [other(crop, 0.2) for crop in crops]
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda crop: other(crop, 0.2), crops))
    for one, two, three in zip(expected, alone, found, strict=True):
        assert np.abs(one.ldr - two.ldr).mean() < 0.01
        assert np.abs(one.irradiance - two.irradiance).mean() < 0.01
        np.testing.assert_array_equal(two.ldr, three.ldr)
    assert np.abs(found[0].ldr - found[1].ldr).max() > 0.1  # not one request's leftovers


@UNREAD
def test_bfloat16_says_nearly_the_same(crops):
    """Rounded to 8 bits every now and then, but every pixel is lifted to where it was, or next to it."""
    pytest.importorskip("openvino", reason="needs the openvino extra")
    known, other = Models(threads=1), Models(threads=1, engine="openvino-bf16")
    for crop in crops:
        one, two = known(crop, 0.2), other(crop, 0.2)
        assert np.median(np.abs(np.log(one.radiance) - np.log(two.radiance))) < 0.1
        assert np.abs(one.irradiance - two.irradiance).mean() < 0.02


@pytest.mark.ci
def test_what_openvino_cannot_read_is_run_all_the_same(monkeypatch, crops):
    class Core:
        def read_model(self, path):
            raise RuntimeError("Conversion is failed for: Reshape-17")

    monkeypatch.setitem(sys.modules, "openvino", SimpleNamespace(Core=Core))
    with pytest.warns(RuntimeWarning, match="onnx: OpenVINO cannot read it; ONNX Runtime runs it"):
        other = Models(threads=1, engine="openvino")
    np.testing.assert_array_equal(other(crops[0], 0.2).radiance, Models(threads=1)(crops[0], 0.2).radiance)


def test_absent_engine_names_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "openvino", None)
    with refused(code="unsupported", naming="[openvino]"):
        Models(engine="openvino")


def test_unknown_engine_names_the_known():
    with refused("engine"):
        Models(engine="tensorrt")


def test_cuda_is_refused_where_there_is_none_and_never_replaced_in_silence(monkeypatch):
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CPUExecutionProvider"])
    with refused("engine", code="unsupported", naming="onnxruntime-gpu", kind=InputError):
        Models(engine="cuda")
    asked = []

    class Session:
        """A runtime with CUDA, on a machine with or without a GPU."""

        has_gpu = False

        def __init__(self, path, providers):
            asked.append(providers)

        def get_providers(self):
            return ["CUDAExecutionProvider", "CPUExecutionProvider"][0 if self.has_gpu else 1 :]

    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider"])
    monkeypatch.setattr(runtime.onnxruntime, "InferenceSession", Session)
    with refused("engine", code="unsupported", naming="NVIDIA", kind=InputError):
        runtime._open_cuda(Path("light.onnx"))
    Session.has_gpu = True
    assert isinstance(runtime._open_cuda(Path("light.onnx")), Session)
    assert asked == [["CUDAExecutionProvider", "CPUExecutionProvider"]] * 2
