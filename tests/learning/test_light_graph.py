"""The front and back of light.onnx, in torch, against what they stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.frames import rotation_x, rotation_y, turn_towards  # noqa: E402
from anyprobe.core.response import inverse_response  # noqa: E402
from anyprobe.estimate.light_graph import graph_inputs  # noqa: E402
from anyprobe.light.environment import rotate  # noqa: E402
from anyprobe.light.harmonics import project  # noqa: E402
from anyprobe_train.light_graph.back import Back  # noqa: E402
from anyprobe_train.light_graph.background import plain_and_dark, solve  # noqa: E402
from anyprobe_train.light_graph.front import Front, Given  # noqa: E402
from anyprobe_train.light_graph.front import turn_towards as turned_towards  # noqa: E402
from anyprobe_train.light_graph.known_parts import KnownParts  # noqa: E402
from anyprobe_train.light_graph.sampling import read_weights, shrink  # noqa: E402


def ball(height: int = 90, width: int = 120, at: tuple[int, int] = (50, 70), radius: int = 20) -> np.ndarray:
    """Return the mask of a disc."""
    rows, columns = np.mgrid[:height, :width]
    return ((rows - at[0]) ** 2 + (columns - at[1]) ** 2 < radius**2).astype(np.float32)


def noise(*shape: int) -> np.ndarray:
    """Return smooth-free random values in [0, 1]."""
    return np.random.default_rng(0).random(shape, dtype=np.float32)


def given_of(rgb: np.ndarray, mask: np.ndarray, **known) -> Given:
    """Return the graph's inputs as its front has them."""
    return Given.of([torch.from_numpy(one) for one in graph_inputs(rgb, mask, 60.0, **known).values()])


def test_a_window_holds_the_means_of_the_pixels_it_covers():
    """Shrunk by whole numbers, samples are means of blocks; of the same size, they are the pixels."""
    axis = torch.zeros(12)
    values = torch.from_numpy(noise(12))
    means = read_weights(torch.tensor(0.0), torch.tensor(12.0), 4, axis) @ values
    assert means.numpy() == pytest.approx(values.reshape(4, 3).mean(dim=1).numpy(), abs=1e-6)
    same = read_weights(torch.tensor(2.0), torch.tensor(6.0), 6, axis) @ values
    assert same.numpy() == pytest.approx(values[2:8].numpy(), abs=1e-6)


def test_a_window_beyond_the_border_is_empty_there():
    """A mask's cover falls to zero outside the photo."""
    weights = read_weights(torch.tensor(-6.0), torch.tensor(12.0), 6, torch.zeros(12))
    assert weights.sum(dim=1).numpy() == pytest.approx([0, 0, 0, 1, 1, 1], abs=1e-6)


def test_cells_of_a_photo_whose_last_pixel_is_cut_keep_its_mean():
    """The cut pixel counts by its width."""
    picture = torch.ones(1, 3, 5)
    picture[..., -1] = 3.0
    small = shrink(picture, torch.tensor(4.5), torch.tensor(3.0), torch.tensor(4.5))
    assert small.shape == (1, 1, 1)
    assert float(small) == pytest.approx((4 * 1 + 0.5 * 3) / 4.5)


def test_the_crop_is_the_square_around_the_object():
    """Its frame looks at the box's centre, and its mask fills 1 / 1.1 of its side."""
    mask = ball()
    framed = Front().framed(given_of(noise(*mask.shape, 3), mask))
    assert framed.center.numpy() == pytest.approx([70.5, 50.5])
    assert float(framed.side) == pytest.approx(1.1 * 39)
    assert framed.crop[3].amax(dim=0).sum().item() == pytest.approx(128 / 1.1, abs=2.0)
    focal = 60 / np.tan(np.radians(30))
    ray = np.array([70.5 - 60, -(50.5 - 45), -focal])
    expected = turn_towards(ray / np.linalg.norm(ray))
    assert framed.camera_from_crop.numpy() == pytest.approx(expected, abs=1e-5)


def test_turning_towards_a_ray_is_that_of_frames():
    """The closed form in the graph is Rodrigues'."""
    ray = np.array([0.3, -0.2, -0.9])
    ray /= np.linalg.norm(ray)
    found = turned_towards(torch.from_numpy(ray).float()).numpy()
    assert found == pytest.approx(turn_towards(ray), abs=1e-6)


