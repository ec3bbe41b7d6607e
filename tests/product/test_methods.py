"""Models scored with what is known of the object told to them."""

from __future__ import annotations

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.response import response
from anyprobe.estimate.material_hint import TRUST, fit_gain
from anyprobe.estimate.runtime import Models
from anyprobe_train.evaluate.methods import GIVEN_HINTS, model_methods, run_with_hints, true_normals, truth_methods
from anyprobe_train.evaluate.metrics import rmse


@pytest.fixture(scope="module")
def models():
    return Models()


def test_true_normals_are_means_of_four_made_unit():
    pair = sphere_pair(1)
    hints = true_normals(pair)
    assert hints.shape == (64, 64, 3)
    length = np.linalg.norm(hints, axis=-1)
    np.testing.assert_allclose(length[length > 0], 1.0, atol=1e-5)
    mean = pair.normals[30:32, 90:92].reshape(4, 3).mean(axis=0)
    np.testing.assert_allclose(hints[15, 45], mean / np.linalg.norm(mean), atol=1e-6)
    assert (hints[0, 0] == 0).all()


@pytest.mark.ci
def test_what_is_told_is_all_that_differs(models):
    pair = sphere_pair(2)
    plain = models(pair.crop, pair.tan_half)
    answers = {name: run_with_hints(models, pair, hints) for name, hints in GIVEN_HINTS.items()}
    np.testing.assert_array_equal(run_with_hints(models, pair, set()).radiance, plain.radiance)
    normals = models(pair.crop, pair.tan_half, true_normals(pair))
    np.testing.assert_array_equal(answers["normals"].radiance, normals.radiance)
    np.testing.assert_allclose(answers["normals"].normals[20:40, 20:40], true_normals(pair)[20:40, 20:40], atol=1e-4)
    for name, told in (("material", None), ("normals and material", true_normals(pair))):
        before = models(pair.crop, pair.tan_half, told, None, pair.material)
        assert np.abs(before.radiance - (plain if told is None else normals).radiance).max() > 0.01
        gain = fit_gain(before.radiance, pair.crop, before.normals, pair.tan_half, pair.material)
        assert np.abs(gain - 1).max() > 0.01
        fitted = before.radiance * gain**TRUST
        np.testing.assert_allclose(answers[name].radiance, fitted, rtol=1e-6)
        np.testing.assert_allclose(answers[name].ldr, response(fitted), rtol=1e-5)
        np.testing.assert_allclose(np.exp(answers[name].ln_radiance), fitted, rtol=1e-2)


@pytest.mark.ci
def test_only_a_model_that_lifts_is_given_normals():
    rows = {name: list(model_methods(Models(name), name, hints)) for name, hints in (("lift", True), ("paper", False))}
    assert rows["lift"] == ["lift", "lift, emitters expected", *(f"lift, {what} given" for what in GIVEN_HINTS)]
    assert rows["paper"] == ["paper"]
    pair, methods = sphere_pair(3), model_methods(Models(), "lift", hints=True)
    alone, given, spread = (methods[f"lift{row}"](pair) for row in ("", ", normals given", ", emitters expected"))
    assert (alone.radiance != given.radiance).any()
    assert spread.radiance.max() < alone.radiance.max()


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
