"""Blender runs the exported script, and imports the exported USD: what Cycles then sees and lights.

bpy needs Python 3.11 and NumPy 1, so that it may live in an environment of its own: set
ANYPROBE_BPY to that environment's python.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import support
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.export.targets import export
from anyprobe.light.light_sources import split_sources
from anyprobe.render.spheres import sphere_images, sphere_normals

pytestmark = pytest.mark.slow

SUPPORT = Path(support.__path__[0])
D = probe_directions(12)
N = np.array([[0, 0, 1.0], [0, 1, 0], [1, 0, 0], [-0.6, 0.8, 0], [0, -0.6, -0.8]])
BLENDER = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Blender's (x, -z, y) from ours."""


@pytest.fixture(scope="module")
def python():
    found = os.environ.get("ANYPROBE_BPY", sys.executable)
    tried = subprocess.run([found, "-c", "import bpy"], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip("Blender as a module is needed (pip install bpy==5.0.1 for Python 3.11; ANYPROBE_BPY)")
    return found


def light_of(height=64):
    radiance = 0.4 * two_phase(height)
    radiance[12:15, 100:104] += (40, 30, 20)
    radiance[40:43, 20:24] += (15, 20, 25)
    return radiance


def recover(python, path, folder):
    order, answer = folder / "order.json", folder / "answer.json"
    order.write_text(json.dumps({"directions": (D @ BLENDER.T).tolist(), "normals": (N @ BLENDER.T).tolist()}))
    run(python, "blender_recovers.py", path, order, answer)
    return json.loads(answer.read_text())


def run(python, script, *arguments):
    order = [python, str(SUPPORT / script), *map(str, arguments)]
    subprocess.run(order, check=True, capture_output=True, timeout=600)


def irradiance(radiance):
    d = pixel_directions(radiance.shape[0]).astype(np.float64)
    cosine = np.maximum(np.einsum("nc,hwc->nhw", N, d), 0) * pixel_solid_angles(radiance.shape[0])
    return np.einsum("nhw,hwc->nc", cosine, radiance)


@pytest.mark.parametrize("target", ["blender", "usd"])
def test_world_is_turned_or_the_sun_counts_twice(target, python, tmp_path):
    radiance = light_of()
    suffix = {"blender": ".py", "usd": ".usda"}[target]
    path = next(p for p in export(radiance, target, tmp_path, "two phase") if p.suffix == suffix)
    if target == "blender":
        path.write_text(path.read_text().replace("SUNS = False", "SUNS = True"))
    found = recover(python, path, tmp_path)
    sources, _ = split_sources(radiance)
    assert len(sources) == len(found["suns"]) == 2
    off = np.max([D @ source.direction for source in sources], axis=0) < 0.95
    assert_same_way_round(np.array(found["seen"])[off] / 0.4, D[off], degrees=1.5)
    for sun, source in zip(found["suns"], sources, strict=True):
        np.testing.assert_allclose(sun["towards"], BLENDER @ source.direction, atol=1e-3)
        if target == "blender":
            np.testing.assert_allclose(np.multiply(sun["color"], sun["energy"]), source.irradiance, rtol=1e-3)
            np.testing.assert_allclose(np.degrees(sun["angle"]), 2 * source.radius_deg, rtol=1e-3)
    if target == "blender":
        np.testing.assert_allclose(found["lit"], irradiance(radiance) / np.pi, rtol=0.06, atol=0.01)


def test_gltf_sources_have_another_strength(python, tmp_path):
    """Imported with the Lighting Mode that docs/how-to/export.md names."""
    radiance, answer = light_of(), tmp_path / "answer.json"
    path = next(p for p in export(radiance, "gltf", tmp_path, "two phase") if p.suffix == ".glb")
    run(python, "blender_gltf_lights.py", path, "COMPAT", answer)
    found, (sources, _) = json.loads(answer.read_text()), split_sources(radiance)
    assert found["mode"] == "Unitless"
    assert len(sources) == len(found["suns"]) == 2
    for sun, source in zip(found["suns"], sources, strict=True):
        np.testing.assert_allclose(sun["towards"], BLENDER @ source.direction, atol=1e-3)
        np.testing.assert_allclose(np.multiply(sun["color"], sun["energy"]), source.irradiance, rtol=1e-3)


def test_spheres_look_otherwise_than_our_own_renderer_draws_them(python, tmp_path):
    """The script opened in Blender's text editor, as docs/how-to/export.md says.

    Its glossy sphere has no Fresnel term, ours reflects a little more towards its edge.
    """
    radiance, size = light_of(), 48
    path = next(p for p in export(radiance, "blender", tmp_path, "two phase") if p.suffix == ".py")
    run(python, "blender_each_sphere.py", path, size, tmp_path / "spheres.npy")
    normals, mask = sphere_normals(size)
    facing = np.zeros((size, size), bool)
    facing[mask] = normals[:, 2] > 0.35  # a sphere of flat faces has another edge
    for seen, ours in zip(np.load(tmp_path / "spheres.npy"), sphere_images(radiance, size).values(), strict=True):
        difference = np.abs(seen - ours)[facing].sum(axis=1) / ours[facing].sum(axis=1)
        assert np.median(difference) < 0.05
        np.testing.assert_allclose(seen[facing].mean(axis=0), ours[facing].mean(axis=0), rtol=0.08)
