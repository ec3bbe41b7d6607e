"""What training photos show of the map: inside the frame, beside the object, as a camera sees it."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.frames import rotation_y  # noqa: E402
from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.core.response import MEAN_CURVE, response  # noqa: E402
from anyprobe_train.dataset.seen_surroundings import draw_frame, photo_surroundings  # noqa: E402


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


def test_another_cameras_window_lies_where_it_looks():
    """A camera turned a quarter to the left (yaw +90 degrees: towards -X) shows the map's middle of the left half."""
    frame = np.array([[-0.3, 0.3, -0.2, 0.2]])
    turn = rotation_y(np.pi / 2)[None]
    light, mask = torch.zeros(1, 3, 64, 128), torch.zeros(1, 1, 128, 128)
    cover = photo_surroundings(light, mask, torch.tensor([0.1]), frame, tone, turn)[0, 3].numpy()
    d = pixel_directions(64)
    middle = (d * cover[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(middle / np.linalg.norm(middle), [-1, 0, 0], atol=1e-3)
