"""Losses that were tried on lift: each is nothing at the truth and means what it says beside it."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.nets.light_net import LightNet  # noqa: E402
from anyprobe.train.lift import Lift, LiftConfig  # noqa: E402
from anyprobe.train.lift_ideas import (  # noqa: E402
    ANCHOR_ROWS,
    anchors_loss,
    angles_between,
    next_frame,
    part,
    stillness_loss,
)


def lamp_at(pixel: int) -> torch.Tensor:
    """All light in one anchor, told by the 64 pixels of a map of 64 rows that it takes in."""
    anchors = torch.zeros(1, 1, ANCHOR_ROWS, 2 * ANCHOR_ROWS)
    anchors.view(-1)[pixel] = 1.0
    return torch.repeat_interleave(torch.repeat_interleave(anchors, 8, dim=2), 8, dim=3).flatten(1) / 64


@pytest.mark.parametrize("other", [3, 20, 77, 127])
def test_a_lamp_is_carried_twice_its_angle(other):
    """Of two lone lamps the energy distance is 2 E|X - Y|."""
    directions = pixel_directions(ANCHOR_ROWS).reshape(-1, 3)
    angle = np.arccos(np.clip(directions[40] @ directions[other], -1, 1))
    carried = anchors_loss(lamp_at(40), lamp_at(other), angles_between(ANCHOR_ROWS))
    assert carried.item() == pytest.approx(2 * angle, abs=1e-4)


def test_light_in_its_place_is_not_carried_and_near_is_less_than_far():
    between = angles_between(ANCHOR_ROWS)
    true, near, far = lamp_at(40), lamp_at(41), lamp_at(47)
    assert anchors_loss(true, true, between).item() == pytest.approx(0.0, abs=1e-5)
    half = (true + near) / 2
    assert 0 < anchors_loss(half, true, between) < anchors_loss(near, true, between)
    assert anchors_loss(near, true, between) < anchors_loss(far, true, between)


def test_the_next_frame_has_other_noise_and_no_wider_mask():
    photo = torch.rand(3, 4, 128, 128)
    photo[:, 3] = 0.0
    photo[:, 3, 30:90, 40:100] = 1.0
    photo[:, :3] *= photo[:, 3:]
    frames = [next_frame(photo, progress) for progress in (0.0, 0.1, 0.1, 0.7)]
    for frame in frames:
        assert (frame[:, 3] <= photo[:, 3]).all()
        assert (photo[:, 3] - frame[:, 3]).sum() <= 3 * 121
        assert not frame[:, :3][(frame[:, 3:] == 0).expand(-1, 3, -1, -1)].any()
        inside = (frame[:, 3:] == 1).expand(-1, 3, -1, -1)
        assert 0.002 < (frame[:, :3] - photo[:, :3])[inside].std() < 0.02
    assert torch.equal(frames[1], frames[2])
    assert not torch.equal(frames[0], frames[1])
    assert len(next_frame(photo[:0], 0.0)) == 0


def test_light_that_stays_is_still():
    torch.manual_seed(0)
    net = LightNet().eval()
    with torch.no_grad():
        guess = net(torch.rand(4, 4, 128, 128), torch.full((4, 1), 0.1))
    assert stillness_loss(guess, guess) == 0.0
    first, last = part(guess, slice(2)), part(guess, slice(2, None))
    assert first.told.code.shape[0] == first.ln_radiance.shape[0] == 2
    assert stillness_loss(first, last) > 0.0
    brighter = replace(guess, ln_flux=guess.ln_flux + 0.5)
    assert stillness_loss(brighter, guess).item() == pytest.approx(0.5, abs=1e-5)


def test_ideas_count_only_when_asked_for():
    """Each adds its own loss to those that are there."""
    torch.manual_seed(0)
    batch = some_batch(4)
    plain = set(Lift(LiftConfig(), "cpu").losses(batch, 0.0))
    for name in ("anchors", "stillness"):
        learner = Lift(LiftConfig(**{name: 1.0}), "cpu")
        terms = learner.losses(batch, 0.0)
        assert set(terms) == set(learner.columns) == plain | {name}
        assert torch.isfinite(terms[name])
        assert terms[name] > 0
