"""Losses that were tried on lift: each is nothing at the truth and means what it says beside it."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe.light.harmonics import project  # noqa: E402
from anyprobe.nets.light_net import LightNet  # noqa: E402
from anyprobe.nets.queries import HEIGHT, TOKENS, Queries  # noqa: E402
from anyprobe.nets.tones import from_logarithm, from_reinhard, logarithm, merge, reinhard  # noqa: E402
from anyprobe.train.lift import Lift, LiftConfig  # noqa: E402
from anyprobe.train.lift_ideas import (  # noqa: E402
    ANCHOR_ROWS,
    anchors_loss,
    angles_between,
    harmonic_matrix,
    harmonics_loss,
    next_frame,
    part,
    stillness_loss,
    tones_loss,
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
    for name in ("anchors", "stillness", "harmonics", "tones"):
        learner = Lift(LiftConfig(**{name: 1.0}), "cpu")
        terms = learner.losses(batch, 0.0)
        assert set(terms) == set(learner.columns) == plain | {name}
        assert torch.isfinite(terms[name])
        assert terms[name] > 0


def test_harmonics_of_all_orders_are_orthogonal_and_normal():
    """Read at pixels' centres: the closed forms of harmonics.project differ by a thousandth."""
    matrix = harmonic_matrix(64).double()
    areas = torch.from_numpy(np.repeat(pixel_solid_angles(64)[:, 0].astype(np.float64), 128))
    np.testing.assert_allclose(matrix @ (matrix / areas).mT, np.eye(16), atol=2e-3)
    radiance = torch.rand(64, 128, 3)
    found = matrix[:9] @ radiance.reshape(-1, 3).double()
    np.testing.assert_allclose(found, project(radiance.numpy()), atol=5e-3)


def test_harmonics_ask_for_the_place_of_light_not_for_its_sharpness():
    matrix = harmonic_matrix(64)
    true, near, far = (torch.full((1, 3, 64, 128), -2.0) for _ in range(3))
    true[..., 20:22, 64:66] = near[..., 20:22, 68:70] = far[..., 20:22, 0:2] = 5.0
    wide = true.clone()
    wide[..., 18:24, 62:68] = np.log((4 * np.exp(5) + 32 * np.exp(-2)) / 36)
    losses = [harmonics_loss(one, true, matrix).item() for one in (true, wide, near, far)]
    assert losses[0] == pytest.approx(0.0, abs=1e-6)
    assert losses == sorted(losses)
    assert losses[3] > 4 * losses[1]


def test_tones_come_back_and_the_one_that_reaches_is_taken():
    e = torch.tensor([0.0, 1e-3, 0.2, 1.0, 5.0, 15.0])
    torch.testing.assert_close(from_reinhard(reinhard(e)), e, rtol=1e-3, atol=1e-5)
    high = torch.tensor([0.0, 0.2, 1.0, 100.0, 9e3])
    torch.testing.assert_close(from_logarithm(logarithm(high)), high, rtol=1e-3, atol=1e-5)
    assert reinhard(torch.tensor(1e3)) == logarithm(torch.tensor(1e6)) == 1.0
    merged = merge(reinhard(torch.tensor([2.0, 12.0, 500.0])), logarithm(torch.tensor([3.0, 14.0, 500.0])))
    torch.testing.assert_close(merged, torch.tensor([2.0, 13.0, 500.0]), rtol=1e-3, atol=0)


def test_tones_are_right_at_the_truth_alone():
    true = torch.randn(2, 3, 64, 128) * 2
    e, even = torch.exp(true), torch.ones(1, 1, 64, 128)
    told = torch.cat([reinhard(e), logarithm(e)], dim=1)
    assert tones_loss(told, true, even) == 0.0
    for wrong in (slice(0, 3), slice(3, 6)):
        other = told.clone()
        other[:, wrong] += 0.1
        assert tones_loss(other, true, even) > 0.06


def asked(net: Queries, tokens, mirror, cover):
    with torch.no_grad():
        return net(tokens, mirror, cover, torch.ones(1, 5))


def test_queries_know_pixels_by_what_they_say_not_by_their_place():
    """Pixels in another order tell the same; those off the object tell nothing."""
    torch.manual_seed(0)
    net = Queries(8, 5, 7).eval()
    tokens = torch.randn(1, 8, TOKENS, TOKENS)
    mirror = torch.nn.functional.normalize(torch.randn(1, 3, TOKENS, TOKENS), dim=1)
    cover = (torch.rand(1, 1, TOKENS, TOKENS) > 0.5).float()
    told = asked(net, tokens, mirror, cover)
    assert told.shape == (1, 7, HEIGHT, 2 * HEIGHT)
    order = torch.randperm(TOKENS**2)
    other = (one.flatten(2)[..., order].unflatten(2, (TOKENS, TOKENS)) for one in (tokens, mirror, cover))
    torch.testing.assert_close(asked(net, *other), told, rtol=1e-3, atol=1e-4)
    hidden = torch.where(cover > 0, tokens, tokens + 10)
    torch.testing.assert_close(asked(net, hidden, mirror, cover), told, rtol=1e-2, atol=1e-3)
    assert (asked(net, tokens + cover, mirror, cover) - told).abs().max() > 0.01
    assert told.std(dim=(2, 3)).min() > 0.01  # each direction asks for itself


def test_networks_with_ideas_give_whole_guesses():
    torch.manual_seed(0)
    photo, tan_half = torch.rand(2, 4, 128, 128), torch.full((2, 1), 0.1)
    for settings in ({"queries": True}, {"dual": True}, {"queries": True, "lifting": False}):
        guess = LightNet(**settings).eval()(photo, tan_half)
        assert guess.ln_radiance.shape == (2, 3, 64, 128)
        assert torch.isfinite(guess.ln_radiance).all()
        assert (guess.tones is not None) is ("dual" in settings)


def test_what_is_asked_reaches_the_map():
    torch.manual_seed(0)
    photo, tan_half = torch.rand(1, 4, 128, 128), torch.full((1, 1), 0.1)
    net = LightNet(queries=True).eval()
    with torch.no_grad():
        before = net(photo, tan_half).ln_shown
        net.queries.out[1].bias += 1.0
        after = net(photo, tan_half).ln_shown
    assert ((after - before).abs() > 1e-3).float().mean() > 0.9