def test_a_large_photo_is_seen_as_its_half():
    """Block means and slices change the crop by less than a shade."""
    mask = ball(180, 240, (100, 140), 40)
    rows, columns = np.mgrid[:180, :240]
    rgb = np.stack([0.5 + 0.3 * np.sin(rows / 25 + k + columns / 40) for k in range(3)], axis=-1).astype(np.float32)
    front = Front()
    one = front.framed(given_of(rgb, mask))
    big = np.kron(rgb, np.ones((6, 6, 1), np.float32)), np.kron(mask, np.ones((6, 6), np.float32))
    other = front.framed(given_of(*big))
    assert (one.crop - other.crop).abs().mean().item() < 0.005
    assert one.camera_from_crop.numpy() == pytest.approx(other.camera_from_crop.numpy(), abs=2e-3)


def test_what_is_seen_lies_where_the_lens_puts_it():
    """A red left half of the photo is the left of the map, and the object hides what is behind it."""
    mask = ball(90, 120, (45, 60), 15)
    rgb = np.zeros((90, 120, 3), np.float32)
    rgb[:, :60, 0] = 0.8
    given, front = given_of(rgb, mask), Front()
    seen = front.seen(given, front.framed(given), torch.eye(3)).numpy()
    left, right = seen[0, 32, 57], seen[0, 32, 70]
    assert left == pytest.approx(0.8, abs=0.02)
    assert right == 0.0
    assert seen[3, 32, 63] == 0.0
    assert seen[3, 32, 58] == 1.0
    assert seen[3, 32, 0] == 0.0


def test_turning_a_map_back_is_rotate():
    """The graph's bilinear reading is environment.rotate."""
    values = noise(64, 128, 3)
    turn = rotation_y(0.4) @ rotation_x(0.2)
    found = Back().turned(torch.from_numpy(values).permute(2, 0, 1), torch.from_numpy(turn).float())
    assert found.permute(1, 2, 0).numpy() == pytest.approx(rotate(values, turn), abs=2e-3)


def test_harmonics_are_project():
    """Nine numbers a channel, to rounding."""
    values = noise(64, 128, 3)
    found = Back().harmonics(torch.from_numpy(values).permute(2, 0, 1)).numpy()
    assert found == pytest.approx(project(values), abs=1e-4)


def test_elimination_solves():
    """A positive definite system."""
    rows = noise(6, 6).astype(np.float64)
    a, b = rows @ rows.T + np.eye(6), noise(6, 2)
    found = solve(torch.from_numpy(a).float(), torch.from_numpy(b)).numpy()
    assert found == pytest.approx(np.linalg.solve(a, b), abs=1e-4)


@pytest.mark.parametrize(
    ("background", "expected"),
    [("black", (1, 1)), ("shaded", (1, 0)), ("transparent", (1, 0)), ("texture", (0, 0)), ("unlit", (0, 1))],
)
def test_backgrounds_that_say_nothing_of_the_light(background: str, expected: tuple[int, int]):
    """Plain: of one colour, of smooth shading, transparent. Dark: textured, but far darker than the object."""
    mask = ball()
    cover = None
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]]
    beside = {
        "black": np.zeros((*mask.shape, 3)),
        "shaded": np.repeat((0.4 + 0.2 * rows / 90 + 0.1 * (columns / 120) ** 2)[..., None], 3, axis=-1),
        "transparent": noise(*mask.shape, 3),
        "texture": noise(*mask.shape, 3),
        "unlit": 0.2 * noise(*mask.shape, 3),
    }[background]
    if background == "transparent":
        cover = mask
    rgb = np.where(mask[..., None] > 0, 0.6, beside).astype(np.float32)
    found = plain_and_dark(given_of(rgb, mask, cover=cover).photo)
    assert tuple(int(one) for one in found) == expected


def test_known_parts_are_kept_as_they_are():
    """Where the cover is whole the map is what is seen, and as sure as that; a mirror's clipped light may be more."""
    guess, seen = torch.full((3, 64, 128), 0.2), torch.zeros(5, 64, 128)
    seen[:3, 20:40, 50:80], seen[3, 20:40, 50:80] = 0.5, 1.0
    radiance, confidence = KnownParts()(guess, torch.full((64, 128), 0.3), seen, torch.tensor(1.0))
    assert radiance[:, 30, 60].numpy() == pytest.approx(inverse_response(np.full(3, 0.5)), abs=1e-5)
    assert float(confidence[30, 60]) == pytest.approx(0.9)
    assert float(confidence[60, 0]) == pytest.approx(0.3)
    beside, far = float(radiance[0, 30, 84]), float(radiance[0, 30, 0])
    assert beside > far > 0.2


def test_an_empty_mask_gives_the_whole_photo():
    """No number is lost to it."""
    given = given_of(noise(90, 120, 3), np.zeros((90, 120), np.float32))
    framed = Front().framed(replace(given, window=torch.zeros(4, 1, 1)))
    assert framed.center.numpy() == pytest.approx([60, 45])
    assert all(torch.isfinite(one).all() for one in (framed.crop, framed.camera_from_crop, framed.well_exposed))
