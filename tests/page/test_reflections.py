"""The page's sharp reflections: the server's detail in what mirrors, and in nothing else."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from support.browser import run_steps
from support.page_spheres import drawn_by_package

from anyprobe.estimate.result import Light

pytestmark = pytest.mark.slow


def pixels(one: dict) -> np.ndarray:
    """[H, W, 4] in [0, 1] of the overlay."""
    shape = (one["height"], one["width"], 4)
    return np.frombuffer(base64.b64decode(one["rgba"]), np.uint8).reshape(shape) / 255


def test_what_mirrors_shows_the_server_s_detail_and_all_else_stays(page_url):
    seen = run_steps("page_reflections.mjs", page_url, {}, viewport=(1280, 900), complaints_allowed=True)
    plain, sharp, again = (seen[name] for name in ("plain", "sharp", "again"))
    assert seen["lost"]["status"].startswith("the server that adds sharp reflections does not answer; start ")
    assert not seen["lost"]["isTicked"]
    assert seen["answer"] == 200
    assert sharp["chrome"]["radiance"] == plain["chrome"]["radiance"]  # the light itself

    chrome = pixels(sharp["chrome"])
    radiance = np.frombuffer(base64.b64decode(plain["chrome"]["radiance"]), "<f4").reshape(64, 128, 3)
    detailed = Light(radiance=radiance).with_detail(size=256).radiance
    off = {}
    for name, light in (("plain", radiance), ("detailed", detailed)):
        size = chrome.shape[1], chrome.shape[0]
        package = drawn_by_package(*size, sharp["chrome"]["pose"], light, "chrome")
        both = (chrome[..., 3] == 1) & (package[..., 3] == 1)
        assert both.sum() > 500
        off[name] = np.abs(chrome[both] - package[both])[:, :3].mean()
    assert off["detailed"] <= 0.04
    assert off["detailed"] < 0.7 * off["plain"]

    assert np.abs(pixels(sharp["matte"]) - pixels(plain["matte"])).max() <= 2 / 255
    for name in ("matte", "silver"):
        assert sharp["spheres"][name] == plain["spheres"][name]
    assert sharp["spheres"]["mirror"] != plain["spheres"]["mirror"]
    assert again["spheres"] == plain["spheres"]
    np.testing.assert_array_equal(pixels(again["chrome"]), pixels(plain["chrome"]))
