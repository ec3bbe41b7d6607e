"""Eq. 6 as a schedule of targets."""

import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.light.filtering import blur_cosine_power  # noqa: E402
from anyprobe.train.chain import GRADUAL_SHARE, NUM_EPOCHS, Chain, gradual_target, sharpness  # noqa: E402
from anyprobe.train.config import paper, smoke  # noqa: E402


def test_exponent_is_the_cube_of_the_epoch():
    middles = [(e + 0.5) / NUM_EPOCHS * GRADUAL_SHARE for e in range(NUM_EPOCHS)]
    assert [sharpness(p) for p in middles] == [float(e**3) for e in range(1, 12)]


def test_the_last_steps_see_the_map_itself():
    ldr = torch.rand(1, 3, 64, 128)
    assert sharpness(0.99) is None
    assert gradual_target(ldr, 0.99) is ldr


def test_the_illumination_network_follows_the_schedule():
    """The first epochs learn a blurred map: noise is hard to say, its mean is not."""
    batch = some_batch()
    torch.manual_seed(0)
    learner = Chain(smoke(paper()), "cpu")
    with torch.no_grad():
        first, last = (float(learner.losses(batch, p)["illumination"]) for p in (0.0, 0.9))
    assert last - first > 1e-4


def test_channels_and_rows_are_not_mixed_up():
    """A channel-first map must come back as the channel-last blur of the same map."""
    ldr = torch.rand(2, 3, 64, 128)
    expected = blur_cosine_power(ldr.permute(0, 2, 3, 1), 1.0).permute(0, 3, 1, 2)
    torch.testing.assert_close(gradual_target(ldr, 0.0), expected)
    assert gradual_target(ldr, 0.0).std() < 0.1 * ldr.std()
