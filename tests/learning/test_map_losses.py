"""Losses of maps against what they are said to measure."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.light.filtering import blur_cosine_power  # noqa: E402
from anyprobe_train.dataset.asset_store import draw_map  # noqa: E402
from anyprobe_train.train.map_losses import LOBES, Sent, clipped_where_white, lobe_matrices, structure_loss  # noqa: E402


@pytest.fixture
def light():
    """ln radiance [1, 3, 64, 128] with a source of radiance 30 on a dim ground."""
    ln = torch.full((1, 3, 64, 128), -2.0)
    ln[:, :, 10:14, 30:34] = np.log(30.0)
    return ln


def test_lobes_are_the_map_blurred_by_powers_of_the_cosine():
    radiance = draw_map(np.random.default_rng(2), height=32)[0]
    flat = torch.from_numpy(radiance.reshape(-1, 3))
    for power, matrix in zip(LOBES, lobe_matrices(32, 32), strict=True):
        expected = blur_cosine_power(radiance, power)
        np.testing.assert_allclose((matrix @ flat).reshape(32, 64, 3), expected, rtol=1e-3, atol=1e-4)


def test_structure_is_lost_by_blur_and_kept_by_itself():
    picture = torch.rand(1, 3, 64, 128)
    assert structure_loss(picture, picture) == pytest.approx(0.0, abs=1e-5)
    flat = torch.full_like(picture, 0.5)
    assert structure_loss(flat, picture) > 0.9


def test_white_may_be_any_white():
    true, shown = torch.tensor([1.0, 1.0, 0.5, 0.5]), torch.tensor([3.0, 0.8, 3.0, 0.8])
    torch.testing.assert_close(clipped_where_white(shown, true), torch.tensor([1.0, 0.8, 3.0, 0.8]))


def test_level_is_the_difference_of_power_wherever_it_comes_from(light):
    sent = Sent("cpu")
    assert sent.level(light.roll(40, dims=3), light).item() == pytest.approx(0.0, abs=1e-5)
    assert sent.level(light - 0.7, light).item() == pytest.approx(0.7, abs=1e-4)
    full = torch.zeros_like(light)
    torch.testing.assert_close(sent.power(full), torch.full((1, 3), 4 * np.pi), rtol=1e-4, atol=0)


def test_light_is_said_best_where_it_comes_from(light):
    sent = Sent("cpu")
    power, share = sent.above_white(light)
    assert share.sum().item() == pytest.approx(1.0, abs=1e-5)
    solid_angle = sent.angles[0, 0, 10:14, 30:34].sum().item()
    assert power[0, 0].item() == pytest.approx(29 * solid_angle, rel=1e-4)
    there, wide, elsewhere = (
        sent.emitters(sent.ln_share_of(one[:, :1]), light).item()  # grey: ln of each channel
        for one in (light, torch.zeros_like(light), light.roll(40, dims=3))
    )
    assert there < wide - 1
    assert wide < elsewhere
    dim = torch.full_like(light, -1.0)
    assert sent.emitters(sent.ln_share_of(light[:, :1]), dim).item() == 0, "nothing is above white"
