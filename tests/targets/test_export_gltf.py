"""Babylon.js reads the exported .glb: EXT_lights_image_based's faces and coefficients, and the light sources.

It is large and not in tests/browser's package.json: npm install --no-save babylonjs babylonjs-loaders there.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from support.browser import FOLDER, NODE_MODULES, NoBrowser, find_browser, run_steps, serve
from support.shading_terms import irradiance
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.export.exported_light import prepare
from anyprobe.export.targets import export

pytestmark = pytest.mark.slow

D = probe_directions(16)
LEFT_HANDED = np.array([-1, 1, 1])
"""Babylon.js' default world from glTF's axes."""


def test_faces_and_coefficients_are_turned_or_mirrored(tmp_path):
    modules = Path(os.environ.get("ANYPROBE_BABYLON", NODE_MODULES))
    try:
        find_browser()
    except NoBrowser as reason:
        pytest.skip(str(reason))
    if not (modules / "babylonjs").is_dir():
        pytest.skip("Babylon.js is needed (npm install --no-save babylonjs babylonjs-loaders in tests/browser)")
    radiance = 0.4 * two_phase(64)
    radiance[12:15, 100:104] += (40, 30, 20)
    radiance[40:43, 20:24] += (15, 20, 25)
    light = prepare(radiance, "two phase", sources=True)
    export(radiance, "gltf", tmp_path, "two phase")
    folders = {"/": FOLDER, "/export/": tmp_path, "/node_modules/": modules}
    with serve(folders) as url:
        seen = run_steps("babylon_gltf.mjs", url, {"file": "two phase_gltf.glb", "directions": D.tolist()})
    assert len(light.lights) == len(seen["lights"]) == 2
    off = np.max([D @ one.direction for one in light.lights], axis=0) < 0.95
    assert_same_way_round(np.array(seen["mirror"])[off] / 0.4, D[off], degrees=5)
    wanted = irradiance(light.sh_ambient, D.astype(np.float32)) / np.pi
    np.testing.assert_allclose(np.array(seen["white"]), wanted, atol=0.03)
    for sun, one in zip(seen["lights"], light.lights, strict=True):
        np.testing.assert_allclose(sun["direction"] * LEFT_HANDED, -one.direction, atol=1e-4)
        np.testing.assert_allclose(np.multiply(sun["color"], sun["intensity"]), one.irradiance, rtol=1e-4)
