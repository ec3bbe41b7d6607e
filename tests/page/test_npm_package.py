"""The npm package as others install it: packed, in a plain page with an import map, and through a bundler."""

from __future__ import annotations

import base64
import json
import re
import shutil
import tarfile
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.balls import FOV, ball_photo, rich_map
from support.browser import run_steps, serve
from support.bundlers import build_example, pack
from support.page_spheres import MOST_OFF, SPHERES, drawn_by_package, typical_difference

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"
EXAMPLES = WEB / "examples"
VASE = ROOT / "examples" / "vase.png"
MODULES = WEB / "node_modules"
FOV_DEG = 24.0
"""Of the vase's photo."""
TABLE_LONG_FOV_DEG = 42.0
"""Of the examples' photo, 32.13 vertically."""
ISOLATED = {"Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp"}
"""Without them the networks run on one thread."""
pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def packed(chromium, tmp_path_factory) -> Path:
    """What `npm pack` makes."""
    if not (MODULES / "onnxruntime-web").is_dir():
        pytest.skip("needs the packages of web/ (cd web && npm ci)")
    return pack(WEB, tmp_path_factory.mktemp("packed"))


@pytest.fixture(scope="module")
def plain_site(packed, tmp_path_factory) -> Path:
    """The example of three.js beside node_modules, nothing built."""
    folder = tmp_path_factory.mktemp("plain")
    (folder / "node_modules").mkdir()
    safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # since 3.11.4
    with tarfile.open(packed) as archive:
        archive.extractall(folder, **safely)
    (folder / "package").rename(folder / "node_modules" / "anyprobe")
    for name in ("three", "onnxruntime-web"):
        (folder / "node_modules" / name).symlink_to(MODULES / name)
    for path in (*(EXAMPLES / "three").glob("*.*"), *(EXAMPLES / "public").iterdir(), VASE):
        if path.is_file():
            shutil.copy(path, folder)
    return folder


@pytest.fixture(scope="module")
def built(packed, tmp_path_factory):
    """An example's folder, built by `npx vite build` with the packed package in the place of the clone's."""

    @lru_cache
    def build(name: str, source: str | None = None) -> Path:
        return build_example(name, packed, tmp_path_factory.mktemp(name), source)

    return build


def without_the_swap() -> str:
    """The example of WebXR with three.js's own XREstimatedLight: the README's diff, reversed."""
    lines = (EXAMPLES / "webxr" / "main.js").read_text().splitlines()
    diff = re.search(r"```diff\n(.*?)```", (WEB / "README.md").read_text(), re.DOTALL)[1]
    for hunk in diff.split("...\n"):
        removed, added = ([line[1:] for line in hunk.splitlines() if line.startswith(sign)] for sign in "-+")
        length = len(added)
        places = [i for i in range(len(lines)) if _tokens(lines[i : i + length]) == _tokens(added)]
        assert len(places) == 1, f"of webxr/main.js, not the README's lines: {added}"
        lines[places[0] : places[0] + length] = removed
    lines = [line for line in lines if "xrLight.mark(" not in line]  # three.js's own has no object to mark
    assert not re.search("anyprobe|ProbeLight", "\n".join(lines))
    return "\n".join(lines)


def _tokens(lines: list[str]) -> list[str]:
    """Lines whatever their quotes and spaces."""
    return ["".join(line.split()).replace("'", '"') for line in lines]


def look(site: Path, page: str, **options) -> dict:
    """What tests/browser/package_example.mjs sees, served with and cross-origin isolated."""
    arguments = {"page": page} | options.pop("arguments", {})
    with serve({"/": site}, headers=ISOLATED) as url:
        return run_steps("package_example.mjs", url, arguments, **options)


def pixels(drawn: dict) -> np.ndarray:
    """[H, W, 4] in [0, 1]."""
    shape = (drawn["height"], drawn["width"], 4)
    return np.frombuffer(base64.b64decode(drawn["rgba"]), np.uint8).reshape(shape) / 255


