"""Cubes in three.js: six .hdr faces by HDRCubeTextureLoader, .ktx2 by KTX2Loader, .dds by DDSLoader."""

from __future__ import annotations

import numpy as np
import pytest
from support.browser import run_steps
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.export.targets import export

pytestmark = pytest.mark.slow

D = probe_directions(24)


@pytest.mark.parametrize("kind", ["cube", "ktx2", "dds"])
def test_cube_is_turned_or_mirrored(kind, site, tmp_path):
    radiance = two_phase(64)
    export(radiance, kind, tmp_path, "two phase")
    seen = run_steps("three_cubes.mjs", site, {"kind": kind, "name": f"two phase_{kind}", "directions": D.tolist()})
    if "skip" in seen:
        pytest.skip(seen["skip"])
    background = np.array(seen["background"])
    assert_same_way_round(background, D, degrees=5 if kind == "dds" else 3)  # BC6H keeps v to 2 %
    np.testing.assert_allclose(background, bilinear(radiance, direction_to_uv(D)), atol=0.03)
    assert_same_way_round(np.array(seen["environment"]), D, degrees=6)
