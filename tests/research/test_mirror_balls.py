"""Mirror balls are drawn as the camera would see them, and their light is found."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from anyprobe.core.latlong import pixel_directions
from anyprobe.maps.radiance import write_exr
from research.real_photos.__main__ import app
from research.real_photos.balls import CLIPPED, balls_under

TOWARDS = np.array([0.36, 0.48, 0.8])


def test_what_is_clipped_is_the_limit(tmp_path):
    """A strong and small light beside a weak and wide one: once clipped, the wide one has more."""
    d = pixel_directions(64)
    weak = np.array([-0.6, 0.0, 0.8])
    lights = 60.0 * (d @ TOWARDS > 0.998)[..., None] + 6.0 * (d @ weak > 0.96)[..., None]
    write_exr(tmp_path / "two.exr", 0.1 + np.broadcast_to(lights, (64, 128, 3)))
    (ball,) = balls_under(tmp_path)
    between = np.degrees(np.arccos(TOWARDS @ weak))
    assert ball.clipped_deg == pytest.approx(between, abs=3)


@pytest.fixture
def maps(tmp_path):
    """One map of soft structure with an emitter; and an even one, which has no dominant light."""
    folder = tmp_path / "maps"
    folder.mkdir()
    d = pixel_directions(64)
    structure = 0.3 + 0.25 * np.sin(7.0 * d) * np.cos(5.0 * d[..., [1, 2, 0]])
    write_exr(folder / "lit.exr", structure + 60.0 * (d @ TOWARDS > 0.995)[..., None])
    write_exr(folder / "even.exr", np.ones((64, 128, 3)))
    return folder


def test_a_ball_is_clipped_where_its_light_is(maps):
    (ball,) = balls_under(maps)
    assert ball.name == "lit"
    on = ball.mask > 0
    white = (ball.photo.max(axis=-1) >= 0.97 * 255) & on
    assert white.sum() == pytest.approx(CLIPPED * on.sum(), rel=0.5)
    rows, columns = np.nonzero(on)
    y, x = np.argwhere(white).mean(axis=0) - (rows.mean(), columns.mean())
    side = np.array([x, -y]) / np.hypot(x, y)
    assert side @ ball.towards[:2] / np.hypot(*ball.towards[:2]) > 0.9


def test_the_command_finds_the_light(maps, tmp_path):
    done = CliRunner().invoke(app, ["balls", str(maps), "-o", str(tmp_path / "balls.json")])
    assert done.exit_code == 0, done.output
    assert "1 of 1 recognised; 1 within 8 degrees" in done.output
    assert json.loads((tmp_path / "balls.json").read_text())["balls"]["lit"]["deg"] < 8
