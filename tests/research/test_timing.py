"""Times are printed for every network and the whole call; how long they are is not a test's business."""

from pathlib import Path

import pytest

from anyprobe.estimate.runtime import stages_of, weights_folder
from research.timing import time_model, timing

VASE = Path(__file__).parents[2] / "examples" / "vase.png"


@pytest.mark.ci
def test_every_network_and_the_whole_call_are_timed():
    one = time_model("paper", VASE, threads=1, repeats=3)
    assert tuple(one["networks"]) == stages_of(weights_folder("paper"))
    for times in (*one["networks"].values(), one["whole"]):
        assert 0 < times["fastest"] <= times["median"]
        assert times["processor"] > 0


@pytest.mark.ci
def test_the_command_prints_a_line_for_each_model(capsys):
    timing(["paper"], threads=1, repeats=3, photo=VASE)
    assert "paper: irradiance " in capsys.readouterr().out
