"""Several photos in one request: the light of all, and what is refused."""

from __future__ import annotations

import asyncio
import base64

import numpy as np
import pytest
from support.transforms import transforms

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.core.frames import rotation_y
from anyprobe.errors import InputError
from anyprobe.estimate.multiview import fuse_lights
from anyprobe.estimate.poses import parse_poses
from anyprobe.given_material import given_material
from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import create_app
from anyprobe.serve.limits import MAX_PHOTOS, Limits

LIMITS = Limits(max_bytes=400_000, max_pixels=20_000, workers=1, waiting=1)
TURNS = [np.eye(3), rotation_y(0.8)]


@pytest.fixture(scope="module")
def client(estimator):
    with TestClient(create_app(estimator, LIMITS), raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def pictures(photo_rgba) -> list[np.ndarray]:
    """The photo, and itself mirrored."""
    return [photo_rgba, np.ascontiguousarray(photo_rgba[:, ::-1])]


def parts(pictures, poses=TURNS, **others) -> list:
    files = [("photo", (f"{k}.png", as_png(one))) for k, one in enumerate(pictures)]
    files += [("poses", ("poses.json", transforms(poses).encode()))]
    return files + [(name, data) for name, many in others.items() for data in many]


def radiance(answer) -> np.ndarray:
    assert answer.status_code == 200, answer.text
    packed = answer.json()["radiance"]
    return np.frombuffer(base64.b64decode(packed["base64"]), "<f4").reshape(packed["shape"])


def test_the_light_is_the_package_s_own(client, estimator, pictures):
    answer = client.post("/v1/fuse?include=radiance", files=parts(pictures))
    expected = fuse_lights([estimator(one) for one in pictures], TURNS)
    np.testing.assert_array_equal(radiance(answer), expected.radiance)
    assert not np.allclose(expected.radiance, estimator(pictures[0]).radiance, rtol=0.01)
    exr = client.post("/v1/fuse?format=exr", files=parts(pictures))
    assert exr.headers["content-type"] == "image/x-exr"


def test_the_lens_of_the_poses_counts_unless_another_is_told(client, pictures):
    files = [part for part in parts(pictures) if part[0] != "poses"]
    data = {"poses": transforms(TURNS, camera_angle_x=np.radians(50))}
    height, width = pictures[0].shape[:2]
    long = 2 * np.degrees(np.arctan(np.tan(np.radians(25)) * max(1.0, height / width)))
    assert client.post("/v1/fuse", files=files, data=data).json()["long_fov_deg"] == pytest.approx(long, abs=1e-3)
    given = client.post("/v1/fuse", files=files, data=data | {"fov": "40"})
    assert given.json()["long_fov_deg"] == 40


@pytest.mark.ci
def test_masks_boxes_and_what_is_known_reach_every_photo(client, estimator, pictures, photo_mask):
    rgb = [one[..., :3] for one in pictures]
    masks = [photo_mask, photo_mask * (np.arange(photo_mask.shape[1]) < 64).astype(np.uint8)]
    files = parts(rgb, mask=[as_png(one) for one in masks])
    asked = {"material": "matte", "albedo": "0.5", "roughness": "0.4", "emitters": "expected", "include": "radiance"}
    asked["surroundings"] = "none"  # what one photo shows would reach the others
    matte = given_material("matte", (0.5,), 0.4)
    spread = estimator.with_settings(emitters="expected")
    lights = [spread(one, mask=mask, material=matte, surroundings="none") for one, mask in zip(rgb, masks, strict=True)]
    answer = client.post("/v1/fuse", files=files, data=asked)
    np.testing.assert_array_equal(radiance(answer), fuse_lights(lights, TURNS).radiance)
    boxes = ["20,10,100,90", "20,10,70,90"]
    lights = [
        estimator(one, box=tuple(map(float, box.split(","))), surroundings="none")
        for one, box in zip(rgb, boxes, strict=True)
    ]
    asked = {"box": boxes, "include": "radiance", "surroundings": "none"}
    answer = client.post("/v1/fuse", files=parts(rgb), data=asked)
    np.testing.assert_array_equal(radiance(answer), fuse_lights(lights, TURNS).radiance)


def test_poses_are_read_beside_the_event_loop(client, pictures, monkeypatch):
    """Many of them take a while, in which others want an answer."""

    loops = []

    def parse(*arguments):
        try:
            loops.append(asyncio.get_running_loop())
        except RuntimeError:  # none in this thread
            raise InputError("seen in a thread") from None
        return parse_poses(*arguments)

    monkeypatch.setattr("anyprobe.serve.uploads.parse_poses", parse)
    answer = client.post("/v1/fuse", files=parts(pictures))
    assert not loops
    assert (answer.status_code, answer.json()["detail"]) == (422, "poses: seen in a thread")


@pytest.mark.parametrize(
    ("change", "data", "word"),
    [
        (lambda files: [], {}, f"photo: expected 1 to {MAX_PHOTOS} file parts"),
        (lambda files: files[:1] * (MAX_PHOTOS + 1), {}, f"got {MAX_PHOTOS + 1}"),
        (lambda files: files[:2], {}, "poses: expected"),
        (lambda files: files[:2], {"poses": "{}"}, "poses: expected"),
        (lambda files: files[:2], {"poses": transforms([np.eye(3)])}, "poses: expected a pose of 1.png"),
        (lambda files: [*files, ("mask", files[0][1])], {}, "mask: expected none or one per photo, got 1 for 2"),
        (lambda files: files, {"box": "1,2,3,4"}, "box: expected none or one per photo, got 1 for 2"),
        (lambda files: files, {"click": "1,2"}, "click: expected a mask or a box per photo"),
        (lambda files: [*files, ("normals", files[0][1])], {}, "normals: expected a mask or a box per photo"),
        (lambda files: files, {"albedo": "grey"}, "albedo: expected a number or R,G,B"),
        (lambda files: files, {"photo": "x"}, "photo: expected a file, got text"),
    ],
)
def test_what_cannot_be_used_is_named_in_one_line(client, pictures, change, data, word):
    answer = client.post("/v1/fuse", files=change(parts(pictures)) or None, data=data)
    assert answer.status_code == 422, answer.text
    line = answer.json()["detail"]
    assert word in line
    assert "\n" not in line
    if word.startswith("poses: "):
        assert answer.json()["subject"] == ["poses"]
        assert line.count("poses: ") == 1


def test_too_many_pixels_are_refused_in_every_photo(client, pictures):
    large = np.zeros((200, 200, 4), np.uint8)
    assert client.post("/v1/fuse", files=parts([pictures[0], large])).status_code == 413
