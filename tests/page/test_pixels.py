"""The page's spheres are those of the package's renderer under the same light, pixel by pixel."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import run_steps
from support.camera import camera_flags, write_y4m
from support.page_spheres import MOST_OFF, SPHERES, drawn_by_package, typical_difference

VASE = Path(__file__).parents[2] / "examples" / "vase.png"
MIDDLE = [0.5, 0.55]
"""Of the camera's picture: on the vase."""
pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def seen(page_url, tmp_path_factory) -> dict[str, dict]:
    """The page's pictures of the example, of a photo and of the camera's."""
    folder = tmp_path_factory.mktemp("pixels")
    example = open_example()
    video = write_y4m(folder / "camera.y4m", [np.pad(example[..., :3], ((0, 0), (80, 80), (0, 0)), mode="edge")])
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
    off = typical_difference(page, package)
    assert off <= MOST_OFF, f"{source} {material}: {off:.4f} of white"
