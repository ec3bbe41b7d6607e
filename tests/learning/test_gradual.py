"""Eq. 6 as a schedule of targets."""

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.light.filtering import blur_cosine_power  # noqa: E402
from anyprobe.nets import tiny_nets  # noqa: E402
from anyprobe.train.config import designs, paper  # noqa: E402
from anyprobe.train.gradual import GRADUAL_SHARE, NUM_EPOCHS, gradual_target, sharpness  # noqa: E402
from anyprobe.train.loop import make_learner  # noqa: E402
from anyprobe.train.runs import smoke  # noqa: E402
from anyprobe.train.scaling import world_64k, world_64k_fixed  # noqa: E402


def test_exponent_is_the_cube_of_the_epoch():
    middles = [(e + 0.5) / NUM_EPOCHS * GRADUAL_SHARE for e in range(NUM_EPOCHS)]
    assert [sharpness(p) for p in middles] == [float(e**3) for e in range(1, 12)]


def test_the_last_steps_see_the_map_itself():
    ldr = torch.rand(1, 3, 64, 128)
    assert sharpness(0.99) is None
    assert gradual_target(ldr, 0.99) is ldr


def test_a_run_may_sharpen_to_its_last_step():
    """As the paper's; a run that says nothing has the sharp maps it always had."""
    steps = [step / 1000 for step in range(1000)]
    assert (
        GRADUAL_SHARE == paper().gradual_share == designs().gradual_share == world_64k().gradual_share == 0.7
    )
    assert sum(sharpness(p) is None for p in steps) == 300
    assert [sharpness(p) for p in steps] == [sharpness(p, 0.7) for p in steps]
    share = world_64k_fixed().gradual_share
    assert [sharpness((e + 0.5) / NUM_EPOCHS, share) for e in range(NUM_EPOCHS)] == [
        e**3 for e in range(1, 12)
    ]
    assert None not in {sharpness(p, share) for p in (*steps, 1 - 1e-9)}
    ldr = torch.rand(1, 3, 64, 128)
    assert gradual_target(ldr, 0.999, share) is not ldr


@pytest.mark.parametrize("config", [paper(), designs(), world_64k()], ids=lambda config: config.name)
def test_every_model_with_gradual_targets_follows_its_run(config):
    """At nine tenths "ours" sees the map itself, or what the tenth epoch shows, by what its run says."""
    batch, size = some_batch(), tiny_nets.SIZE if config.model == "tiny_designs" else 128
    batch = replace(
        batch, photo=batch.photo[..., :size, :size], irradiance=batch.irradiance[..., :size, :size]
    )
    name = "illumination" if config.model == "paper" else "ours"
    losses = []
    for share in (0.7, 1.0):
        torch.manual_seed(0)  # the chain's first weights
        learner = make_learner(replace(smoke(config), gradual_share=share), "cpu")
        with torch.no_grad():
            losses.append([float(learner.losses(batch, progress)[name]) for progress in (0.9, 0.0)])
    (sharp, early), (last, first) = losses
    assert early == pytest.approx(first, rel=1e-6)
    assert sharp - last > 1e-4  # noise is hard to say, its mean is not


def test_channels_and_rows_are_not_mixed_up():
    """A channel-first map must come back as the channel-last blur of the same map."""
    ldr = torch.rand(2, 3, 64, 128)
    expected = blur_cosine_power(ldr.permute(0, 2, 3, 1), 1.0).permute(0, 3, 1, 2)
    torch.testing.assert_close(gradual_target(ldr, 0.0), expected)
    assert gradual_target(ldr, 0.0).std() < 0.1 * ldr.std()
