"""The page's spheres are those of the package's renderer under the same light, pixel by pixel."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import run_steps
from support.camera import camera_flags, write_y4m

from anyprobe.core.frames import normalize
from anyprobe.core.response import response
from anyprobe.files.objects import open_object
from anyprobe.relight.compose import window_around
from anyprobe.relight.ground import Placement, View
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.scatter.presets import MATERIALS

VASE = Path(__file__).parents[2] / "examples" / "vase.png"
SPHERES = ("chrome", "gold", "matte")
MIDDLE = [0.5, 0.55]
"""Of the camera's picture: on the vase."""
MOST_OFF = 0.03
"""Of white."""


def drawn_by_package(width: int, height: int, pose: dict, radiance: np.ndarray, material: str) -> np.ndarray:
    """[height, width, 4] display values and coverage of the sphere that the page says it drew."""
    ball = open_object("ball")
    foot, up = np.array(pose["foot"]), normalize(np.array(pose["up"]))
    radius = pose["scale"] / 2
    outwards = normalize(ball.positions - ball.positions.mean(axis=0))
    mesh = Mesh(positions=foot + radius * (up + outwards), faces=ball.faces, normals=ball.normals)
    focal = max(width, height) / 2 / np.tan(np.radians(pose["longFovDeg"]) / 2)
    view = View(width=width, height=height, focal=focal, up=up)
    window = window_around(Placement(mesh=mesh, foot=foot, radius=radius, pitch_deg=0.0), view)
    drawn = draw_mesh(mesh, window.camera, radiance, MATERIALS[material])
    picture = np.zeros((height, width, 4), np.float32)
    rows, columns = np.mgrid[0 : window.size, 0 : window.size]
    y, x = rows + window.top, columns + window.left
    inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
    picture[y[inside], x[inside], :3] = response(drawn[inside][:, :3])
    picture[y[inside], x[inside], 3] = drawn[inside][:, 3]
    return picture


@pytest.fixture(scope="module")
def seen(page_url, tmp_path_factory) -> dict[str, dict]:
    """The page's pictures of the example, of a photo and of the camera's."""
    folder = tmp_path_factory.mktemp("pixels")
    example = open_example()
    video = write_y4m(
        folder / "camera.y4m", [np.pad(example[..., :3], ((0, 0), (80, 80), (0, 0)), mode="edge")]
    )
    photo = folder / "photo.png"
    Image.fromarray(np.ascontiguousarray(example[:420, 120:])).save(photo)
    given = {"photo": str(photo), "click": MIDDLE, "materials": SPHERES}
    return run_steps("page_pixels.mjs", page_url, given, flags=camera_flags(video), viewport=(1280, 900))


def open_example() -> np.ndarray:
    """[H, W, 4] uint8."""
    with Image.open(VASE) as image:
        return np.asarray(image.convert("RGBA"))


@pytest.mark.parametrize("source", ["example", "photo", "camera"])
@pytest.mark.parametrize("material", SPHERES)
def test_sphere_is_shown_through_the_curve_of_the_camera(seen, source, material):
    one = seen[source][material]
    shape = (one["height"], one["width"], 4)
    page = np.frombuffer(base64.b64decode(one["rgba"]), np.uint8).reshape(shape) / 255
    radiance = np.frombuffer(base64.b64decode(one["radiance"]), "<f4").reshape(64, 128, 3)
    package = drawn_by_package(one["width"], one["height"], one["pose"], radiance, material)
    both = (page[..., 3] == 1) & (package[..., 3] == 1)
    either = (page[..., 3] == 1) | (package[..., 3] > 0.5)
    assert both.sum() > 0.9 * either.sum() > 500
    off = np.abs(page[both] - package[both])[:, :3].mean()
    assert off <= MOST_OFF, f"{source} {material}: {off:.4f} of white"
