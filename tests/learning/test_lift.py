"""Lifting: pixels land where their light came from, and the losses mean what they say."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions  # noqa: E402
from anyprobe.core.response import response  # noqa: E402
from anyprobe.dataset.procedural_light import draw_map  # noqa: E402
from anyprobe.light.filtering import blur_cosine_power  # noqa: E402
from anyprobe.nets.lift import lift, map_pixel, mirror_direction, pyramid  # noqa: E402
from anyprobe.nets.light_net import LightNet  # noqa: E402
from anyprobe.nets.sphere_net import _close, _wrap  # noqa: E402
from anyprobe.render.balls import ball_normals  # noqa: E402
from anyprobe.train.lift import LOBES, display, lobe_matrices, structure_loss  # noqa: E402


def planes(array) -> torch.Tensor:
    """[S, S, C] -> [1, C, S, S]."""
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).permute(2, 0, 1)[None]


def test_every_pixel_of_a_map_finds_itself():
    directions = planes(pixel_directions(64))
    assert torch.equal(map_pixel(directions, 64)[0], torch.arange(64 * 128))


def test_a_chrome_ball_lifts_to_the_map_it_mirrors():
    """Seen from far away: what lands in a pixel of the map is the map there."""
    radiance = draw_map(np.random.default_rng(1), height=64)[0]
    on_ball, mask = ball_normals(256)
    normals = np.zeros((256, 256, 3), np.float32)
    normals[mask] = on_ball
    n = planes(normals)
    wo = torch.zeros_like(n)
    wo[:, 2] = 1.0
    mirror = mirror_direction(n, wo)
    shown = bilinear(radiance, direction_to_uv(mirror[0].permute(1, 2, 0).numpy()))
    sums = lift(planes(shown), planes(mask[..., None]), map_pixel(mirror, 64), 64)
    means = pyramid(sums, 1)[0][0].permute(1, 2, 0).numpy()
    well = sums[0, -1].numpy() >= 4
    assert well.mean() > 0.3
    difference = np.abs(means[..., :3] - radiance)[well]
    assert np.median(difference) < 0.02 * np.median(radiance)


def test_lifting_keeps_every_weight(rng):
    values, weight = torch.rand(2, 3, 16, 16), torch.rand(2, 1, 16, 16)
    pixel = torch.randint(0, 32 * 64, (2, 256))
    sums = lift(values, weight, pixel, 32)
    torch.testing.assert_close(sums[:, -1].sum((1, 2)), weight.sum((1, 2, 3)))
    torch.testing.assert_close(sums[:, :3].sum((2, 3)), (values * weight).sum((2, 3)))


def test_coarse_scales_fill_what_fine_ones_miss():
    """One lit pixel: its colour is the mean at every scale where it falls, and nowhere else."""
    sums = torch.zeros(1, 2, 64, 128)
    sums[0, :, 10, 20] = torch.tensor([600.0, 1000.0])
    for depth, means in enumerate(pyramid(sums, 4)):
        there = means[0, :, 10 >> depth, 20 >> depth]
        torch.testing.assert_close(there, torch.tensor([0.6, 1.0]), atol=1e-3, rtol=0)
        assert (means != 0).sum() == 2


def test_display_is_the_mean_camera_until_white():
    radiance = torch.linspace(0.001, 1.0, 50)
    torch.testing.assert_close(display(radiance.log()), response(radiance), atol=1e-5, rtol=0)
    assert display(torch.tensor(3.0)) > 1


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


def test_the_field_of_view_moves_what_is_lifted():
    """The same photo through another lens mirrors other directions; far off the axis more so."""
    torch.manual_seed(0)
    net = LightNet().eval()
    photo = torch.rand(1, 4, 128, 128)
    with torch.no_grad():
        narrow, wide = (net(photo, torch.tensor([[tan_half]])) for tan_half in (0.01, 0.6))
    assert narrow.told.wo[0, 2].min() > 0.999
    assert wide.told.wo[0, 2].min() < 0.8
    assert wide.told.wo[0, 0, 30, 0] > 0.4  # a point on the left sees the eye to its right
    for guess in (narrow, wide):
        assert guess.ln_radiance.shape == (1, 3, 64, 128)
        assert guess.confidence_logit.shape == (1, 1, 64, 128)
        assert guess.told.irradiance.shape == (1, 3, 128, 128)


def test_nothing_outside_the_mask_is_lifted():
    torch.manual_seed(0)
    net = LightNet().eval()
    photo = torch.rand(1, 4, 128, 128)
    photo[:, 3, :, 64:] = 0
    with torch.no_grad():
        told = net(photo, torch.tensor([[0.1]])).told
    assert told.weight[..., 32:].abs().max() == 0
    assert told.irradiance[..., 64:].abs().max() == 0


def test_no_seam_shows_where_two_sides_disagree():
    """Each side's own account, a ramp over all its columns, is faded into the other's."""
    circle = torch.rand(1, 1, 4, 64)
    torch.testing.assert_close(_close(_wrap(circle, 8), 8), circle)
    ramp = torch.linspace(0, 1, 80).expand(1, 1, 4, 80)  # the seam's two sides differ by 0.8
    closed = _close(ramp, 8)
    steps = (torch.roll(closed, -1, dims=3) - closed).abs()
    assert steps[..., -1].max() < 0.06
    assert steps.max() < 0.08
