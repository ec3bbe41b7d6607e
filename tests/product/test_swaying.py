"""The light of an object that sways before a bright wall stands still: a short part of benchmarks/swaying_light.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
pytestmark = pytest.mark.ci

SHORT = """
import numpy as np, swaying, swaying_light as benchmark
from anyprobe.estimate.estimator import Estimator
from anyprobe.video import held_mask
swaying.SECONDS = 1.2
if {still_mask}:
    held_mask.locate_key = lambda key, picture, start, offset: held_mask.Registered(
        motion=start, alike=1.0, inside=1.0, error_px=0.0)
cutout = swaying.read_cutouts(None)[0]
frames = list(swaying.frames(cutout, "bright wall", 1.2))
benchmark.frames = lambda *asked: iter(frames)
found = benchmark.single_lights(cutout, "bright wall", Estimator())
shown = benchmark.toward(benchmark.filtered(found["maps"], found["same"])[0])
print(found["iou"].min(), benchmark.angles(shown[1:], shown[:-1]).max(), found["same"][1:].all())
"""


@pytest.mark.parametrize("still_mask", [False, True])
def test_the_light_of_a_swaying_object_stands_still(still_mask):
    """And where its mask is left in place, the object leaves it."""
    ended = subprocess.run(
        [sys.executable, "-c", SHORT.replace("{still_mask}", str(still_mask))],
        cwd=BENCHMARKS,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    iou, step_deg, same = ended.stdout.split()[-3:]
    assert (float(iou) > 0.9) != still_mask
    if not still_mask:
        assert float(step_deg) < 4.0
        assert same == "True"
