"""What comes late, is interrupted or fails leaves the page showing one thing, and usable."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import run_steps

pytestmark = pytest.mark.slow

VASE = Path(__file__).parents[2] / "examples" / "vase.png"
ENDED = "The camera has ended"


@pytest.fixture
def broken_photo(tmp_path) -> Path:
    path = tmp_path / "broken.png"
    path.write_bytes(b"no picture")
    return path


@pytest.fixture
def half_photo(tmp_path, vase_photo) -> Path:
    """The opaque example at half its size."""
    path = tmp_path / "half.jpg"
    with Image.open(vase_photo) as image:
        image.reduce(2).save(path, quality=95)
    return path


@pytest.fixture
def plain_photo(tmp_path) -> Path:
    path = tmp_path / "plain.png"
    Image.new("RGB", (320, 240), (128, 127, 126)).save(path)
    return path


@pytest.fixture
def backdrop_photo(tmp_path) -> Path:
    """The example's vase on grey, opaque."""
    path = tmp_path / "backdrop.jpg"
    with Image.open(VASE) as image:
        grey = Image.new("RGBA", image.size, (128, 127, 126))
        Image.alpha_composite(grey, image).convert("RGB").save(path, quality=95)
    return path


@pytest.fixture
def clip(tmp_path) -> Path:
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"\0\0\0\x18ftypmp42" + bytes(64))
    return path


def part(whole: dict, names) -> dict:
    return {name: whole[name] for name in names}


def test_late_mask_is_not_put_on_another_picture(page_url, vase_photo, half_photo, plain_photo):
    photos = {"photo": vase_photo, "other": half_photo, "plain": plain_photo}
    seen = run_steps("page_late.mjs", page_url, {name: str(path) for name, path in photos.items()})
    kept = {"status": True, "direction": True, "mask": True, "estimates": 0}
    assert seen["late"] == {"click": kept, "reset": kept}
    assert seen["waiting"] == {"direction": "not yet known", "usable": 0, "estimates": 0}
    with Image.open(half_photo) as picture:
        assert seen["then"]["estimates"] == [{"say": "estimate", "width": picture.width, "surroundings": "none"}]
    assert seen["then"]["usable"] > 0
    assert seen["nothing"]["status"].startswith("Nothing stands out there. Click on the object")
    assert [seen["nothing"][part] for part in ("usable", "estimates")] == [0, 0]


def test_a_mark_or_a_file_that_gives_nothing_leaves_the_last_light(page_url, backdrop_photo, broken_photo, clip):
    seen = run_steps(
        "page_kept.mjs",
        page_url,
        {
            "photo": str(backdrop_photo),
            "on": [0.5, 0.55],
            "beside": [0.08, 0.1],
            "files": [str(broken_photo), str(clip)],
        },
        viewport=(1280, 900),
        timeout_s=600,
        complaints_allowed=True,  # the server refuses the files
    )
    first, again = seen["first"], seen["again"]
    assert first["kept"]["quality"] == "The mask looks right."
    for way, before in (("click", "first"), ("box", "first"), ("pending", "marked")):
        assert seen[way]["kept"] == seen[before]["kept"], way
        assert seen[way]["status"].startswith("Nothing stands out there. The last object and its light stay"), way
        assert (seen[way]["kind"], seen[way]["link"]) == ("warning", "#mask")
    assert [seen[way]["lights"] - first["lights"] for way in ("click", "box", "again", "pending")] == [0, 0, 1, 2]
    marked = {way: (len(seen[way]["hints"]["on"]), seen[way]["hints"]["box"] is not None) for way in ("box", "again")}
    assert marked == {"box": (0, True), "again": (1, False)}  # without those that found nothing
    assert again["kept"]["mask"] != first["kept"]["mask"]
    assert seen["reset"]["kept"] == first["kept"]
    small = seen["small"]
    assert re.match(r"expected an object of 24 pixels across or more, got \d+; go closer", small["status"])
    assert (small["kind"], small["kept"]["direction"], small["kept"]["buttons"]) == ("fault", "not yet known", 0)
    no_picture, video = seen["refused"]
    assert re.match(r"broken\.png: expected an image .*; choose a photo: JPEG", no_picture)
    assert re.match(r"clip\.mp4: .* video.*; choose a photo, or use the camera$", video)
    assert seen["png"].startswith("The map as it is shown")


def test_camera_is_one_and_ends_with_what_takes_its_place(page_url, vase_photo, broken_photo):
    given = {"photo": str(vase_photo), "broken": str(broken_photo)}
    seen = run_steps(
        "page_camera_states.mjs",
        page_url,
        given,
        viewport=(1000, 800),
        complaints_allowed=True,  # the server refuses the broken photo
    )
    live = {"button": "Stop", "tracks": ["live"], "shown": ["video"], "aspect": "640 / 480"}
    assert part(seen["live"], live) == live
    assert part(seen["broken"], live) == live
    assert seen["broken"]["status"].startswith("broken.png: expected an image ")
    assert seen["turned"]["tracks"] == ["live"]
    assert seen["turned"]["mask"] < 1
    assert seen["overlay"] == "visible"
    # the vase, [.31, .20, .69, .79] of a square, in the middle of 640 x 480 and of 480 x 640
    np.testing.assert_allclose(seen["outline"], [0.36, 0.2, 0.64, 0.79], atol=0.04)
    np.testing.assert_allclose(seen["turnedOutline"], [0.31, 0.28, 0.69, 0.72], atol=0.04)
    assert seen["lines"] == 0
    assert seen["found"].startswith("Live, in this browser.")
    photo = {"button": "Camera", "shown": ["photo"]}
    assert part(seen["ended"], photo) == photo
    assert seen["ended"]["status"].startswith(ENDED)
    assert seen["usable"] > 0
    assert part(seen["photo"], photo) == photo
    assert seen["photo"]["tracks"] == ["ended", "ended"]
    assert seen["photo"]["status"].startswith("Estimated")
    assert seen["opening"]["status"].startswith("Opening the camera")
    assert part(seen["closed"], photo) == photo
    assert seen["closed"]["tracks"] == ["ended"] * 3
    assert seen["unheard"] == []


def test_networks_that_were_missing_are_fetched_again(page_url, vase_photo):
    missing = {
        "**/weights/light.onnx*": "light.onnx could not be fetched",
        "**/ort/*.min.mjs": "ort.wasm.min.mjs",
        "**/ort/*threaded.wasm": "ort-wasm-simd-threaded.wasm",
        "**/assets/worker-*.js": "thread",
    }
    given = {"photo": str(vase_photo), "missing": list(missing)}
    seen = run_steps("page_networks.mjs", page_url, given, complaints_allowed=True)
    for pattern, name in missing.items():
        fault, then = seen[pattern]
        assert name in fault
        assert then.startswith("Estimated")


def test_a_download_that_stalls_says_so(page_url, vase_photo):
    seen = run_steps("page_stalled.mjs", page_url, {"photo": str(vase_photo), "file": "**/weights/light.onnx*"})
    assert seen["stalled"].startswith("Waiting for light.onnx: 0.0 MB have come.")
    assert seen["then"].startswith("Estimated")


def test_lights_are_estimated_without_webgl(page_url, vase_photo):
    seen = run_steps("page_without_webgl.mjs", page_url, {"photo": str(vase_photo)}, flags=("--disable-3d-apis",))
    assert seen["first"].startswith("This browser has no WebGL")
    assert not seen["usable"]
    assert not seen["shown"]
    assert seen["then"].startswith("Estimated")
    assert seen["direction"] != "not yet known"
