"""The network that is given the whole photo: what its context and its light sources add, and how they are learned."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe.dataset.asset_store import draw_map  # noqa: E402
from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.pairs import PairSource  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe.errors import ModelError  # noqa: E402
from anyprobe.estimate.runtime import Models  # noqa: E402
from anyprobe.nets.context_net import CODE, ContextNet  # noqa: E402
from anyprobe.nets.source_head import RADII_DEG, SOURCES, SourceHead, SourceMap  # noqa: E402
from anyprobe.train.checkpoint import load_init_weights, save_init_weights  # noqa: E402
from anyprobe.train.config import heads, smoke, whole  # noqa: E402
from anyprobe.train.export_onnx import export_graphs  # noqa: E402
from anyprobe.train.lift import Lift  # noqa: E402
from anyprobe.train.loop import load_nets, train  # noqa: E402
from anyprobe.train.source_profiles import source_profiles  # noqa: E402
from anyprobe.train.whole import Whole, posture_losses, profile_loss  # noqa: E402


def cap(direction, radius_deg: float) -> torch.Tensor:
    d = pixel_directions(64) @ (np.float32(direction) / np.linalg.norm(direction)).astype(np.float32)
    return torch.from_numpy((d > np.cos(np.radians(radius_deg))).astype(np.float32))


def test_no_context_changes_what_the_weights_before_it_say(tmp_path):
    """Weights of `lift` in the larger network: the same map but for its light sources, cut-out or untrained."""
    torch.manual_seed(0)
    before = Lift.networks()
    torch.save(before.state_dict(), tmp_path / "lift.pt")
    after = Whole.networks()
    load_init_weights(after, tmp_path / "lift.pt")
    batch = some_batch(2)
    with torch.no_grad():
        old = before["light"].eval()(batch.photo, batch.tan_half[:, None])
        code = torch.randn(2, CODE, generator=torch.Generator().manual_seed(1))
        code[0] = 0.0
        new = after["light"].eval()(batch.photo, batch.tan_half[:, None], context=code)
    for name in ("ln_shown", "ln_power", "posterior", "confidence_logit"):
        torch.testing.assert_close(getattr(old, name), getattr(new, name))
    torch.testing.assert_close(old.emitter_logit[0], new.emitter_logit[0])
    torch.testing.assert_close(old.ln_expected[0], new.ln_expected[0])
    assert not torch.allclose(old.emitter_logit[1], new.emitter_logit[1], atol=1e-3)


def test_empty_context_has_a_code():
    net = ContextNet()
    picture = torch.rand(3, 5, 96, 96)
    picture[1] = 0.0
    for training in (True, False):
        code, posture = net.train(training)(picture, torch.full((3, 1), 0.2))
        assert (code[1] == 0).all()
        assert (posture[1] == 0).all()
        assert (code[[0, 2]] != 0).any()
        assert torch.isfinite(code).all()


def test_drawn_sources_make_light():
    """Power is kept: what is drawn as sources is not drawn elsewhere, whatever the profiles ask for."""
    draw = SourceMap()
    generator = torch.Generator().manual_seed(0)
    shown = torch.rand(3, 3, 64, 128, generator=generator)
    above = torch.rand(3, 3, generator=generator) * torch.tensor([[0.0], [1.0], [50.0]])
    places = torch.nn.functional.normalize(torch.randn(3, SOURCES, 3, generator=generator), dim=2)
    profiles = torch.rand(3, SOURCES, len(RADII_DEG), generator=generator).cumsum(dim=2) / 4
    spread = torch.full((3, 1, 64, 128), 1 / (4 * np.pi))
    soft, drawn, powers = draw(shown, above, spread, places, profiles)
    angles = torch.from_numpy(pixel_solid_angles(64))
    for one in (drawn,):
        power = ((one - shown) * angles).sum(dim=(2, 3))
        torch.testing.assert_close(power, above, rtol=1e-3, atol=1e-3)
    assert (drawn >= soft - 1e-6).all()
    assert (soft >= shown - 1e-6).all()
    assert (powers >= 0).all()
    assert (powers[0] == 0).all()


def test_drawn_source_is_of_another_size():
    """A source whose profile says that all of it is within 16 degrees has so much there, one of 4 degrees there."""
    draw = SourceMap()
    shown, above = torch.full((1, 3, 64, 128), 0.01), torch.full((1, 3), 5.0)
    places = torch.tensor([[[0.0, 0.6, -0.8]] + [[0.0, -1.0, 0.0]] * 3])
    total = 5.0 + 0.01 * 4 * np.pi
    for last, size in enumerate((4.0, 8.0)):
        area = 1 - np.cos(np.radians(np.minimum(RADII_DEG, size)))
        profiles = torch.zeros(1, SOURCES, len(RADII_DEG))
        profiles[0, 0] = torch.from_numpy(area / area[-1]).float() * 0.7
        _, drawn, _ = draw(shown, above, torch.full((1, 1, 64, 128), 1 / (4 * np.pi)), places, profiles)
        _, found = source_profiles(drawn[:, 0])
        spread = (5.0 / total - 0.7) * (1 - np.cos(np.radians(size))) / 2
        assert found[0, 0, last] == pytest.approx(0.7 + spread, abs=0.06)
        if last:
            assert found[0, 0, last - 1] < 0.5


def test_profile_of_discs_is_not_their_area():
    """Two even discs on black: shares by area, the brighter one first; an even map has shares of the sphere."""
    radiance = 3.0 * cap([0, 0.3, -1], 6.0) + 1.0 * cap([1, 0.5, 0.2], 12.0)
    places, shares = source_profiles(radiance[None])
    one, other = (1 - np.cos(np.radians(r)) for r in (6.0, 12.0))
    first = 3 * one / (3 * one + other)
    assert places[0, 0] @ torch.tensor([0, 0.2873, -0.9578]) > np.cos(np.radians(3.0))
    assert places[0, 1] @ torch.nn.functional.normalize(torch.tensor([1, 0.5, 0.2]), dim=0) > np.cos(np.radians(6.0))
    np.testing.assert_allclose(shares[0, 0, 1:3], first, atol=0.03)
    np.testing.assert_allclose(shares[0, 0, 0], first * (4 / 6) ** 2, atol=0.08)
    np.testing.assert_allclose(shares[0, 1, 3], 1 - first, atol=0.03)
    _, even = source_profiles(torch.ones(1, 64, 128))
    np.testing.assert_allclose(even[0, 0], (1 - np.cos(np.radians(RADII_DEG))) / 2, rtol=0.15)


def test_profiles_shrink_with_the_radius():
    head = SourceHead(16)
    profiles = head.profiles(torch.randn(50, 16) * 5)
    assert (profiles.diff(dim=2) >= 0).all()
    assert (profiles > 0).all()
    assert (profiles < 1).all()


def test_mixture_on_the_sphere_has_another_integral_than_one():
    head = SourceHead(16)
    d = torch.from_numpy(pixel_directions(64)).reshape(-1, 3)
    angles = torch.from_numpy(pixel_solid_angles(64)).expand(-1, 128).reshape(-1) / (4 * np.pi)
    code = torch.randn(8, 16, generator=torch.Generator().manual_seed(0)) * 10
    density = torch.exp(head.ln_density(code, torch.ones(8, 1), d)).detach()
    np.testing.assert_allclose(density @ angles, 1.0, atol=0.01)
    assert density.max() > 3


def test_true_posture_costs_something():
    pitch, roll = 0.4, 0.1
    up = torch.tensor([[np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll), np.sin(pitch)]]).float()
    one = torch.ones(1)
    right = posture_losses(torch.tensor([[pitch, -5.0, roll, 9.0]]), up, one, one)
    wrong = posture_losses(torch.tensor([[pitch + 0.2, -5.0, roll - 0.2, -9.0]]), up, one, one)
    assert right["roll"] < 1e-3
    assert right["stands"] < 1e-3
    assert right["pitch"] < 0
    assert wrong["pitch"] > right["pitch"] + 1
    assert wrong["roll"] > 1
    assert wrong["stands"] > 1
    nothing = posture_losses(torch.zeros(1, 4), torch.zeros(1, 3), one, one)
    assert nothing["pitch"] == 0
    assert nothing["roll"] == 0
    assert profile_loss(torch.ones(2, 4, 4), torch.ones(2, 4, 4)) == 0


@pytest.fixture(scope="module")
def run():
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=1, points=64))
    illuminator = Illuminator([draw_map(np.random.default_rng(0), height=32)[0]], compiled=False)

    def call(folder, named, stop_after=None, steps=3, start=None):
        config = smoke(named(), steps)
        config = replace(config, pairs=replace(config.pairs, merged_surroundings=0.0))
        pairs = PairSource(illuminator, surfaces, config.pairs)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # TensorBoard warns about itself
            return train(config, data=None, runs=folder, stop_after=stop_after, pairs=pairs, start=start)

    return call


def test_heads_that_go_on_are_others(run, tmp_path):
    """To the bit, with features of the run before, or without; and nothing but the heads learns."""
    straight = torch.load(run(tmp_path / "a", heads), weights_only=True)["nets"]
    run(tmp_path / "b", heads, stop_after=2)
    resumed = torch.load(run(tmp_path / "b", heads), weights_only=True)["nets"]
    torch.manual_seed(smoke(heads()).seed)
    untrained = Whole.networks().state_dict()
    for name, value in straight.items():
        assert torch.equal(value, resumed[name]), name
        learned = name.startswith(("context.", "light.sources."))
        assert learned or torch.equal(value, untrained[name]), name
    assert not torch.equal(straight["light.sources.profile.0.weight"], untrained["light.sources.profile.0.weight"])


def test_kept_heads_carry_the_body_twice_or_not_at_all(run, tmp_path):
    """Kept beside what they began from, heads are what they learned; read again, they are everything."""
    body = tmp_path / "lift.pt"
    torch.manual_seed(5)
    torch.save(Lift.networks().state_dict(), body)
    checkpoint = run(tmp_path / "runs", heads, steps=1, start=body)
    save_init_weights(checkpoint, tmp_path / "heads.pt")
    assert not any("object.first" in name for name in torch.load(tmp_path / "heads.pt", weights_only=True)["nets"])
    nets = Whole.networks()
    load_init_weights(nets, tmp_path / "heads.pt")
    for name, value in torch.load(checkpoint, weights_only=True)["nets"].items():
        torch.testing.assert_close(nets.state_dict()[name], value, atol=1e-3, rtol=1e-3, msg=name)
    torch.save({}, body)
    with pytest.raises(ModelError, match=r"heads\.pt"):
        load_init_weights(Whole.networks(), tmp_path / "heads.pt")


@pytest.mark.filterwarnings("ignore")  # of the exporter
def test_exported_heads_say_something_else(run, tmp_path):
    """The graph takes what that of `lift` takes; its map is that of the network without context."""
    checkpoint = run(tmp_path / "runs", heads, steps=1)
    assert export_graphs(checkpoint, tmp_path)["light"] < 0.01
    batch = some_batch(1)
    outputs = Models(str(tmp_path), threads=1)(batch.photo[0].permute(1, 2, 0).numpy(), float(batch.tan_half[0]))
    with torch.no_grad():
        guess = load_nets(checkpoint)["light"](batch.photo, batch.tan_half[:, None])
    off = np.abs(outputs.ln_radiance - guess.ln_radiance[0].permute(1, 2, 0).numpy())
    assert np.median(off) < 0.01


def test_whole_run_leaves_out_its_heads(run, tmp_path):
    stored = torch.load(run(tmp_path, whole, steps=2), weights_only=True)["nets"]
    torch.manual_seed(smoke(whole()).seed)
    untrained = Whole.networks().state_dict()
    for name in ("context.code.1.weight", "light.object.context.weight", "light.sources.direction.2.weight"):
        assert not torch.equal(stored[name], untrained[name]), name
