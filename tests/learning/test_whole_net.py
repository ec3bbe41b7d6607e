"""The network that is given the whole photo: its context, its light sources, and what each loss asks for."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe_train.nets.source_head import SOURCES, SourceHead  # noqa: E402
from anyprobe_train.nets.whole_net import SAID, WholeNet  # noqa: E402
from anyprobe_train.whole_network.source_profiles import source_profiles  # noqa: E402
from anyprobe_train.whole_network.whole_losses import WHOLE_WEIGHTS, WholeLoss, posture_losses, profile_loss  # noqa: E402


def cap(direction, radius_deg: float) -> torch.Tensor:
    d = pixel_directions(64) @ (np.float32(direction) / np.linalg.norm(direction)).astype(np.float32)
    return torch.from_numpy((d > np.cos(np.radians(radius_deg))).astype(np.float32))


def inputs(count: int) -> tuple[torch.Tensor, ...]:
    """What WholeNet takes: of smooth pictures, LightNet's map with a bright place, and no up."""
    generator = torch.Generator().manual_seed(0)

    def smooth(channels: int, *size: int) -> torch.Tensor:
        coarse = torch.rand(count, channels, 4, 8, generator=generator)
        return torch.nn.functional.interpolate(coarse, size=size, mode="bilinear", align_corners=False)

    lift = torch.cat([2 * smooth(6, 64, 128) - 2, smooth(1, 64, 128)], dim=1)
    lift[:, :6] += 3 * cap([0.5, 0.7, -0.5], 25.0)
    said = torch.rand(count, SAID, generator=generator)
    return smooth(5, 96, 96), torch.full((count, 1), 0.2), lift, said, smooth(4, 64, 128), torch.zeros(count, 3)


def test_without_a_photo_around_it_context_is_told_nothing():
    """A cut-out: no posture and no direction of light by the context, and up counts where it is given."""
    torch.manual_seed(0)
    context, *rest, up = inputs(2)
    context[0] = 0.0
    net = WholeNet().eval()
    upright = up + torch.tensor([0.0, 0.8, 0.6])
    with torch.no_grad():
        guess, told = net(context, *rest, up), net(context, *rest, upright)
    assert (guess.posture[0] == 0).all()
    assert (guess.posture[1] != 0).all()
    assert guess.ln_context[0].abs().max() < 0.01
    assert guess.ln_context[1].abs().max() > guess.ln_context[0].abs().max()
    assert (guess.ln_shown != told.ln_shown).flatten(1).any(dim=1).all()


def test_every_loss_reaches_the_weights():
    """All have a finite value and gradient, and the sum is least for none of the network's first answers."""
    torch.manual_seed(0)
    context, tan_half, lift, said, surroundings, up = inputs(2)
    net = WholeNet()
    truth = lift[:, :3]
    _, profiles = source_profiles(torch.exp(truth).mean(dim=1))
    batch = {
        "truth": truth,
        "context": context,
        "profiles": profiles,
        "colors": torch.rand(len(up), SOURCES, 3) + 0.5,
        "up": up + torch.tensor([0.0, 0.8, 0.6]),
    }
    losses = WholeLoss()(net(context, tan_half, lift, said, surroundings, up), batch)
    assert set(losses) == set(WHOLE_WEIGHTS)
    for name, loss in losses.items():
        net.zero_grad()
        loss.backward(retain_graph=True)
        size = sum(float(one.grad.square().sum()) for one in net.parameters() if one.grad is not None)
        assert 0 < size < float("inf"), name


def test_a_mixture_on_the_sphere_integrates_to_one():
    head = SourceHead(16)
    d = torch.from_numpy(pixel_directions(64)).reshape(-1, 3)
    angles = torch.from_numpy(pixel_solid_angles(64)).expand(-1, 128).reshape(-1) / (4 * np.pi)
    code = torch.randn(8, 16, generator=torch.Generator().manual_seed(0)) * 10
    density = torch.exp(head.ln_density(code, torch.ones(8, 1), d)).detach()
    np.testing.assert_allclose(density @ angles, 1.0, atol=0.01)
    assert density.max() > 3


def test_the_true_posture_costs_least():
    pitch, roll = 0.4, 0.1
    up = torch.tensor([[np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll), np.sin(pitch)]]).float()
    present = torch.ones(1)
    right = posture_losses(torch.tensor([[pitch, -5.0, roll, 9.0]]), up, present)
    wrong = posture_losses(torch.tensor([[pitch + 0.2, -5.0, roll - 0.2, -9.0]]), up, present)
    assert right["roll"] < 1e-3
    assert right["stands"] < 1e-3
    assert right["pitch"] < 0
    assert wrong["pitch"] > right["pitch"] + 1
    assert wrong["roll"] > 1
    assert wrong["stands"] > 1
    nothing = posture_losses(torch.ones(1, 4), up, torch.zeros(1))
    assert sum(nothing.values()) == 0
    assert profile_loss(torch.ones(2, 4, 4), torch.ones(2, 4, 4)) == 0
