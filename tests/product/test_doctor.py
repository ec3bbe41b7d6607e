"""anyprobe doctor: what it prints, and that its self-test can fail."""

from __future__ import annotations

import importlib.metadata
import re

import numpy as np
import onnxruntime
import pytest

import anyprobe
from anyprobe.cli import doctor
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.runtime import file_hashes
from anyprobe.inputs.settings import DEFAULT_MODEL


def test_doctor_prints_versions_providers_and_hashes(command, monkeypatch):
    monkeypatch.setattr(doctor, "self_test", lambda model: (0.123, 4.0))
    outcome = command("doctor")
    assert (outcome.status, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert lines[0].startswith("python 3.")
    assert f"anyprobe {anyprobe.__version__}" in lines
    (packages,) = (line.lower() for line in lines if line.startswith("packages: "))
    for package in ("numpy", "onnxruntime", "Pillow"):
        assert f"{package} {importlib.metadata.version(package)}".lower() in packages
    (providers,) = (line for line in lines if line.startswith("providers "))
    for provider in onnxruntime.get_available_providers():
        assert (provider in providers) == (provider != "AzureExecutionProvider")  # which asks a server
    for stage, digest in file_hashes(DEFAULT_MODEL).items():
        assert f"model {DEFAULT_MODEL}/{stage} sha256 {digest}" in lines
    assert lines[-2:] == ["self-test: dominant light 4 degrees off, 123 ms a photo", "OK"]


def test_failed_self_test_is_one_line_and_status_2(command, monkeypatch):
    monkeypatch.setattr(doctor, "self_test", lambda model: (0.1, 90.0))
    outcome = command("doctor")
    assert outcome.status == 2
    assert outcome.err.startswith("anyprobe: self-test: expected the dominant light within")
    assert outcome.err.count("\n") == 1
    assert "sha256" in outcome.out
    assert "OK" not in outcome.out.splitlines()


@pytest.mark.parametrize(
    ("found", "expected"), [((-0.6, 0.6, 0.53), 0), ((0.6, 0.6, 0.53), 73.8), ((0.6, -0.6, -0.53), 180)]
)
def test_self_test_measures_the_angle(monkeypatch, estimator, found, expected):
    """A model that always sees one emitter is as wrong as that emitter is far from the drawn one."""
    inside = pixel_directions(64) @ np.asarray(found) > 0.966 * np.linalg.norm(found)
    light = anyprobe.Light(radiance=np.where(inside[..., None], np.full(3, 9.0, np.float32), np.float32(0.12)))
    monkeypatch.setattr(doctor, "Estimator", lambda model: lambda photo: light)
    assert doctor.self_test("paper")[1] == pytest.approx(expected, abs=2)


@pytest.mark.ci
def test_self_test_passes_with_the_bundled_model(command):
    """The one test here that needs trained weights: an emitter at the upper left, found within 45 degrees."""
    outcome = command("doctor")
    tested, last = outcome.out.splitlines()[-2:]
    match = re.fullmatch(r"self-test: dominant light (\d+) degrees off, (\d+) ms a photo", tested)
    assert match, tested
    assert last == "OK"
    assert int(match[1]) <= 45
    assert int(match[2]) < 5000
    assert (outcome.status, outcome.err) == (0, "")
