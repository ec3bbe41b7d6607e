"""Cubes in three.js: six .hdr faces by HDRCubeTextureLoader, .ktx2 by KTX2Loader."""

from __future__ import annotations

import numpy as np
import pytest
from support.browser import run_steps
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.export.targets import export

pytestmark = pytest.mark.slow

D = probe_directions(24)


@pytest.mark.parametrize("kind", ["cube", "ktx2"])
def test_cube_is_turned_or_mirrored(kind, site, tmp_path):
    radiance = two_phase(64)
    export(radiance, kind, tmp_path, "two phase")
    seen = run_steps("three_cubes.mjs", site, {"kind": kind, "name": f"two phase_{kind}", "directions": D.tolist()})
    background = np.array(seen["background"])
    assert_same_way_round(background, D, degrees=3)
    np.testing.assert_allclose(background, bilinear(radiance, direction_to_uv(D)), atol=0.03)
    assert_same_way_round(np.array(seen["environment"]), D, degrees=6)
