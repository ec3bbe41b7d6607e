"""The table of what is taken for indoors and outdoors, and the part of a context picture that a photo shows."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs ./train[torch]")

from research.scenes.kinds import Judged, kinds_table, plate_of


def test_places_are_counted_by_each_rule():
    judged = [Judged(outdoors=True, shown=k < 1, lit=k < 3) for k in range(4)]
    judged += [Judged(outdoors=False, shown=k == 0, lit=k == 1) for k in range(5)]
    assert list(kinds_table(judged)) == [
        "sky or plants: 1 of 4 outdoors, 1 of 5 rooms",
        "the estimate: 3 of 4 outdoors, 1 of 5 rooms",
        "either: 3 of 4 outdoors, 2 of 5 rooms",
    ]


def test_a_context_picture_without_its_object_and_what_is_outside_the_photo():
    context = np.zeros((96, 96, 5), np.uint8)
    context[10:60, 20:90, :3], context[10:60, 20:90, 4] = 100, 255
    context[30:40, 50:60, 3] = 255
    plate = plate_of(context)
    assert plate.rgb.shape == (50, 70, 3)
    assert (plate.hidden > 20).sum() == 100
