"""Names of closed lists: a slip of the pen is answered with what was meant, whichever list it is."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.cli.export import target_names
from anyprobe.detail.plausible import check_detail
from anyprobe.errors import AnyprobeError, did_you_mean
from anyprobe.estimate.result import Light
from anyprobe.estimate.runtime import Models, weights_folder
from anyprobe.export.targets import find_target
from anyprobe.hints import HINTS
from anyprobe.masks.segmenters import load_segmenter
from anyprobe.relight.insert import uses_mitsuba
from anyprobe.scatter.materials import MATERIALS, material_named


def light():
    return Light(radiance=np.ones((64, 128, 3), np.float32))


@pytest.mark.parametrize(
    ("call", "name", "meant"),
    [
        (material_named, "golden", "gold"),
        (material_named, "Stainless", "stainless-steel"),
        (check_detail, "plausble", "plausible"),
        (find_target, "blendr", "blender"),
        (target_names, "blendr", "blender"),
        (lambda name: light().render(name), "vaze", "vase"),
        (lambda name: light().panorama(64, frame=name), "levle", "level"),
        (lambda name: Models(engine=name), "onnx", "onnxruntime"),
        (lambda name: Models(emitters=name), "expcted", "expected"),
        (weights_folder, "lft", "lift"),
        (load_segmenter, "u2net", "u2netp"),
        (uses_mitsuba, "mitsubi", "mitsuba"),
        (HINTS["normals"].read_word, "spere", "sphere"),
    ],
)
def test_a_slip_of_the_pen_is_answered_with_what_was_meant(call, name, meant):
    with pytest.raises(AnyprobeError, match=rf"got '{name}'; did you mean {meant}\?$"):
        call(name)


def test_a_name_like_none_is_answered_with_none():
    for name in ("granite", "x", "", "metal"):
        assert did_you_mean(name, MATERIALS) == "", name
    assert did_you_mean("brss", MATERIALS) == "; did you mean brass?"
    assert did_you_mean("openvino-b", ["openvino", "openvino-bf16"]) == "; did you mean openvino or openvino-bf16?"
