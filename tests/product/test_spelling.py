"""Names of closed lists: a slip of the pen is answered with what was meant, whichever list it is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from anyprobe.cli.export import target_names
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import AnyprobeError
from anyprobe.estimate.result import Light
from anyprobe.estimate.runtime import weights_folder
from anyprobe.export.targets import find_target
from anyprobe.inputs.hints import HINTS
from anyprobe.masks.networks import load_network
from anyprobe.scatter.materials import MATERIALS, material_named


def light():
    return Light(radiance=np.ones((64, 128, 3), np.float32))


@pytest.mark.parametrize(
    ("call", "name", "meant"),
    [
        (material_named, "golden", "gold"),
        (material_named, "Stainless", "stainless-steel"),
        (find_target, "blendr", "blender"),
        (target_names, "blendr", "blender"),
        (lambda name: light().render(name), "vaze", "vase"),
        (lambda name: light().panorama(64, frame=name), "levle", "level"),
        (weights_folder, "lft", "lift"),
        (load_network, "u2net", "u2netp"),
        (HINTS["normals"].read_word, "spere", "sphere"),
    ],
)
def test_a_slip_of_the_pen_is_answered_with_what_was_meant(call, name, meant):
    with pytest.raises(AnyprobeError, match=rf"got '{name}'; did you mean {meant}\?$"):
        call(name)


CASES = json.loads((Path(__file__).parent / "cases" / "misspelt.json").read_text(encoding="utf-8"))
"""Names, the known ones and what is said."""


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_what_is_said_of_a_name(case):
    known = MATERIALS if case["known"] == "materials" else case["known"]
    assert did_you_mean(case["name"], known) == case["said"]
