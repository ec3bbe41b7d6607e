"""What an Estimator and the function `estimate` take, and which networks they open."""

from __future__ import annotations

import pytest
from support.refused import refused
from support.scenes import sphere_photo

import anyprobe
from anyprobe.estimate import estimator
from anyprobe.estimate.runtime import Models
from anyprobe.files.graphs import CPU


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
