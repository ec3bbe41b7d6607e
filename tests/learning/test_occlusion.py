"""What objects hide from themselves: none of it on a sphere, the right side of a wall, and no light made of nothing."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.frames import world_from_camera  # noqa: E402
from anyprobe.render.mesh import make_mesh  # noqa: E402
from anyprobe.render.shapes import sphere  # noqa: E402
from anyprobe.render.surface import frame_object, see  # noqa: E402
from anyprobe_train.dataset.occlusion import AZIMUTHS, RINGS, SIDE, cell_directions, hidden_cells, mirrored_cells  # noqa: E402
from anyprobe_train.dataset.shadows import shade_hidden  # noqa: E402


def looked_at(mesh, yaw=0.0, elevation=0.0):
    surface = see(mesh, frame_object(mesh, world_from_camera(yaw, elevation), fov_deg=10.0))
    normals = np.zeros((128, 128, 3), np.float32)
    normals[surface.mask] = surface.normals
    return surface, normals[1::2, 1::2], hidden_cells(surface)


def shown(hidden):
    """[SIDE, SIDE, AZIMUTHS * RINGS] of 1 where a cell is seen."""
    bits = hidden.transpose(1, 2, 0)[..., None] >> np.arange(RINGS) & 1
    return 1 - bits.reshape(SIDE, SIDE, -1)


def corner():
    """A floor seen from above, and a wall that stands up from it towards the eye on its right."""
    boxes = []
    for low, high in (((-1, -0.1, -1), (1, 0, 1)), ((0.4, 0, -1), (0.6, 0.8, 1))):
        grid = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, -1).T
        faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
        faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
        boxes.append((grid, np.array(faces)))
    (first, faces), (second, others) = boxes
    return make_mesh(np.concatenate([first, second]), np.concatenate([faces, others + len(first)]))


def test_a_sphere_hides_nothing_that_it_faces():
    _, normals, hidden = looked_at(sphere(48))
    facing = np.maximum(normals @ cell_directions().T - 0.15, 0)
    assert (facing * (1 - shown(hidden))).sum() < 0.01 * facing.sum()


def test_a_wall_hides_the_side_on_which_it_stands():
    surface, normals, hidden = looked_at(corner(), elevation=np.pi / 2 - 1e-3)
    floor = normals[..., 2] > 0.9
    floor &= np.indices(floor.shape)[1] < 40
    near = floor & (np.indices(floor.shape)[1] > 30)
    seen = shown(hidden)[near].mean(axis=0)
    d = cell_directions()
    right, left = (d[:, 0] * side > 0.8 for side in (1, -1))
    up = (d[:, 2] > 0) & (d[:, 2] < 0.6)
    assert seen[right & up].mean() < 0.5
    assert seen[left & up].mean() > 0.95
    in_mirror = shown(mirrored_cells(hidden))[:, ::-1][near].mean(axis=0)
    assert in_mirror[left & up].mean() < 0.5
    assert in_mirror[right & up].mean() > 0.95


@pytest.fixture
def batch():
    """One hemisphere of normals, half of whose cells are hidden."""
    _, normals, _ = looked_at(sphere(32))
    n = torch.from_numpy(normals).permute(2, 0, 1)[None]
    hidden = torch.zeros(1, AZIMUTHS, SIDE, SIDE, dtype=torch.uint8)
    hidden[:, : AZIMUTHS // 4] = 255
    wo = torch.tensor([0.0, 0.0, 1.0]).expand(1, SIDE, SIDE, 3)
    return hidden, n, wo


@pytest.mark.parametrize("alpha", [0.05, 0.4, 1.0])
def test_an_object_as_bright_as_its_surroundings_hides_nothing(batch, alpha):
    even = torch.full((1, 64, 128, 3), 0.7)
    for part in shade_hidden(*batch, torch.tensor([alpha]), even, torch.full((1, 3), 0.7)):
        torch.testing.assert_close(part, torch.ones_like(part), rtol=1e-3, atol=1e-3)


def test_a_black_object_loses_what_it_hides_and_gains_nothing(batch):
    even = torch.full((1, 64, 128, 3), 0.7)
    diffuse, specular = shade_hidden(*batch, torch.tensor([0.3]), even, torch.zeros(1, 3))
    for part in (diffuse, specular):
        assert part.max() <= 1 + 1e-5
        assert part[0, 0, 20, 44] < 0.8 * part[0, 0, 44, 20]  # up and right, where the cells are hidden
