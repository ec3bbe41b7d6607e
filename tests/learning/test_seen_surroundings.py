"""What training photos show of the map: inside the frame, beside the object, as a camera sees it."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.frames import rotation_y  # noqa: E402
from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.core.response import MEAN_CURVE, response  # noqa: E402
from anyprobe_train.dataset.seen_surroundings import MAX_OTHERS, draw_frame, gather, photo_surroundings  # noqa: E402


def tone(light: torch.Tensor) -> torch.Tensor:
    return response(light, MEAN_CURVE)


def waves() -> torch.Tensor:
    """A map [1, 3, 64, 128] between 0.1 and 0.7."""
    return torch.from_numpy(0.4 + 0.3 * np.sin(2 * pixel_directions(64) + 1)).float().permute(2, 0, 1)[None]


def disc() -> torch.Tensor:
    """A mask [1, 1, 128, 128] that fills most of its crop."""
    y, x = torch.meshgrid(torch.arange(128) - 63.5, torch.arange(128) - 63.5, indexing="ij")
    return (x**2 + y**2 < 50**2).float()[None, None]


def test_frames_hold_the_crop_and_are_45_to_80_degrees_wide():
    rng = np.random.default_rng(0)
    for tan_half in (0.05, 0.2, 0.45):
        frames = np.array([draw_frame(rng, tan_half) for _ in range(200)])
        x0, x1, y0, y1 = frames.T
        assert (x0 <= -tan_half + 1e-9).all()
        assert (x1 >= tan_half - 1e-9).all()
        assert (y0 <= -tan_half + 1e-9).all()
        assert (y1 >= tan_half - 1e-9).all()
        longer = np.degrees(2 * np.arctan(np.maximum(x1 - x0, y1 - y0) / 2))
        assert longer.min() >= 45.0 - 1e-6
        assert longer.max() <= 80.0 + 1e-6
        assert 0.3 < (x1 - x0 > y1 - y0).mean() < 0.7


def test_an_empty_frame_shows_nothing():
    assert not photo_surroundings(waves(), disc(), torch.tensor([0.1]), np.zeros((1, 4)), tone).any()


def test_other_photos_show_more_of_the_same_map():
    """Own window as it is; elsewhere the map, off by no more than 3 columns and a gain; those not chosen as before."""
    rng = np.random.default_rng(3)
    count, tan_half = 24, 0.2
    light, mask = waves().expand(count, 3, 64, 128), disc().expand(count, 1, 128, 128)
    angles = torch.full((count,), tan_half)
    frames = np.stack([draw_frame(rng, tan_half) for _ in range(count)])
    own = photo_surroundings(light, mask, angles, frames, tone)
    chosen = np.arange(count) % 2 == 0
    all_seen = gather(own, light, mask, angles, chosen, rng, tone)
    assert torch.equal(all_seen[~chosen], own[~chosen])
    assert torch.equal(torch.where(own[:, 3:] == 1, all_seen, own), own)
    more = all_seen[chosen][:, 3].mean(dim=(1, 2)) / own[chosen][:, 3].mean(dim=(1, 2))
    assert more.min() >= 1.0
    assert 1.5 < more.mean() < MAX_OTHERS + 1
    assert all_seen[:, 3].max() <= 1.0
    behind = all_seen[chosen][:, 3, :, :32].mean()  # behind the camera, which its own photo cannot show
    assert behind > 0.1
    assert own[:, 3, :, :32].max() == 0.0
    sure = (all_seen[chosen][:, 3] > 0.999) & (own[chosen][:, 3] < 0.001)
    shown, truth = all_seen[chosen][:, :3], tone(light[chosen])
    off = torch.stack([(shown - torch.roll(truth, k, dims=3)).abs().amax(dim=1) for k in range(-2, 3)]).amin(dim=0)
    assert off[sure].mean() < 0.05  # the gain alone
    assert off[sure].quantile(0.99) < 0.2


def test_another_cameras_window_lies_where_it_looks():
    """A camera turned a quarter to the left (yaw +90 degrees: towards -X) shows the map's middle of the left half."""
    frame = np.array([[-0.3, 0.3, -0.2, 0.2]])
    turn = rotation_y(np.pi / 2)[None]
    light, mask = torch.zeros(1, 3, 64, 128), torch.zeros(1, 1, 128, 128)
    cover = photo_surroundings(light, mask, torch.tensor([0.1]), frame, tone, turn)[0, 3].numpy()
    d = pixel_directions(64)
    middle = (d * cover[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(middle / np.linalg.norm(middle), [-1, 0, 0], atol=1e-3)
