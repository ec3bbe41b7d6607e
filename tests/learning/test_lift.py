"""Lifting: pixels land where their light came from, and the losses mean what they say."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe.light.light_sources import find_dominant_light  # noqa: E402
from anyprobe.render.spheres import sphere_normals  # noqa: E402
from anyprobe.scatter.materials import MATERIALS, material_input  # noqa: E402
from anyprobe_train.dataset.asset_store import draw_map  # noqa: E402
from anyprobe_train.nets.emitter_head import POWER_FLOOR, EmitterHead  # noqa: E402
from anyprobe_train.nets.lifting import lift_to_map, map_pixel, mirror_direction, pyramid  # noqa: E402
from anyprobe_train.nets.light_net import LightNet  # noqa: E402
from anyprobe_train.train.lift import Lift, LiftConfig  # noqa: E402


def planes(array) -> torch.Tensor:
    """[S, S, C] -> [1, C, S, S]."""
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).permute(2, 0, 1)[None]


def test_every_pixel_of_a_map_finds_itself():
    directions = planes(pixel_directions(64))
    assert torch.equal(map_pixel(directions, 64)[0], torch.arange(64 * 128))


def test_a_chrome_sphere_lifts_to_the_map_it_mirrors():
    """Seen from far away: what lands in a pixel of the map is the map there."""
    radiance = draw_map(np.random.default_rng(1), height=64)[0]
    on_sphere, mask = sphere_normals(256)
    normals = np.zeros((256, 256, 3), np.float32)
    normals[mask] = on_sphere
    n = planes(normals)
    wo = torch.zeros_like(n)
    wo[:, 2] = 1.0
    mirror = mirror_direction(n, wo)
    shown = bilinear(radiance, direction_to_uv(mirror[0].permute(1, 2, 0).numpy()))
    sums = lift_to_map(planes(shown), planes(mask[..., None]), map_pixel(mirror, 64), 64)
    means = pyramid(sums, 1)[0][0].permute(1, 2, 0).numpy()
    well = sums[0, -1].numpy() >= 4
    assert well.mean() > 0.3
    difference = np.abs(means[..., :3] - radiance)[well]
    assert np.median(difference) < 0.02 * np.median(radiance)


def test_lifting_keeps_every_weight(rng):
    values, weight = torch.rand(2, 3, 16, 16), torch.rand(2, 1, 16, 16)
    pixel = torch.randint(0, 32 * 64, (2, 256))
    sums = lift_to_map(values, weight, pixel, 32)
    torch.testing.assert_close(sums[:, -1].sum((1, 2)), weight.sum((1, 2, 3)))
    torch.testing.assert_close(sums[:, :3].sum((2, 3)), (values * weight).sum((2, 3)))


def test_the_field_of_view_moves_what_is_lifted():
    """The same photo through another lens mirrors other directions; far off the axis more so."""
    torch.manual_seed(0)
    net = LightNet().eval()
    photo = torch.rand(1, 4, 128, 128)
    with torch.no_grad():
        narrow, wide = (net(photo, torch.tensor([[tan_half]])) for tan_half in (0.01, 0.6))
    assert narrow.wo[0, 2].min() > 0.999
    assert wide.wo[0, 2].min() < 0.8
    assert wide.wo[0, 0, 30, 0] > 0.4  # a point on the left sees the eye to its right
    for guess in (narrow, wide):
        assert guess.ln_radiance.shape == guess.ln_expected.shape == (1, 3, 64, 128)
        assert guess.confidence_logit.shape == (1, 1, 64, 128)
        assert guess.features.irradiance.shape == (1, 3, 128, 128)


def test_a_given_material_reaches_map_and_irradiance_once_it_is_learned():
    """Untrained it changes nothing, as weights that lack this part must stay what they were."""
    torch.manual_seed(0)
    net = LightNet().eval()
    photo, angle = torch.rand(1, 4, 128, 128), torch.tensor([[0.1]])
    material = torch.from_numpy(material_input(MATERIALS["gold"]))[None]
    with torch.no_grad():
        alone, untrained = net(photo, angle), net(photo, angle, material=material)
        torch.nn.init.normal_(net.object.material[-1].weight)
        given = net(photo, angle, material=material)
    assert torch.equal(alone.ln_radiance, untrained.ln_radiance)
    assert (given.ln_shown - alone.ln_shown).abs().mean() > 1e-4
    assert (given.features.irradiance != alone.features.irradiance).float().mean() > 0.8


def test_claimed_errors_are_learned_from_the_errors_made():
    """The loss is least where the claim is the mean error; a dataset that says no material teaches none."""
    learner = Lift(LiftConfig(), "cpu")
    batch = some_batch(2)
    guess, _ = learner._predict(batch)
    true = batch.ln_radiance
    level = float(np.log(1.5))

    def losses(claim: float, known: bool = True) -> dict:
        said = torch.zeros(2, 7)
        said[:, 1:4], said[:, 5] = batch.material[:, 2:5] + 0.2, claim
        guessed = replace(guess, ln_expected=true + level, posterior=said)
        return learner._posterior(guessed, batch if known else replace(batch, material=0 * batch.material))

    best = losses(float(np.log(level)))["level"]
    assert best < losses(float(np.log(level)) + 0.3)["level"]
    assert best < losses(float(np.log(level)) - 0.3)["level"]
    assert losses(0.0)["color"] < 0.1
    assert losses(0.0, known=False)["material"] == 0.0
    assert losses(0.0)["material"] > 0.2


def lobe(direction, width_deg: float) -> torch.Tensor:
    """Logit of light around a direction, [1, 1, 64, 128]."""
    cosine = pixel_directions(64) @ (np.asarray(direction) / np.linalg.norm(direction))
    angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return torch.from_numpy(-0.5 * (angles / width_deg) ** 2)[None, None].float()


@pytest.mark.parametrize("place", ["expected", "mode"])
def test_emitters_send_the_power_they_are_given(place):
    power = torch.tensor([[2.0, 1.0, 0.5]])
    peak = 200.0 * lobe((1, 1, -1), 5.0)
    for logit in (peak, lobe((1, 1, -1), 5.0), lobe((0, 0, 1), 40.0), torch.zeros(1, 1, 64, 128)):
        radiance = getattr(EmitterHead(4), place)(torch.log(power + POWER_FLOOR), logit)
        angles = torch.from_numpy(pixel_solid_angles(64)).float()
        torch.testing.assert_close((radiance * angles).sum((2, 3)), power, rtol=1e-4, atol=0)


@pytest.mark.parametrize("direction", [(1, 1, -1), (0.02, 0.3, 1), (-1, -0.2, 0.1), (0, 1, 0.3)])
def test_a_emitter_is_drawn_where_it_is_likely(direction):
    """Also across the seam behind the camera; and smaller than the doubt about it."""
    emitters, ln_power, logit = EmitterHead(4), torch.zeros(1, 3), lobe(direction, 20.0)
    drawn, expected = (
        place(ln_power, logit)[0].permute(1, 2, 0).numpy() for place in (emitters.mode, emitters.expected)
    )
    found = find_dominant_light(drawn)
    assert np.degrees(np.arccos(found.direction @ direction / np.linalg.norm(direction))) < 4.0
    assert drawn.max() > 2 * expected.max()


def test_losses_above_white_are_least_at_the_truth():
    """Power: zero there. Place: the entropy of the true distribution, and more anywhere else."""
    learner = Lift(LiftConfig(), "cpu")
    logit = lobe((1, 0.5, -1), 8.0)
    ln_power = torch.log(torch.tensor([[3.0, 2.0, 1.0]]) + POWER_FLOOR)
    above = learner.nets["light"].emitters.expected(ln_power, logit)

    def losses(ln_power, logit):
        guess = SimpleNamespace(ln_power=ln_power, emitter_logit=logit)
        batch = SimpleNamespace(ln_radiance=torch.log(above + 1.0))
        return learner.of_emitters(guess, batch)

    logit.requires_grad_(True)
    truth = losses(ln_power, logit)
    truth["emitters"].backward()
    assert logit.grad.abs().max() < 1e-6
    assert truth["power"].item() == pytest.approx(0.0, abs=1e-4)
    assert losses(ln_power + 0.5, logit)["power"].item() == pytest.approx(0.5, abs=1e-4)
    for other in (lobe((1, 0.5, -1), 16.0), lobe((1, 0.5, -1), 4.0), lobe((-1, 0.5, -1), 8.0)):
        assert losses(ln_power, other)["emitters"] > truth["emitters"] + 0.05
