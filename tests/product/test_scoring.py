"""The groups that figures are split by."""

from types import SimpleNamespace

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_directions
from anyprobe_train.evaluate.scoring import GROUPS, dominant_light_share, groups_of


def room(emitter_share: float, direction=(0.3, 0.8, 0.5)) -> np.ndarray:
    """Even light and an emitter 8 degrees in radius that sends so much of the whole."""
    d = np.asarray(direction) / np.linalg.norm(direction)
    cap = (pixel_directions(64) @ d > np.cos(np.radians(8.0)))[..., None]
    solid_angle = 2 * np.pi * (1 - np.cos(np.radians(8.0)))
    level = emitter_share / max(1 - emitter_share, 1e-9) * 4 * np.pi / solid_angle
    return np.where(cap, 1.0 + level, 1.0) * np.ones(3)


def pair(alpha: float, emitter_share: float, indoor: bool = True):
    material = SimpleNamespace(alpha=alpha)
    return SimpleNamespace(material=material, specular=alpha < 0.5, indoor=indoor, radiance=room(emitter_share))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_share_of_a_emitter_is_what_it_sends(share):
    assert dominant_light_share(room(share)) == pytest.approx(share, abs=0.03)


def test_every_pair_is_in_its_groups():
    assert groups_of(pair(0.05, 0.6)) == {"all", "specular", "indoor", "alpha 0-0.1", "one light", "one light, shiny"}
    assert groups_of(pair(0.8, 0.6, indoor=False)) == {
        "all",
        "diffuse",
        "outdoor",
        "alpha 0.75-1",
        "one light",
        "one light, diffuse",
    }
    assert groups_of(pair(1.0, 0.1)) == {"all", "diffuse", "indoor", "alpha 0.75-1"}


def test_the_bins_of_alpha_leave_nothing_out():
    bins = [belongs for name, belongs in GROUPS.items() if name.startswith("alpha")]
    for alpha in np.linspace(0.01, 1.0, 100):
        assert sum(belongs(pair(float(alpha), 0.0), False) for belongs in bins) == 1
