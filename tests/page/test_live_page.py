"""The live page in a real browser: a photo, clicks, downloads, the camera, keys, a phone."""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import run_steps
from support.camera import camera_flags, write_y4m
from support.mesh_files import glb

from anyprobe.core.color import luminance
from anyprobe.core.response import response
from anyprobe.export.targets import TARGETS
from anyprobe.light.harmonics import project
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import read_radiance

pytestmark = pytest.mark.slow

VASE = Path(__file__).parents[2] / "examples" / "vase.png"
MIDDLE = [0.5, 0.55]
"""Of the picture: on the vase."""


HEADINGS = {
    None: [*("choose", "camera", "example", "example-teapot"), *("before", "draw-box", "reset", "removing", "outline")],
    "Environment map": ["exposure", "false-color"],
    "Virtual object": ["shape", "material", "model", "turn", "size"],
    "Estimate": ["surroundings", "pitch"],
    "Download": ["targets", "export"],
}
"""Of the page, and the controls that each is about."""


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.dot(a, b) / np.linalg.norm(a) / np.linalg.norm(b))))


def test_own_photo_is_estimated_clicked_relit_and_downloaded(page_url, aside_photo, vase_photo, estimator, tmp_path):
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    (tmp_path / "own.glb").write_bytes(glb(tetrahedron, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])))
    with Image.open(VASE) as image:
        white = Image.new("RGBA", image.size, "white")
        Image.alpha_composite(white, image).convert("RGB").save(tmp_path / "backdrop.jpg", quality=95)
    seen = run_steps(
        "page_photo.mjs",
        page_url,
        {
            "photo": str(aside_photo),
            "opaque": str(vase_photo),
            "backdrop": str(tmp_path / "backdrop.jpg"),
            "glb": str(tmp_path / "own.glb"),
            "click": MIDDLE,
            "targets": list(TARGETS),
            "folder": str(tmp_path),
        },
        viewport=(1280, 900),
        timeout_s=600,
    )
    assert seen["elsewhere"] == []
    light_in = r"light in \d+\.\d s\. If the outline is wrong"
    assert re.match(rf"Estimated: object found in \d+\.\d s, {light_in}", seen["clicked"])
    assert re.match(rf"Estimated: {light_in}", seen["alone"])  # the object was known
    assert seen["material"] == "own"
    assert "Finding the object …" in seen["said"]
    assert seen["said"].index("Finding the object …") < seen["said"].index("Estimating the lighting …")
    assert seen["focused"] == "mask"
    assert seen["backdrop"].endswith("choose “the whole photo” at “Look at”.")

    expected = estimator(aside_photo)
    files = {kind: Path(path) for kind, path in seen["files"].items()}
    map_of_page = read_radiance(files["exr"])
    np.testing.assert_allclose(read_radiance(files["hdr"]), map_of_page, rtol=0.02, atol=0.02)
    # the browser's photo is not Pillow's to the last bit, and the network computes in steps of 8 bits
    shown, wanted = response(map_of_page), response(expected.radiance)
    assert np.abs(shown - wanted).mean() < 0.01
    assert np.abs(shown[:, ::-1] - wanted).mean() > 0.05
    sidecar = json.loads(files["json"].read_text())
    assert sidecar["photo"] == "vase"
    assert sidecar["hints"] == {"surroundings": 0}  # what a photo's alpha channel hides is no place
    of_package = expected.sidecar()
    assert sidecar["confidence"] == pytest.approx(of_package["confidence"], abs=0.01)
    assert sidecar["well_exposed_fraction"] == pytest.approx(expected.well_exposed_fraction, abs=0.01)
    with Image.open(vase_photo) as picture:
        click = (MIDDLE[0] * picture.width, MIDDLE[1] * picture.height)
    opaque = estimator(vase_photo, click=[click], surroundings="photo")
    coverage = json.loads(Path(seen["background"]["json"]).read_text())["hints"]["surroundings"]
    assert coverage == pytest.approx(opaque.sidecar()["hints"]["surroundings"], abs=3e-3)
    found = read_radiance(Path(seen["background"]["exr"]))
    beside = (32, slice(70, 74))  # a little right of where the camera looks: the backdrop
    np.testing.assert_allclose(found[beside], opaque.radiance[beside], atol=0.02)
    np.testing.assert_allclose(sidecar["sh9"], project(map_of_page), atol=0.01)
    # small light sources are most of the harmonics, and steps of 8 bits move them by up to a pixel: they are apart here
    up_to_white = [project(one / np.maximum(luminance(one), 1)[..., None]) for one in (map_of_page, expected.radiance)]
    assert np.linalg.norm(up_to_white[0] - up_to_white[1]) < 0.05 * np.linalg.norm(up_to_white[1])
    of_page, of_python = find_dominant_light(map_of_page), find_dominant_light(expected.radiance)
    assert of_page.direction @ of_python.direction > np.cos(np.radians(3))
    np.testing.assert_allclose(of_page.irradiance, of_python.irradiance, rtol=0.1)
    with Image.open(files["png"]) as picture:
        assert picture.size == (128, 64)
    for target in TARGETS:
        archive = zipfile.ZipFile(io.BytesIO(files[target].read_bytes()))
        said = json.loads(archive.read(f"light_{target}.json"))
        assert said["dominant_light"]["error_deg"] == pytest.approx(sidecar["dominant_light"]["error_deg"], abs=0.06)
        assert said["origin"]["level"].endswith("the camera's pitch is not known")  # of a cut-out
        assert said["origin"]["photo"] == "vase"