def assert_drawn(seen: dict, estimator) -> None:
    """The light of the photo, and three spheres on its table: lit from the left, shadows to their right."""
    assert seen["failed"] == []
    photo, mask = EXAMPLES / "public" / "table.jpg", EXAMPLES / "public" / "table-mask.png"
    direction = estimator(photo, mask=mask, fov_deg=TABLE_LONG_FOV_DEG).dominant_light().direction
    assert np.dot(seen["direction"], direction) > np.cos(np.radians(1))
    drawn = pixels(seen["drawn"])[..., :3]
    with Image.open(photo) as image:
        change = (drawn - np.asarray(image) / 255).mean(axis=-1)
    assert np.abs(change[:200]).mean() < 0.01  # the photo stays what it is
    assert change[360:380, 290:310].mean() > 0.1  # a white sphere on the wood, on its bright side
    assert change[400:420, 385:410].mean() < -0.08  # its shadow
    assert np.abs(change[270:300, 285:300]).mean() < 0.02  # the vase before the sphere that stands behind it


def assert_spheres(drawn: dict, estimator) -> None:
    """Three spheres, 9 away and two units wide, in a view 18 degrees high, under Python's own estimate."""
    radiance = estimator(VASE, fov_deg=FOV_DEG).radiance
    page, width, height = pixels(drawn), drawn["width"], drawn["height"]
    long_fov_deg = 2 * np.degrees(np.arctan(np.tan(np.radians(9)) * width / height))
    for index, material in enumerate(SPHERES):
        foot = [2.4 * (index - 1), -1.0, -9.0]
        pose = {"foot": foot, "up": [0, 1, 0], "scale": 2, "longFovDeg": long_fov_deg}
        package = drawn_by_package(width, height, pose, radiance, material)
        both = (page[..., 3] == 1) & (package[..., 3] == 1)
        assert both.sum() > 0.9 * (package[..., 3] > 0.5).sum() > 500
        off = typical_difference(page, package)
        assert off <= MOST_OFF, f"{material}: {off:.4f} of white"


def test_package_has_the_numbers_that_a_clone_imports(plain_site):
    text = (plain_site / "node_modules" / "anyprobe" / "src" / "core" / "contract.js").read_text()
    _, _, written = text.partition("export const CONTRACT = ")
    shared = json.loads((ROOT / "src" / "anyprobe" / "contract.json").read_text())
    assert json.loads(written.rstrip().removesuffix(";")) == shared
    assert "contract.json" in (WEB / "src" / "core" / "contract.js").read_text()  # packing leaves the clone as it was


def test_package_holds_what_its_readme_says_and_no_more(plain_site):
    package = plain_site / "node_modules" / "anyprobe"
    assert {path.name for path in package.iterdir()} == {
        "LICENSE",
        "README.md",
        "dist",
        "examples",
        "package.json",
        "pictures",
        "src",
        "types",
        "weights",
    }
    assert {path.name for path in (package / "examples").iterdir()} == {"babylon", "fiber", "public", "three", "webxr"}
    assert sum(path.stat().st_size for path in package.rglob("*") if path.is_file()) < 16 * 2**20


def test_plain_page_with_an_import_map_draws_the_example(plain_site, estimator):
    assert_drawn(look(plain_site, "index.html"), estimator)


def test_spheres_in_three_js_are_pythons(plain_site, estimator):
    (plain_site / "spheres.html").write_text((plain_site / "index.html").read_text().replace("main.js", "spheres.js"))
    shutil.copy(ROOT / "tests" / "browser" / "spheres.js", plain_site)
    seen = look(plain_site, "spheres.html")
    assert seen["failed"] == []
    assert_spheres(seen["drawn"], estimator)


def test_weights_that_are_not_those_of_the_package_are_refused(plain_site, tmp_path):
    site = tmp_path / "site"
    shutil.copytree(plain_site, site, symlinks=True)
    weights = site / "node_modules" / "anyprobe" / "weights" / "light.onnx"
    weights.write_bytes(weights.read_bytes()[:-1] + b"?")
    with serve({"/": site}, headers=ISOLATED) as url:
        seen = run_steps("package_refused.mjs", url, {"page": "index.html"}, complaints_allowed=True)
    assert re.search("light.onnx could not be fetched from .*its hash is not sha384-", seen)


