"""Engines: the same answer from each, from many threads, and one clear line where one is absent."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from anyprobe.errors import InputError, MissingExtra
from anyprobe.infer.runtime import Models


@pytest.fixture(scope="module")
def crops():
    rng = np.random.default_rng(5)
    images = rng.random((6, 128, 128, 4), dtype=np.float32)
    images[..., :3] *= images[..., 3:]
    return images


def test_openvino_says_what_onnx_runtime_says_from_many_threads(crops):
    pytest.importorskip("openvino", reason="needs the openvino extra")
    known, other = Models(threads=1), Models(threads=1, engine="openvino")
    expected = [known(crop, 0.2) for crop in crops]
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda crop: other(crop, 0.2), crops))
    for one, two in zip(expected, found, strict=True):
        assert np.abs(one.ldr - two.ldr).mean() < 1e-3
        assert np.abs(one.irradiance - two.irradiance).mean() < 1e-3
    assert np.abs(found[0].ldr - found[1].ldr).max() > 0.001  # not one request's leftovers


def test_bfloat16_says_nearly_the_same(crops):
    """Rounded to 8 bits every now and then, but every pixel is lifted to where it was, or next to it."""
    pytest.importorskip("openvino", reason="needs the openvino extra")
    known, other = Models(threads=1), Models(threads=1, engine="openvino-bf16")
    for crop in crops:
        one, two = known(crop, 0.2), other(crop, 0.2)
        assert np.median(np.abs(np.log(one.radiance) - np.log(two.radiance))) < 0.1
        assert np.abs(one.irradiance - two.irradiance).mean() < 0.01


def test_absent_engine_names_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "openvino", None)
    with pytest.raises(MissingExtra, match=r"anyprobe\[openvino\]"):
        Models(engine="openvino")


def test_unknown_engine_names_the_known():
    with pytest.raises(InputError, match="expected one of onnxruntime, openvino"):
        Models(engine="tensorrt")
