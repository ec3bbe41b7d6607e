"""Path tracing by Mitsuba: as our renderer draws where nothing shadows; where it cannot run, that is found out once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.refused import refused
from support.scenes import made_map

import anyprobe
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import MATERIALS, Material
from research import path_traced


@pytest.fixture
def tries(monkeypatch):
    """The processes that were started to try Mitsuba, all in vain."""
    started = []

    def run(command, **_):
        started.append(command)
        return SimpleNamespace(returncode=1)

    cached = path_traced.open_mitsuba, path_traced.mitsuba_runs
    for one in cached:
        one.cache_clear()
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(path_traced, "glob", lambda _: [])
    monkeypatch.setattr(path_traced.subprocess, "run", run)
    yield started
    for one in cached:
        one.cache_clear()


def test_mitsuba_that_is_absent_is_tried_once(tries):
    for _ in range(2):
        with refused(code="unsupported", naming="mitsuba"):
            path_traced.open_mitsuba()
    assert len(tries) == 1


def test_an_llvm_that_is_too_old_is_not_tried(tries, monkeypatch):
    """A trial of one line passes with it; the first scene ends the process."""
    monkeypatch.setattr(path_traced, "glob", lambda _: ["/usr/lib/x86_64-linux-gnu/libLLVM-15.so"])
    assert not path_traced.mitsuba_runs()
    assert tries == []


@pytest.fixture
def runs() -> None:
    try:
        path_traced.open_mitsuba()
    except anyprobe.MissingExtra as reason:
        pytest.skip(str(reason))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gold", "plastic", "matte"])
def test_paths_agree_with_our_shading_on_a_sphere(name, runs):
    """Nothing shadows a sphere: Mitsuba's picture is ours but for noise and the mean over a pixel."""
    mesh, light = sphere(48), made_map()
    material = replace(MATERIALS[name], alpha=max(MATERIALS[name].alpha, 0.35))  # even over a pixel
    camera = frame_object(mesh, np.eye(3), 30.0, size=24)
    ours = draw_mesh(mesh, camera, light, material, num_samples=512)
    theirs = path_traced.trace_mesh(mesh, camera, light, material, num_paths=1024)
    np.testing.assert_allclose(theirs[..., 3], ours[..., 3], atol=0.17)  # of 9 points and of 1024
    inside = (ours[..., 3] == 1) & (theirs[..., 3] == 1)
    difference = (ours - theirs)[inside][:, :3]
    mean = theirs[inside][:, :3].mean(axis=0)
    np.testing.assert_allclose(difference.mean(axis=0) / mean, 0, atol=0.01)
    # a metal's highlight differs over a pixel; with independent paths the others' error is .025
    assert np.sqrt(np.square(difference).mean()) < (0.03 if name == "gold" else 0.015) * mean.mean()


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [8, 32, 128])
def test_any_number_of_paths_is_traced_in_any_number_of_steps(at_once, monkeypatch, runs):
    """The sampler itself takes few counts."""
    mesh, white = sphere(16), Material(albedo=np.ones(3), f0=np.zeros(3), alpha=1.0)
    camera = frame_object(mesh, np.eye(3), 30.0, size=8)
    monkeypatch.setattr(path_traced, "PATHS_AT_ONCE", at_once * camera.size**2)
    drawn = path_traced.trace_mesh(mesh, camera, np.ones((8, 16, 3), np.float32), white, num_paths=100)
    np.testing.assert_allclose(drawn[2:6, 2:6].mean(axis=(0, 1)), 1.0, atol=0.03)


@pytest.mark.slow
def test_grain_has_no_streaks(monkeypatch, runs):
    """Errors of a pixel say nothing of those to its right, however many steps the paths are traced in."""
    mesh, light = sphere(24), made_map()
    camera = frame_object(mesh, np.eye(3), 30.0, size=64)
    many = path_traced.trace_mesh(mesh, camera, light, MATERIALS["matte"], num_paths=1024)
    monkeypatch.setattr(path_traced, "PATHS_AT_ONCE", 16 * camera.size**2)
    few = path_traced.trace_mesh(mesh, camera, light, MATERIALS["matte"])
    on = (few[..., 3] == 1) & (many[..., 3] == 1)
    error = np.where(on, (few - many)[..., 0] / np.maximum(many[..., 0], 1e-3), 0.0)
    together = [(error[:, k:] * error[:, :-k])[on[:, k:] & on[:, :-k]].mean() for k in (1, 2, 4)]
    assert np.mean(together) / np.square(error[on]).mean() < 0.1  # .2 of neighbours side by side
