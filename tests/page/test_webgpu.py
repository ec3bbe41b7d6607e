"""The networks on WebGPU beside WASM; Chromium's own Vulkan in software stands in for a GPU."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
from support.browser import run_steps

from anyprobe.core.response import response

pytestmark = pytest.mark.slow

VASE = Path(__file__).parents[2] / "examples" / "vase.png"
SOFTWARE_WEBGPU = ("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan")


def test_webgpu_gives_what_wasm_gives(page_url):
    seen = run_steps("page_webgpu.mjs", page_url, {"photo": str(VASE)}, flags=SOFTWARE_WEBGPU, timeout_s=580)
    if seen["adapter"] is None:
        pytest.skip(f"this Chromium has no WebGPU adapter with {' '.join(SOFTWARE_WEBGPU)}")
    maps = {
        engine: np.frombuffer(base64.b64decode(seen[engine]["radiance"]), "<f4").reshape(64, 128, 3)
        for engine in ("wasm", "webgpu")
    }
    shown = {engine: response(radiance) for engine, radiance in maps.items()}
    off = np.abs(shown["webgpu"] - shown["wasm"])
    assert off.mean() < 0.01, f"{seen['adapter']}: {off.mean():.4f} of white, {off.max():.3f} at most"
    assert np.dot(seen["webgpu"]["direction"], seen["wasm"]["direction"]) > np.cos(np.radians(5))
    assert not np.array_equal(maps["webgpu"], maps["wasm"])  # another engine rounds otherwise