def test_where_threads_cannot_start_one_gives_the_light(plain_site, estimator):
    with serve({"/": plain_site}, headers=ISOLATED) as url:
        seen = run_steps("package_threads.mjs", url, {"page": "index.html"})
    assert (seen["isolated"], seen["threads"]) == (True, 1)
    assert [line for line in seen["said"] if "threads could not start" in line]
    expected = estimator(VASE, fov_deg=FOV_DEG).sh9().ravel()
    assert np.linalg.norm(np.subtract(seen["sh9"], expected)) < 1e-3 * np.linalg.norm(expected)


def test_every_kind_of_picture_gives_one_light_and_faults_are_named(plain_site, estimator):
    with serve({"/": plain_site}) as url:  # not isolated: one thread
        seen = run_steps("package_sources.mjs", url, {"page": "index.html"}, complaints_allowed=True)
    expected = estimator(VASE, fov_deg=FOV_DEG).sh9().ravel()
    assert {"url", "blob", "file", "unloaded"} <= set(seen["sh9"])
    for name, sh9 in seen["sh9"].items():
        assert np.linalg.norm(np.subtract(sh9, expected)) < 0.06 * np.linalg.norm(expected), name
    assert seen["covered"] == pytest.approx(0.137, abs=0.02)
    assert seen["quality"] > 0.8
    assert seen["mask"] == {"width": 512, "height": 512, "length": 512 * 512}
    refused = seen["refused"]
    for name, (code, line) in EXPECTED_FAULTS.items():
        assert refused[name]["name"] == "AnyProbeError", name
        assert refused[name]["code"] == code, name
        assert re.search(line, refused[name]["message"]), (name, refused[name])
    assert refused["aborted"]["name"] == "AbortError"
    assert refused["aborted early"]["name"] == "AbortError"


def test_a_mirror_ball_is_unwrapped_as_python_does(plain_site, estimator):
    picture, mask = ball_photo(rich_map(), "mirror")
    Image.fromarray(picture).save(plain_site / "ball.png")
    Image.fromarray(np.round(255 * mask).astype(np.uint8)).save(plain_site / "ball_mask.png")
    fov_deg = np.degrees(2 * np.arctan(np.tan(np.radians(FOV) / 2) * 240 / 320))  # vertically
    with serve({"/": plain_site}) as url:  # not isolated: one thread
        found, given = run_steps("package_ball.mjs", url, {"page": "index.html", "fovDeg": fov_deg})
    assert "mirror-ball" in found["codes"]
    assert "mirror-ball" not in given["codes"]
    expected = estimator(picture, mask=mask, fov_deg=FOV).sh9().ravel()
    assert np.linalg.norm(np.subtract(found["sh9"], expected)) < 0.01 * np.linalg.norm(expected)


def test_every_source_of_frames_is_followed_and_a_second_session_too(plain_site, estimator):
    with serve({"/": plain_site}) as url:  # not isolated: one thread
        seen = run_steps("package_track.mjs", url, {"page": "index.html"})
    lights = {name: np.array(light["direction"]) for name, light in seen["lights"].items()}
    expected = estimator(VASE, fov_deg=FOV_DEG).dominant_light().direction
    aside = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    for name, direction in lights.items():
        is_posed = name in ("posed", "texture")
        assert seen["lights"][name]["isInWorld"] == is_posed, name
        wanted = aside @ expected if is_posed else expected
        assert direction @ wanted > np.cos(np.radians(15)), name  # masks are found in ways of their own
    assert seen["events"] == ["estimationstart", "estimationend"] * 2


