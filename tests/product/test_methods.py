"""Models scored with what is known of the object told to them."""

from __future__ import annotations

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.response import response
from anyprobe.estimate.runtime import Models
from anyprobe_train.evaluate.methods import GIVEN_HINTS, model_methods, truth_methods
from anyprobe_train.evaluate.metrics import rmse


@pytest.mark.ci
def test_only_a_model_that_lifts_is_given_normals():
    rows = {name: list(model_methods(Models(name), name, hints)) for name, hints in (("lift", True), ("paper", False))}
    assert rows["lift"] == ["lift", *(f"lift, {what} given" for what in GIVEN_HINTS)]
    assert rows["paper"] == ["paper"]
    pair, methods = sphere_pair(3), model_methods(Models(), "lift", hints=True)
    alone, given = (methods[f"lift{row}"](pair) for row in ("", ", normals given"))
    assert (alone.radiance != given.radiance).any()


def test_no_flat_colour_is_nearer_than_the_truth_s_mean_and_blur_costs_more_the_wider():
    pair = sphere_pair(4)
    truth = response(pair.radiance)
    made = {name: method(pair).ldr for name, method in truth_methods().items()}
    flat = made.pop("one flat colour")
    assert np.ptp(flat, axis=(0, 1)).max() == 0
    for other in (0.01, -0.01):
        assert rmse(flat, truth) < rmse(flat + other, truth)
    near, far = (rmse(blurred, truth) for blurred in made.values())
    assert 0 < near < far < rmse(flat, truth)
