"""three.js in a real browser: background, environment, LightProbe and DirectionalLight of an export."""

from __future__ import annotations

import numpy as np
import pytest
from support.browser import run_steps
from support.shading_terms import irradiance
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.export.targets import export
from anyprobe.light.harmonics import project
from anyprobe.light.light_sources import split_sources

pytestmark = pytest.mark.slow

D = probe_directions(24)


def lit(url: str, radiance: np.ndarray, folder) -> dict[str, np.ndarray]:
    export(radiance, "three", folder, "two phase")
    seen = run_steps("three_light.mjs", url, {"module": "/export/two%20phase_three.js", "directions": D.tolist()})
    return {key: value if key == "suns" else np.array(value) for key, value in seen.items()}


def test_background_environment_and_probe_disagree(site, tmp_path):
    radiance = two_phase(64)
    seen = lit(site, radiance, tmp_path)
    assert_same_way_round(seen["background"], D, degrees=2.5)
    assert_same_way_round(seen["environment"], D, degrees=6)  # its prefiltered cube is 256 texels wide at most
    sh = project(radiance)
    np.testing.assert_allclose(seen["probe"], irradiance(sh, D.astype(np.float32)) / np.pi, atol=2e-3)


def test_suns_and_ambient_probe_are_not_the_whole_light(site, tmp_path):
    """A white sphere's middle, facing every direction: E of the rest by SH, and of the suns by their cosines."""
    radiance = 0.2 * two_phase(64)
    radiance[14:17, 90:94] += (60, 50, 40)
    radiance[40:43, 20:24] += (15, 20, 25)
    seen = lit(site, radiance, tmp_path)
    sources, ambient = split_sources(radiance)
    assert len(sources) == len(seen["suns"]) == 2
    wanted = irradiance(project(ambient), D.astype(np.float32)) / np.pi
    for sun, source in zip(seen["suns"], sources, strict=True):
        np.testing.assert_allclose(sun["position"], source.direction, atol=1e-5)
        np.testing.assert_allclose(np.multiply(sun["color"], sun["intensity"]), source.irradiance, rtol=1e-4)
        assert sun["angleDeg"] == pytest.approx(2 * source.radius_deg, rel=1e-3)
        wanted = wanted + np.maximum(D @ source.direction, 0)[:, None] * source.irradiance / np.pi
    np.testing.assert_allclose(seen["split"], wanted, rtol=0.01, atol=2e-3)


def test_furnace(site, tmp_path):
    seen = lit(site, np.ones((32, 64, 3), np.float32), tmp_path)
    for name in ("background", "environment", "rough", "probe"):
        np.testing.assert_allclose(seen[name], 1, atol=0.01, err_msg=name)