EXPECTED_FAULTS = {
    "nothing": ("invalid-image", "^image: expected an address.*, got null$"),
    "empty": ("invalid-image", "^image: expected a picture with pixels, got an image without an address"),
    "absent": ("fetch-failed", r"absent\.png could not be fetched \(answer 404\)"),
    "text": ("invalid-image", "^image: expected a file that the browser can show, got text/plain of 3 bytes"),
    "pixels": ("invalid-image", "^image: expected 4 bytes a pixel of 2 x 2, got 3"),
    "mask": ("invalid-option", "^mask: expected 512 x 512 numbers, got 9"),
    "mask of bytes": ("invalid-option", "^mask: expected numbers from 0 to 1, got 255"),
    "mask of another aspect": ("invalid-option", "^mask: expected the picture's aspect, 512 x 512, got 10 x 20"),
    "no object": ("no-object", "expected an object, got no value above 0.5"),
    "normals": ("invalid-option", "^normals: expected 512 x 512 x 3 numbers, got 9"),
    "click": ("invalid-option", "^click: expected points in the picture, 512 x 512 pixels"),
    "point": ("invalid-option", r"^click: expected \[x, y\] in pixels"),
    "fov": ("invalid-option", "^fovDeg: expected degrees between 1 and 170.* got 190"),
    "unknown": ("invalid-option", "^estimate: unknown option fov; expected of click,"),
    "material": ("invalid-option", "^material: expected one of "),
    "weights": ("fetch-failed", r"absent\.onnx could not be fetched from .*absent\.onnx \(answer 404\)"),
    "runtime": ("fetch-failed", "the runtime could not be fetched|could not be fetched"),
    "disposed": ("disposed", "disposed"),
    "after": ("disposed", "disposed"),
    "track after": ("disposed", "disposed"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["three", "fiber", "babylon"])
def test_example_draws_spheres_with_their_shadows_behind_the_vase(built, estimator, name):
    assert_drawn(look(built(name), "index.html", timeout_s=400), estimator)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["webxr", "estimated"])
def test_probe_light_stands_in_for_the_estimate_of_a_session(built, estimator, tmp_path, name):
    """In the emulator IWER, to whose views a camera with the vase's picture is added."""
    site = built("webxr", None if name == "webxr" else without_the_swap())
    shutil.copy(VASE, site)
    folders = {"/": site, "/iwer/": ROOT / "tests" / "browser" / "node_modules" / "iwer" / "build"}
    with serve(folders, headers=ISOLATED) as url:
        arguments = {"page": "index.html", "estimates": name == "estimated"}
        seen = run_steps("package_webxr.mjs", url, arguments, viewport=(320, 240))
    assert seen["mode"] == "immersive-ar"
    assert ("camera-access" in seen["features"]) == (name == "webxr")
    assert not seen["hasAskedForACamera"]
    default = "HemisphereLight"
    assert seen["events"] == [
        f"add {default}",
        "add estimate",
        f"remove {default}",
        f"add {default}",
        "remove estimate",
    ]
    first, second = (np.reshape(seen[state]["sh"], (9, 3)) for state in ("lit", "later"))
    assert np.abs(first).max(axis=1).min() > 0
    assert np.abs(second - first).max(axis=1).min() > 0
    assert seen["lit"]["reflects"]
    assert not seen["ended"]["reflects"]
    assert seen["moved"] == pytest.approx([1, 0, -2])
    lit, ended = (pixels(seen[state]["drawn"]) for state in ("lit", "ended"))
    assert all(one[..., :3].max() > 0.2 for one in (lit, ended)), "a blank canvas"
    assert np.abs(lit - ended)[..., :3].mean() > 0.002  # the default light is back
    position = np.array(seen["lit"]["position"])
    if name == "estimated":
        assert seen["lit"]["intensity"] == 3
        assert position == pytest.approx([0.6, 0.8, 0])
        return
    assert seen["lit"]["intensity"] > 0
    assert max(seen["lit"]["color"]) == pytest.approx(1)
    with Image.open(VASE) as image:
        grey = Image.new("RGBA", image.size, "#888")
        frame = np.asarray(Image.alpha_composite(grey, image.convert("RGBA")).convert("RGB"))
    direction = estimator(frame, click=(256, 280), fov_deg=seen["fovDeg"]).dominant_light().direction
    world = np.reshape(seen["worldFromCamera"], (4, 4)).T[:3, :3] @ direction
    assert np.dot(position / np.linalg.norm(position), world) > np.cos(np.radians(15))


@pytest.mark.parametrize("name", ["three", "fiber", "babylon", "webxr"])
def test_examples_are_short(name):
    (program,) = (EXAMPLES / name).glob("main.*")
    assert len(program.read_text().splitlines()) <= 80


def test_readme_calls_what_the_example_of_three_js_calls():
    blocks = re.findall(r"```js\n(.*?)```", (WEB / "README.md").read_text(), re.DOTALL)
    (scene,) = (block for block in blocks if "new PhotoGround(" in block)
    called = re.findall(r"([\w.]+)\(", re.sub(r"//.*", "", scene))
    program = (EXAMPLES / "three" / "main.js").read_text()
    assert len(called) > 6
    assert [one for one in called if f"{one}(" not in program] == []