def test_box_is_drawn_by_mouse_key_and_finger(page_url, vase_photo):
    box = [0.26, 0.45, 0.74, 0.85]  # around the vase without its neck
    seen = run_steps("page_box.mjs", page_url, {"photo": str(vase_photo), "box": box}, viewport=(1280, 900))
    outlines = seen["outlines"]
    assert outlines["before"][1] < 0.25
    np.testing.assert_allclose(outlines["wobble"], outlines["click"], atol=0.01)  # a box of two pixels
    for way in ("mouse", "keys", "finger"):
        np.testing.assert_allclose(outlines[way], [0.31, 0.45, 0.69, 0.79], atol=0.03, err_msg=way)
    assert seen["band"]
    assert seen["pressed"] == ["false", "true", "false"]
    assert seen["hints"] == {"before": False, "dragging": True, "keys": False}


def test_pictures_handle_divides_before_from_after(page_url):
    seen = run_steps("page_compare.mjs", page_url, viewport=(1280, 900))
    assert seen["differing"] == {"0": [True, True], "100": [False, False], "dragged": [False, True]}
    assert seen["dragged"] == pytest.approx(seen["middle"], abs=3)
    # a press on the object moves it, where it is shown; elsewhere it marks
    assert seen["moved"] == pytest.approx(0.1, abs=0.02)
    assert seen["asked"] == {"moving": 0, "wiped": 1}
    assert seen["box"] is not None


def test_example_photo_is_estimated(page_url):
    seen = run_steps("page_example.mjs", page_url, viewport=(1280, 900))
    np.testing.assert_allclose(seen["outline"], [0.3, 0.43, 0.62, 0.65], atol=0.03)  # the teapot without its saucer
    assert "oriento" in seen["credit"]


def test_static_page_works_without_a_server(static_url, tmp_path):
    seen = run_steps("page_static.mjs", static_url, {"photo": str(VASE), "folder": str(tmp_path)})
    assert seen["elsewhere"] == []
    assert seen["isolated"]
    assert seen["targets_hidden"]
    assert read_radiance(Path(seen["file"])).shape == (64, 128, 3)


