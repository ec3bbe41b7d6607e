"""The scene that the three.js tutorial makes, in a real browser: lit from where the estimate says."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import NODE_MODULES, NoBrowser, find_browser, run_steps, serve

import anyprobe

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorials" / "three.md"
FILE = re.compile(r"^Save as `scene/([^`]+)`:\n\n```\w+\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture
def scene(tmp_path) -> Path:
    """The tutorial's folder, of an estimate lit from the left."""
    light = anyprobe.estimate(ROOT / "examples" / "table.jpg", box=(130, 100, 325, 385), fov_deg=42)
    assert light.dominant_light().direction[0] < -0.3
    light.export("three", tmp_path, "table_panorama")
    for name, text in FILE.findall(PAGE.read_text(encoding="utf-8")):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_scene_is_lit_from_the_left(scene):
    try:
        find_browser()
    except NoBrowser as reason:
        pytest.skip(str(reason))
    with serve({"/": scene, "/node_modules/": NODE_MODULES}) as url:
        picture = base64.b64decode(run_steps("tutorial_scene.mjs", url))
    with Image.open(io.BytesIO(picture)) as image:
        seen = np.asarray(image.convert("L"), np.float32) / 255
    middle = seen.shape[1] // 2
    left, right = seen[200:300, middle - 90 : middle], seen[200:300, middle : middle + 90]  # of the ball
    assert left.mean() > right.mean() + 0.1
    shadow, opposite = seen[390:415, middle + 120 : middle + 200], seen[390:415, middle - 200 : middle - 120]
    assert shadow.mean() < 0.6 * opposite.mean()
