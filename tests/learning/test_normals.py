"""The network of normals: what its loss means, and that it learns alone before the rest goes on from it."""

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from support.some_batch import some_batch  # noqa: E402
from torch.nn import functional as F  # noqa: E402

from anyprobe.core.frames import rotation_x  # noqa: E402
from anyprobe_train.train.lift import Normals, normals_loss  # noqa: E402


def facing(count: int = 2) -> torch.Tensor:
    """Unit normals [count, 3, 64, 64] that all point to the camera."""
    return torch.tensor([0.0, 0.0, 1.0])[None, :, None, None].expand(count, 3, 64, 64)


def full_batch(normals: torch.Tensor):
    """A batch whose objects fill their photos."""
    batch = some_batch(len(normals))
    batch.photo[:, 3] = 1.0
    return replace(batch, normals=F.interpolate(normals, scale_factor=2))


@pytest.mark.parametrize("degrees", [0.0, 20.0, 90.0])
def test_loss_is_one_less_the_cosine_of_the_error(degrees):
    turn = torch.from_numpy(rotation_x(torch.pi * degrees / 180)).float()
    turned = torch.einsum("ij,njhw->nihw", turn, facing())
    expected = 1 - torch.cos(torch.tensor(torch.pi * degrees / 180))
    torch.testing.assert_close(normals_loss(turned, full_batch(facing())), expected, atol=1e-6, rtol=0)


def test_only_inner_pixels_of_the_object_and_those_asked_for_count():
    batch = full_batch(facing())
    wrong = facing().clone()
    wrong[:, :, :, :16] *= -1
    assert normals_loss(wrong, batch) > 0.4
    batch.photo[:, 3, :, :32] = 0.9  # a soft edge of the mask
    assert normals_loss(wrong, batch) == 0.0
    batch.photo[:, 3] = 1.0
    where = torch.ones(2, 1, 64, 64)
    where[..., :16] = 0.0
    assert normals_loss(wrong, batch, where) == 0.0
    assert normals_loss(wrong, batch, torch.zeros_like(where)) == 0.0


def test_only_normals_learn():
    torch.manual_seed(0)
    learner = Normals(None, "cpu")
    loss = learner.losses(some_batch(2), 0.0)["normals"]
    loss.backward()
    learning = {name for name, p in learner.nets.named_parameters() if p.grad is not None}
    assert learning == {name for name, _ in learner.nets.named_parameters() if name.startswith("light.normals.")}