def test_keys_reach_everything_and_everything_has_a_name(page_url):
    seen = run_steps("page_access.mjs", page_url, viewport=(1280, 900))
    assert [one["id"] for one in seen["named"] if not one["name"]] == []
    assert seen["unnamed"] == []
    assert {one["id"] for one in seen["named"]} <= set(seen["reached"])
    assert seen["sizes"][1] > seen["sizes"][0]
    assert seen["cross"] == "52%"
    assert seen["taken"] == []  # keys with Ctrl, Alt or Meta are the browser's
    assert seen["live"] == "polite"
    assert seen["headings"][0] == "H1"


def test_exposure_moves_every_preview_of_the_light_and_not_the_photo(page_url):
    seen = run_steps("page_exposure.mjs", page_url, viewport=(1280, 900))
    previews = ["map", "sphere-matte", "sphere-silver", "sphere-mirror"]
    for preview in previews:
        assert 0 < seen["darker"][preview] < 0.7 * seen["plain"][preview], preview
    assert seen["darker"]["photo"] == seen["plain"]["photo"]
    assert {name: seen["again"][name] for name in previews} == {name: seen["plain"][name] for name in previews}


def test_example_is_estimated_as_asked_and_a_given_pitch_counts(page_url):
    seen = run_steps("page_estimate.mjs", page_url, viewport=(1280, 900))
    assert seen["none"]["coverage"] == 0
    assert seen["photo"]["coverage"] > 0
    assert seen["photo"]["ground"]["source"] == "estimated"
    assert seen["steep"]["ground"]["pitchDeg"] == pytest.approx(50)
    assert seen["steep"]["ground"]["source"] == "given"
    assert seen["steep"]["shown"] == "50°"
    maps = {name: response(np.array(one["radiance"])) for name, one in seen.items()}
    assert np.abs(maps["steep"] - maps["photo"]).mean() > 0.01
    assert seen["again"]["ground"] == seen["photo"]["ground"]  # a pitch is given for one picture


@pytest.mark.parametrize("viewport", [(1280, 900), (1000, 900), (800, 900), (390, 844)])
def test_controls_stand_under_the_heading_that_names_them(page_url, viewport):
    seen = run_steps("page_access.mjs", page_url, viewport=viewport)
    expected = {control: heading for heading, controls in HEADINGS.items() for control in controls}
    assert seen["under"] == expected
    assert seen["strip"] < 32  # nothing empty beneath the virtual object's


def test_phone_shows_all_of_it(page_url):
    seen = run_steps("page_access.mjs", page_url, viewport=(360, 740))
    width, shown = seen["width"]
    assert width <= shown
    assert seen["small"] == []
    assert seen["below"] == []  # picture, line of status and map are on the first screen


def test_camera_is_followed_and_closed(page_url, vase_frame, estimator, tmp_path):
    rng = np.random.default_rng(7)
    frames = [np.clip(vase_frame + rng.normal(0, 2, vase_frame.shape), 0, 255).astype(np.uint8) for _ in range(8)]
    video = write_y4m(tmp_path / "camera.y4m", frames)
    seen = run_steps(
        "page_camera.mjs",
        page_url,
        {"seconds": 0, "lights": 8, "click": MIDDLE},
        flags=camera_flags(video),
        viewport=(1280, 900),
        timeout_s=600,
    )
    assert "lights a second" in seen["rates"][-1]["text"]
    assert seen["quality"] == "The mask looks right."
    directions = np.array([light["direction"] for light in seen["lights"][4:]])  # the click has been heard
    assert (directions @ directions[-1] > np.cos(np.radians(10))).all()  # a still scene
    height, width = vase_frame.shape[:2]
    expected = estimator(vase_frame, click=(MIDDLE[0] * width, MIDDLE[1] * height)).sh9()
    found = np.reshape(seen["lights"][-1]["sh9"], (9, 3))
    assert angle_deg(found[0], expected[0]) < 6  # colour; the two masks are not quite the same
    assert angle_deg(luminance(found[1:4]), luminance(expected[1:4])) < 25  # where most of it comes from
    assert seen["stopped"]
