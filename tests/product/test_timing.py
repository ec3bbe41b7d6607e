"""Times are told for every network and the whole call; how long they are is not a test's business."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anyprobe.cli.app import app
from anyprobe.evaluate.report import _timing
from anyprobe.infer.runtime import stages_of, weights_folder

VASE = Path(__file__).parents[2] / "examples" / "vase.png"


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    folder = tmp_path_factory.mktemp("timing")
    arguments = ["timing", "--model", "paper", "--repeats", "3", "--photo", str(VASE), "-o", str(folder)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    return json.loads((folder / "timing.json").read_text())


def test_every_network_and_the_whole_call_are_timed(content):
    one = content["models"]["paper"]
    assert tuple(one["networks"]) == stages_of(weights_folder("paper"))
    for times in (*one["networks"].values(), one["whole"]):
        assert 0 < times["fastest"] <= times["median"]
        assert times["processor"] > 0
    assert content["command"] == "anyprobe timing --model paper --threads 1"
    assert content["paper"]["last_run_pairs"] == 320_000
    assert content["commit"]


def test_the_page_has_ours_and_the_paper_s(content):
    text = "\n".join(_timing({"timing": content}))
    assert "| paper, median | irradiance " in text
    assert "| *the paper, i7-6700K* | irradiance 24.4, illumination 19.7, hdr 12.8 | 56.9 | - |" in text
