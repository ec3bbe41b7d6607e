"""The chain's targets: Eq. 6 as a schedule, a teacher's maps."""

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.light.filtering import blur_cosine_power  # noqa: E402
from anyprobe_train.nets.light_net import LightNet  # noqa: E402
from anyprobe_train.train.chain import GRADUAL_SHARE, NUM_EPOCHS, Chain, brightest_loss, gradual_target, sharpness  # noqa: E402
from anyprobe_train.train.config import paper, smoke  # noqa: E402


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


def test_targets_lie_between_the_truth_and_the_teachers_maps():
    chain, batch = Chain(smoke(paper()), "cpu"), some_batch(2)
    assert torch.equal(chain._taught(batch), batch.ldr)
    chain.learn_from(LightNet())
    between = chain._taught(batch)
    chain.config = replace(chain.config, taught=1.0)
    teachers = chain._taught(batch)
    assert (teachers - batch.ldr).abs().mean() > 0.1
    share = smoke(paper()).taught
    torch.testing.assert_close(between, share * teachers + (1 - share) * batch.ldr)


def test_as_much_light_as_the_truth_has_wherever_it_is():
    true = torch.full((1, 3, 64, 128), 0.2)
    true[:, :, 8:24, 32:80] = 1.0  # a tenth of the map
    moved, blurred = true.roll((8, 40), dims=(2, 3)), torch.full_like(true, float(true.mean()))
    grain = torch.where(torch.rand(true.shape) < 0.1, 1.0, 0.2)
    assert brightest_loss(moved, true) == 0
    assert brightest_loss(blurred, true) > 0.5
    assert brightest_loss(grain, true) > 0.3, "pixels are no patches"
    colored = true.clone()
    colored[:, 1:] = 0.2
    colored[:, 1:, 40:56, 32:80] = 1.0
    assert brightest_loss(colored, true) > 0.1, "red here and cyan there are no white light"


def test_hdr_net_learns_the_power_of_the_map_that_it_helps_to_make():
    """A source that the estimate shows white: the network's own pixels must say how bright it is."""
    chain, batch = Chain(smoke(paper()), "cpu"), some_batch(2)
    estimate = torch.full((2, 3, 64, 128), 0.2)
    estimate[:, :, 10:14, 30:34] = 1.0
    losses = []
    for bright in (0.0, 6.0):
        ln = torch.full_like(estimate, -2.0)
        ln[:, :, 10:14, 30:34] = bright
        first = batch.ln_radiance[:1]  # the true map that is learned from
        with torch.no_grad():
            losses.append(float(chain._hdr_loss(estimate, replace(batch, ln_radiance=torch.cat([first, ln[1:]])), 0.5)))
    assert losses[1] > losses[0] + 0.3
