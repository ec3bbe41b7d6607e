"""Two averages: the constants are those that stillness and following ask for; twice or half of one fails."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.light.steady import FILTER, advance, begin_filter

FPS, NOISE, NUMBERS = 15, 0.05, 400


def rms(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(one - other))))


def shown(rng, means: np.ndarray, smoothing: dict) -> np.ndarray:
    """What is shown of numbers with these means and NOISE, [T, NUMBERS]."""
    state, found = None, []
    for mean in means:
        y = mean + rng.normal(0.0, NOISE, NUMBERS)
        state = begin_filter(y) if state is None else advance(state, y, 1 / FPS, rms, smoothing)
        found.append(state.steady)
    return np.array(found)


@pytest.mark.parametrize(("still_s", "is_right"), [(None, True), (1.5, False), (6.0, False)])
def test_a_tenth_of_the_noise_is_left_on_a_still_scene(rng, still_s, is_right):
    smoothing = FILTER if still_s is None else {**FILTER, "still_s": still_s}
    left = shown(rng, np.zeros(40 * FPS), smoothing)[20 * FPS :].std() / NOISE
    assert (0.087 < left < 0.123) == is_right


@pytest.mark.parametrize(("calm", "is_right"), [(None, True), (1.0, False), (4.0, False)])
def test_a_slow_drift_is_one_and_a_half_times_the_noise_ahead(rng, calm, is_right):
    """Nearer, and noise would be taken for motion; further, and slow changes would be shown late."""
    smoothing = FILTER if calm is None else {**FILTER, "calm": calm}
    means = 0.1 * np.arange(10 * FPS) / FPS
    ahead = (means - shown(rng, means, smoothing).mean(axis=1))[5 * FPS :].mean() / NOISE
    assert (0.9 < ahead < 2.0) == is_right
