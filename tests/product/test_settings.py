"""What an Estimator and the function `estimate` take, and which networks they open."""

from __future__ import annotations

import inspect
import re

import pytest
from support.refused import refused
from support.scenes import sphere_photo

import anyprobe
from anyprobe.estimate import estimator
from anyprobe.estimate.runtime import Models
from anyprobe.files.graphs import CPU


def test_the_function_takes_and_explains_every_argument():
    """`help` of estimate, and of the Hints and Settings that it names."""
    taken = {k: one for k, one in inspect.signature(anyprobe.estimate).parameters.items() if k != "unknown"}
    for other in (anyprobe.Estimator, anyprobe.Estimator.__call__):
        given = {
            k: one for k, one in inspect.signature(other).parameters.items() if k not in ("self", "settings", "unknown")
        }
        assert {name: one.default for name, one in given.items()} == {name: taken[name].default for name in given}
    text = "\n".join(inspect.getdoc(one) for one in (anyprobe.estimate, anyprobe.Hints, anyprobe.Settings))
    assert [name for name in taken if not re.search(rf"\b{name}(, \w+)*: \S", text)] == []


@pytest.mark.ci
def test_networks_are_opened_anew_for_another_engine_or_other_threads(monkeypatch):
    opened = []

    def open_networks(*settings):
        opened.append(settings)
        return Models(*settings)

    monkeypatch.setattr(estimator, "Models", open_networks)
    estimator._shared.cache_clear()
    picture = sphere_photo()
    for settings in ({"threads": 1}, {"threads": 2}, {"threads": 1}):
        anyprobe.estimate(picture, **settings)
    with refused("providers"):
        anyprobe.estimate(picture, threads=1, providers="onyx")
    estimator._shared.cache_clear()
    assert [given[:3] for given in opened] == [("lift", 1, CPU), ("lift", 2, CPU), ("lift", 1, ("onyx",))]


def test_what_a_model_does_not_estimate_is_none():
    light = anyprobe.estimate(sphere_photo(), model="paper")
    assert (light.info["object"], light.info["uncertainty"]) == (None, None)
