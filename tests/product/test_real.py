"""Real photos with measured maps: the folder's rules, and the map turned to what the networks see."""

import csv
import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from anyprobe.cli.app import app
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.evaluate.panel import Estimate
from anyprobe.evaluate.real import COLUMNS, load_real, read_real, score_real
from anyprobe.evaluate.report import _real
from anyprobe.files.radiance import write_hdr
from anyprobe.light.main_light import find_main_light

GOOD = {"photo": "a.png", "mask": "m.png", "map": "a.hdr", "fov_deg": "60", "gain": "2", "kind": "specular"}


@pytest.fixture
def folder(tmp_path):
    """A grey square at the right border of a photo, under a lamp straight ahead of the camera."""
    photo = np.zeros((120, 240, 3), np.uint8)
    photo[40:80, 180:220] = 128
    Image.fromarray(photo).save(tmp_path / "a.png")
    Image.fromarray((photo[..., 0] > 0).astype(np.uint8) * 255).save(tmp_path / "m.png")
    radiance = np.full((64, 128, 3), 0.125, np.float32)
    radiance[31:33, 63:65] = 8.0
    write_hdr(tmp_path / "a.hdr", radiance)
    return tmp_path


def write(folder, *rows):
    with (folder / "manifest.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def test_map_comes_in_the_crop_s_frame_and_the_photo_s_exposure(folder):
    write(folder, GOOD)
    (pair,) = load_real(folder, read_real(folder))
    assert pair.crop.shape == (128, 128, 4)
    assert np.median(pair.radiance) == pytest.approx(0.25, rel=0.01)  # gain 2
    direction = find_main_light(pair.radiance).direction
    # the object stands 80 px right of the middle, 120 px are tan 30: the lamp is that far left of it
    expected = np.degrees(np.arctan(80 / 120 * np.tan(np.radians(30))))
    assert np.degrees(np.arctan2(direction[0], -direction[2])) == pytest.approx(-expected, abs=1.5)


def test_groups_are_scored_apart(folder):
    write(folder, GOOD, GOOD | {"kind": "diffuse", "gain": "1"})
    truth = {}

    def perfect(pair):
        truth[pair.kind] = response(pair.radiance)
        return Estimate(ldr=truth[pair.kind], radiance=pair.radiance)

    def black(pair):
        return Estimate(ldr=np.zeros((64, 128, 3), np.float32))

    groups = score_real(load_real(folder, read_real(folder)), {"perfect": perfect, "black": black})
    assert set(groups) == {"specular", "diffuse"}
    for kind, one in groups.items():
        rows = {row["design"]: row for row in one["rows"]}
        assert one["pairs"] == 1
        assert rows["perfect"]["ball_ssim"] == pytest.approx(1.0)
        assert rows["perfect"]["main_light_deg"] == 0.0
        expected = np.sqrt(np.square(truth[kind]).mean())
        assert rows["black"]["ldr_rmse"] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"map": "b.hdr"}, "the file b.hdr, found none"),
        ({"kind": "shiny"}, "specular or diffuse, got 'shiny'"),
        ({"gain": "-1"}, "gain > 0, got '-1'"),
        ({"fov_deg": "wide"}, "fov_deg > 0, got 'wide'"),
        ({"mask": ""}, "a value for mask"),
    ],
)
def test_a_wrong_row_is_named(folder, change, words):
    write(folder, GOOD, GOOD | change)
    with pytest.raises(InputError, match=words) as error:
        read_real(folder)
    assert "line 3" in str(error.value)


def test_no_manifest_is_one_clear_line(tmp_path):
    with pytest.raises(InputError, match="expected a table with the columns photo, mask"):
        read_real(tmp_path)


def test_the_command_writes_what_the_report_reads(folder):
    write(folder, GOOD)
    out = folder / "out"
    result = CliRunner().invoke(app, ["evaluate", "--real", str(folder), "--model", "paper", "-o", str(out)])
    assert result.exit_code == 0, result.output
    content = json.loads((out / "real.json").read_text())
    designs = [row["design"] for row in content["groups"]["specular"]["rows"]]
    assert designs == ["mean map", "chrome ball", "paper"]
    text = "\n".join(_real({"real": content}))
    assert "Specular, 1 photos" in text
    assert "| chrome ball (no network) |" in text


def test_neither_assets_nor_real_photos_is_one_clear_line():
    result = CliRunner().invoke(app, ["evaluate"])
    assert isinstance(result.exception, InputError)
    assert "--hdri DIR and --meshes DIR" in str(result.exception)
