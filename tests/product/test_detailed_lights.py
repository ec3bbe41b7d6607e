"""Detail where users meet it: in a Light, an Estimator and the command."""

from __future__ import annotations

import inspect
import json
import re

import numpy as np
import pytest
from PIL import Image
from support.places import place
from support.refused import refused
from support.scenes import sphere_photo

import anyprobe
from anyprobe.core.response import response
from anyprobe.estimate import estimator
from anyprobe.estimate.runtime import Models
from anyprobe.estimate.sidecar import Origin
from anyprobe.files.graphs import CPU
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.maps.radiance import map_attributes, read_radiance, write_exr


@pytest.fixture
def estimate():
    return np.maximum(blur_cosine_power(reduced(place(3), 64), 30.0), 0.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for seed in range(2):
        write_exr(tmp_path / "maps" / f"place-{seed}.exr", place(seed, 64))
    return tmp_path / "maps"


def test_a_light_with_detail_says_so_and_keeps_what_was_measured(estimate, folder, tmp_path):
    light = anyprobe.Light(radiance=estimate, confidence=np.full((64, 128), 0.4, np.float32), origin=Origin(model="m"))
    detailed = light.with_detail(library=folder, size=128, seed=1)
    assert detailed.radiance.shape == (128, 256, 3)
    np.testing.assert_array_equal(detailed.confidence, light.confidence)
    np.testing.assert_allclose(detailed.sh9(), light.sh9(), atol=2e-3 * np.abs(light.sh9()).max())
    said = detailed.sidecar()["detail"]
    assert said["kind"] == "plausible"
    assert said["from"].startswith("place-")
    assert said["seed"] == 1
    header = map_attributes(detailed.save(tmp_path / "light.exr"))
    assert header["detail"] == f"plausible, from {said['from']}, seed 1"
    detailed.save(tmp_path / "light.json")
    assert anyprobe.Light.load(tmp_path / "light.exr").info["detail"] == said
    exported = detailed.export("three", tmp_path)
    (sidecar,) = [path for path in exported if path.suffix == ".json"]
    assert json.loads(sidecar.read_text())["origin"]["detail"] == said
    assert "detail" not in light.sidecar()
    with refused("detail"):
        detailed.with_detail(library=folder)


@pytest.mark.ci
def test_an_estimator_gives_detail_where_it_is_asked_for(folder):
    photo = sphere_photo()
    plain = anyprobe.Estimator(threads=1)(photo)
    fine = anyprobe.Estimator(threads=1, detail="plausible", size=64, detail_library=folder)(photo)
    assert "detail" not in plain.info
    assert fine.info["detail"]["kind"] == "plausible"
    assert fine.info["seconds"]["detail"] > 0
    np.testing.assert_allclose(fine.sh9(), plain.sh9(), atol=5e-3 * np.abs(plain.sh9()).max())
    assert response(fine.radiance).std() != response(plain.radiance).std()
    with refused("detail"):
        anyprobe.Estimator(detail="sharp")


@pytest.mark.ci
def test_the_function_takes_what_an_estimator_takes(folder):
    """Each of Estimator's settings, on networks that are opened once."""
    photo, mask = sphere_photo()[..., :3], sphere_photo()[..., 3]

    class Given:
        needs_prompt = False

        def segment(self, rgb, on, off, box):
            return mask / np.float32(255)

    light = anyprobe.estimate(photo, segmenter=Given(), detail="plausible", size=64, detail_library=folder)
    assert light.info["detail"]["from"].startswith("place-")
    assert light.radiance.shape == (64, 128, 3)
    plain = anyprobe.estimate(photo, mask=mask)
    assert "detail" not in plain.info
    np.testing.assert_allclose(plain.sh9(), light.sh9(), atol=5e-3 * np.abs(plain.sh9()).max())


def test_the_function_takes_and_explains_every_argument():
    """`help` of estimate, and of the Hints and Settings that it names."""
    taken = {k: one for k, one in inspect.signature(anyprobe.estimate).parameters.items() if k != "unknown"}
    for other in (anyprobe.Estimator, anyprobe.Estimator.__call__):
        given = {
            k: one for k, one in inspect.signature(other).parameters.items() if k not in ("self", "settings", "unknown")
        }
        assert {name: one.default for name, one in given.items()} == {name: taken[name].default for name in given}
    text = "\n".join(inspect.getdoc(one) for one in (anyprobe.estimate, anyprobe.Hints, anyprobe.Settings))
    assert [name for name in taken if not re.search(rf"\b{name}(, \w+)*: \S", text)] == []


@pytest.mark.ci
def test_networks_are_opened_anew_for_another_engine_or_other_threads(monkeypatch):
    opened = []

    def open_networks(*settings):
        opened.append(settings)
        return Models(*settings)

    monkeypatch.setattr(estimator, "Models", open_networks)
    estimator._shared.cache_clear()
    picture = sphere_photo()
    for settings in ({"threads": 1}, {"threads": 1, "emitters": "expected"}, {"threads": 2}, {"threads": 1}):
        anyprobe.estimate(picture, **settings)
    with refused("providers"):
        anyprobe.estimate(picture, threads=1, providers="onyx")
    estimator._shared.cache_clear()
    assert [given[:3] for given in opened] == [("lift", 1, CPU), ("lift", 2, CPU), ("lift", 1, ("onyx",))]


def test_a_size_that_no_map_has_is_refused_without_detail_too():
    for make in (anyprobe.Estimator, lambda size: anyprobe.estimate(sphere_photo(), size=size)):
        with refused("size"):
            make(size=100)


def test_what_a_model_does_not_estimate_is_none():
    light = anyprobe.estimate(sphere_photo(), model="paper")
    assert (light.info["object"], light.info["uncertainty"]) == (None, None)


def test_the_command_writes_a_map_with_detail(folder, tmp_path, command):
    Image.fromarray(sphere_photo()).save(tmp_path / "sphere.png")
    out = tmp_path / "out"
    options = ["--detail", "plausible", "--size", "128", "--detail-library", str(folder), "-q"]
    assert command("estimate", tmp_path / "sphere.png", "-o", out, *options).status == 0
    assert read_radiance(out / "sphere.exr").shape == (128, 256, 3)
    said = json.loads((out / "sphere.json").read_text())
    assert said["detail"]["kind"] == "plausible"
    assert said["size"] == [256, 128]


def test_the_command_says_once_what_a_library_lacks(folder, tmp_path, monkeypatch, command):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    (folder / "broken.hdr").write_bytes(b"no picture")
    photos = [tmp_path / "one.png", tmp_path / "two.png"]
    for photo in photos:
        Image.fromarray(sphere_photo()).save(photo)
    options = ["--detail", "plausible", "--size", "64", "--detail-library", str(folder), "-o", str(tmp_path / "out")]
    done = command("estimate", *photos, *options)
    assert done.status == 0
    for photo in photos:
        said = json.loads((tmp_path / "out" / f"{photo.stem}.json").read_text())["warnings"]
        assert any(line.startswith("left out: broken.hdr: expected a Radiance .hdr file") for line in said)
        assert any("XDG_CACHE_HOME" in line for line in said)
    assert (done.err.count("left out: broken.hdr"), done.err.count("XDG_CACHE_HOME")) == (1, 1)


@pytest.mark.ci
def test_an_inserted_objects_detail_says_what_its_library_lacks(folder, tmp_path, command):
    (folder / "broken.hdr").write_bytes(b"no picture")
    Image.fromarray(sphere_photo()).save(tmp_path / "one.png")
    options = ["--detail", "plausible", "--detail-library", str(folder), "-o", str(tmp_path / "out.png")]
    done = command("relight", tmp_path / "one.png", "--insert", "sphere", "--renderer", "own", *options)
    assert done.status == 0
    assert done.err.count("left out: broken.hdr") == 1


def test_a_panorama_lends_its_own_pixels_to_a_map_with_detail(folder):
    """Not those of the 64 rows that an estimate has: a checkerboard of one pixel in 256 rows."""
    checks = np.indices((256, 512)).sum(axis=0) % 2
    panorama = np.zeros((256, 512, 4), np.uint8)
    panorama[60:200, 100:400, :3] = np.where(checks, 200, 40)[60:200, 100:400, None]
    panorama[60:200, 100:400, 3] = 255
    estimator = anyprobe.Estimator(threads=1, detail="plausible", detail_library=folder, size=256)
    light = estimator(sphere_photo(), surroundings=panorama)
    shown = response(light.radiance)[65:195, 105:395]
    np.testing.assert_allclose(
        shown, np.where(checks, 200 / 255, 40 / 255)[65:195, 105:395, None].repeat(3, -1), atol=0.01
    )
