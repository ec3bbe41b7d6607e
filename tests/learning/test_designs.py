"""The comparison run: every design on the same pairs, each with its own gradient only."""

import warnings

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.core.latlong import direction_to_uv, pixel_directions  # noqa: E402
from anyprobe.core.response import response  # noqa: E402
from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.pairs import PairSource  # noqa: E402
from anyprobe.dataset.procedural_light import draw_map  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe.infer.runtime import Models  # noqa: E402
from anyprobe.nets.design_nets import ROWS  # noqa: E402
from anyprobe.train.config import designs, designs_laboratory  # noqa: E402
from anyprobe.train.designs import (  # noqa: E402
    DESIGNS,
    IMAGE,
    IMAGE_RATE,
    RIVALS,
    Designs,
    ball_places,
    grey,
    see_map,
    shrink_batch,
)
from anyprobe.train.frozen_irradiance import load_frozen_irradiance  # noqa: E402
from anyprobe.train.loop import load_nets, parameter_groups, train  # noqa: E402
from anyprobe.train.runs import smoke  # noqa: E402


@pytest.fixture(scope="module")
def learner():
    return Designs(smoke(designs()), "cpu")


def test_losses_do_not_mix(learner):
    batch = some_batch()
    for name in (*DESIGNS, *RIVALS, "hdr"):
        learner.nets.zero_grad(set_to_none=True)
        learner.losses(batch, 0.5)[name].backward()
        touched = {k for k, net in learner.nets.items() if any(p.grad is not None for p in net.parameters())}
        assert touched == {name}


def test_designs_differ_only_in_what_they_should():
    """First weights are the seed's; the second of a design begins elsewhere."""
    nets = Designs.networks()
    first = {name: torch.cat([p.flatten() for p in nets[name].parameters()]) for name in DESIGNS}
    assert torch.equal(first["direct"], first["ours"])
    assert torch.equal(first["irradiance"], first["ours"])
    assert torch.equal(first["irradiance_2"], first["ours_2"])
    assert not torch.equal(first["ours"], first["ours_2"])


def test_gradual_targets_are_blurred_early_and_sharp_at_last(learner):
    batch = some_batch()
    with torch.no_grad():
        early, late = learner.losses(batch, 0.0), learner.losses(batch, 0.95)
    assert early["ours"] < 0.5 * early["ours_sharp"]  # noise is hard to say, its mean is not
    assert late["ours"] == late["ours_sharp"]
    assert early["irradiance"] == pytest.approx(float(late["irradiance"]), rel=0.2)


def test_first_quarter_sees_the_true_irradiance(learner):
    batch = some_batch(8)
    small = shrink_batch(batch)
    seen, losses = learner._see_irradiance(batch, small)
    assert not losses  # the irradiance network is frozen
    given = int(8 * learner.config.truth_share)
    assert given == 2
    assert torch.equal(seen[:given], small.irradiance[:given])
    assert not torch.allclose(seen[given:], small.irradiance[given:], atol=0.05)


def test_an_irradiance_network_that_learns_learns_from_its_own_loss_alone():
    """From the shipped weights, slower than the others; the designs' losses do not reach it."""
    learner = Designs(smoke(designs_laboratory()), "cpu")
    batch = some_batch()
    for name in ("ours", IMAGE):
        learner.nets.zero_grad(set_to_none=True)
        learner.losses(batch, 0.5)[name].backward()
        touched = {k for k, net in learner.nets.items() if any(p.grad is not None for p in net.parameters())}
        assert touched == {name}
    frozen = dict(load_frozen_irradiance()[0].named_parameters())
    for name, value in learner.nets[IMAGE].named_parameters():
        assert torch.equal(value, frozen[name]), name
    fast, slow = parameter_groups(learner.nets)
    assert (slow["share"], len(slow["params"])) == (IMAGE_RATE, len(frozen))
    assert len(fast["params"]) + len(slow["params"]) == len(list(learner.nets.parameters()))


def test_frozen_irradiance_says_what_its_graph_says():
    net, pairs = load_frozen_irradiance()
    assert pairs == 320_000
    crop = np.random.default_rng(0).random((128, 128, 4), dtype=np.float32)
    with torch.no_grad():
        ours = net(torch.from_numpy(crop).permute(2, 0, 1)[None])[0].permute(1, 2, 0).clip(0, 1)
    np.testing.assert_allclose(ours.numpy(), Models("paper")(crop, 0.2).irradiance, atol=2e-4)


def direction_map():
    """A map whose colours are its directions, [1, 3, 32, 64]."""
    return torch.from_numpy(pixel_directions(ROWS)).permute(2, 0, 1)[None].clone()


def test_ball_shows_the_direction_that_each_pixel_mirrors():
    uv, weight = ball_places()
    ball = see_map(direction_map(), uv)[0]
    centre = ball[:, 31:33, 31:33].mean(dim=(1, 2))
    np.testing.assert_allclose(centre, [0, 0, 1], atol=0.01)  # a ball's middle mirrors the camera
    # half way out the normal is at 45 degrees and mirrors what is above
    np.testing.assert_allclose(ball[:, 15:17, 31:33].mean(dim=(1, 2)), [0, 1, 0], atol=0.06)
    assert float(weight.mean()) == pytest.approx(1.0, abs=1e-4)
    assert float(weight[0, 0, 0, 0]) == 0.0
    sphere = (weight[0, 0] * ball).mean(dim=(1, 2))  # by solid angle, directions cancel
    np.testing.assert_allclose(sphere, [0, 0, 0], atol=0.03)


def test_a_map_is_read_across_its_seam():
    uv = direction_to_uv(
        torch.nn.functional.normalize(torch.tensor([[[[0.02, 0.0, 1.0], [-0.02, 0.0, 1.0]]]]), dim=-1)
    )
    seen = see_map(direction_map(), uv)[0, :, 0]
    np.testing.assert_allclose(seen[0], [0.02, -0.02], atol=0.01)
    np.testing.assert_allclose(seen[2], [1, 1], atol=0.01)


def test_grey_is_the_display_value_of_luminance():
    radiance = torch.tensor([0.2, 0.4, 0.1])
    expected = response(np.array([0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.1]))
    np.testing.assert_allclose(grey(torch.log(radiance).reshape(1, 3, 1, 1)).flatten(), expected, rtol=1e-3)


def test_resumed_run_equals_the_straight_one_to_the_bit(tmp_path):
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=1))
    config = smoke(designs(), 4)

    def run(folder, stop_after=None):
        pairs = PairSource(illuminator, surfaces, config.pairs)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # TensorBoard warns about itself
            return train(config, data=None, runs=folder, stop_after=stop_after, pairs=pairs)

    straight = load_nets(run(tmp_path / "a"))
    run(tmp_path / "b", stop_after=2)
    resumed = load_nets(run(tmp_path / "b")).state_dict()
    for name, value in straight.state_dict().items():
        assert torch.equal(value, resumed[name]), name
