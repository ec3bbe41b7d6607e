"""The HDR network's own run: it sees the paper's pairs of maps, and learns what the designs' network does."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from support.some_batch import some_batch  # noqa: E402
from typer.testing import CliRunner  # noqa: E402

from anyprobe.cli.app import app  # noqa: E402
from anyprobe.core.color import luminance  # noqa: E402
from anyprobe.core.latlong import pixel_solid_angles  # noqa: E402
from anyprobe.core.response import response  # noqa: E402
from anyprobe.dataset.map_views import MapViews, expose  # noqa: E402
from anyprobe.dataset.pair import fibonacci_viewpoint, render_map_pair  # noqa: E402
from anyprobe.dataset.plan import full_plan  # noqa: E402
from anyprobe.dataset.procedural_light import draw_map  # noqa: E402
from anyprobe.dataset.stock import Stock, own_map  # noqa: E402
from anyprobe.errors import InputError  # noqa: E402
from anyprobe.files.radiance import write_hdr  # noqa: E402
from anyprobe.train import supply  # noqa: E402
from anyprobe.train.config import designs, hdr_curves  # noqa: E402
from anyprobe.train.designs import Designs, shrink_batch  # noqa: E402
from anyprobe.train.hdr_curves import HdrCurves  # noqa: E402
from anyprobe.train.loop import load_nets, train  # noqa: E402
from anyprobe.train.runs import smoke  # noqa: E402


@pytest.fixture(scope="module")
def maps():
    rng = np.random.default_rng(0)
    return [draw_map(rng, height=64)[0] for _ in range(4)]


@pytest.fixture
def views(maps):
    return MapViews(maps, smoke(hdr_curves()).pairs)


def test_a_view_is_the_pair_that_its_recipe_renders():
    """Map, tilt, yaw, camera, exposure and both targets, with the recipe's own random numbers."""
    stock = Stock([own_map(3, 0), own_map(3, 1)])
    views = MapViews([asset.radiance for asset in stock.maps.values()], hdr_curves().pairs)
    plan = full_plan(stock, "map")
    for recipe in (plan.recipe(index) for index in range(0, 40, 7)):
        rendered = render_map_pair(recipe, stock)
        rng, (yaw, _) = recipe.rng(), fibonacci_viewpoint(recipe.view)
        which = list(stock.maps).index(recipe.map_id)
        light = views.look(which, recipe.view, yaw + rng.uniform(0, 2 * np.pi))
        exposed, shot = expose(light, recipe.material, rng)
        ldr = response(exposed.permute(1, 2, 0).numpy(), shot.curve) * 255
        assert np.abs(ldr - rendered.ldr).max() < 0.6  # it is rounded
        ln = np.log(exposed.permute(1, 2, 0).numpy())
        inside = (ln > -6.9) & (ln < 8.9)
        np.testing.assert_allclose(ln[inside], rendered.ln_radiance[inside], atol=5e-3)


def test_half_of_the_views_are_mirrored_and_none_is_new(views, maps):
    light = views.look(0, 11, 1.0)
    assert torch.equal(views.look(0, 11, 1.0, mirrored=True), light.flip(2))
    # a map that is mirrored before it is turned the other way is the same
    other = MapViews([maps[0][:, ::-1]], views.config).look(0, 11, -1.0)
    torch.testing.assert_close(other, light.flip(2), rtol=1e-3, atol=1e-4)


def test_batches_are_of_their_step_alone(maps):
    """Whatever was made before, in each lane."""
    config = replace(smoke(hdr_curves()).pairs, reuse=4)
    straight, late = MapViews(maps, config), MapViews(maps, config)
    made = [straight.batch(step) for step in range(8)]
    for step in (7, 4):
        again = late.batch(step)
        assert torch.equal(again.ldr, made[step].ldr)
        assert torch.equal(again.ln_radiance, made[step].ln_radiance)
    assert len({batch.ldr.numpy().tobytes() for batch in made}) == 8
    groups = [straight._group(*which) for which in ((0, 0), (0, 1), (1, 0))]
    assert len({light.numpy().tobytes() for group in groups for light in group}) == 3 * config.group
    other = MapViews(maps, replace(config, seed=config.seed + 1)).batch(4)
    assert not torch.equal(other.ldr, made[4].ldr)


def test_five_cameras_see_a_view_as_in_the_paper(maps):
    drawn = []

    class Counted(MapViews):
        def _draw_group(self, lane, index):
            drawn.append((lane, index))
            return [torch.ones(3, 64, 128)] * self.config.group

    config = hdr_curves().pairs
    views = Counted(maps, replace(config, batch=8, group=8))
    steps = 60
    for step in range(steps):
        views.batch(step)
    kept = config.pool * config.lanes  # not yet seen five times
    assert len(drawn) == len(set(drawn))
    assert len(drawn) - kept == pytest.approx(steps / 5, abs=config.lanes)


def test_cameras_clip_what_they_are_said_to(views):
    """5 to 15 % of the sphere before the exposure's 0.5 to 2: at half of it no view clips more, at twice none less."""
    weights = np.broadcast_to(pixel_solid_angles(64), (64, 128)) / (4 * np.pi)
    rng = np.random.default_rng(1)
    shares = {number: [] for number in range(5)}
    for k in range(60):
        light, shot = expose(views.look(k % 4, k % 23, 0.1 * k), k % 5, rng)
        seen = luminance(light.permute(1, 2, 0).numpy() / shot.white_balance)
        assert (weights * (seen >= 2)).sum() <= 0.155
        assert (weights * (2 * seen >= 1)).sum() >= 0.045
        shares[k % 5].append((weights * (seen >= 1)).sum())
    means = [np.mean(each) for each in shares.values()]
    assert means[0] < 0.07 < means[2] < 0.2 < means[4]


def test_what_is_white_has_its_true_radiance_as_its_target(views, maps):
    """White is a radiance of 1 under every curve, and the logarithm is the natural one."""
    light = views.look(0, 3, 0.5)

    class One(MapViews):
        def _draw_group(self, lane, index):
            return [light]

    batch = One(maps, replace(views.config, batch=12)).batch(0)
    white = batch.ldr == 1.0
    assert 0.02 < white.float().mean() < 0.5
    assert batch.ln_radiance[white].min() > np.log(0.98)
    assert batch.ln_radiance[~white].max() < 0.0
    assert batch.ln_radiance.max() > 1.0
    gain = batch.ln_radiance - torch.log(light)  # one of each camera's channels
    for one, inside in zip(gain.flatten(0, 1), (batch.ln_radiance.abs() < 6.9).flatten(0, 1), strict=True):
        assert inside.float().mean() > 0.5
        torch.testing.assert_close(one[inside], one[inside].mean().expand_as(one[inside]), rtol=0, atol=1e-4)
    assert len(gain.mean(dim=(1, 2, 3)).round(decimals=3).unique()) == 12


class Answer(torch.nn.Module):
    """In the network's place."""

    def __init__(self, answer):
        super().__init__()
        self.answer = answer

    def forward(self, ldr):
        assert ldr.shape == self.answer.shape
        return self.answer


def test_the_error_is_that_of_ln_radiance_mostly_where_the_map_is_white(views):
    learner, batch = HdrCurves(smoke(hdr_curves()), "cpu"), views.batch(0)
    truth = torch.nn.functional.avg_pool2d(batch.ln_radiance, 2)
    white = torch.nn.functional.avg_pool2d(batch.ldr, 2).amax(dim=1, keepdim=True) == 1.0
    losses = {}
    for name, off in (("none", torch.zeros(1)), ("all", torch.ones(1)), ("white", white), ("rest", ~white)):
        learner.nets["hdr"] = Answer(truth + off)
        losses[name] = learner.losses(batch, 0.0)["hdr"].item()
    assert losses["none"] == 0.0
    assert losses["all"] == pytest.approx(1.0, rel=1e-5)
    assert losses["white"] + losses["rest"] == pytest.approx(1.0, rel=1e-5)
    assert 2.0 < losses["white"] / white.float().mean() < 8.0


def test_it_is_the_designs_network_with_the_designs_loss():
    """On true maps alone: first weights, size of the maps, weights of the pixels."""
    batch = some_batch(4)
    batch = replace(batch, ldr=(1.3 * batch.ldr).clip(max=1.0))
    of_designs = Designs(replace(smoke(designs()), hdr_share=1.0), "cpu")
    small = shrink_batch(batch)
    expected = of_designs._hdr_loss({name: small.ldr for name in ("direct", "irradiance", "ours")}, small)
    learner = HdrCurves(smoke(hdr_curves()), "cpu")
    for name, value in of_designs.nets["hdr"].named_parameters():
        assert torch.equal(value, learner.nets["hdr"].get_parameter(name)), name
    found = learner.losses(batch, 0.5)["hdr"]
    assert found.item() == pytest.approx(expected.item(), rel=1e-2)  # bfloat16, and maps in another order


def quietly(config, **settings):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # TensorBoard warns about itself
        return train(config, data=None, compiled=False, **settings)


def test_a_run_learns_and_resumes_to_the_bit(maps, tmp_path):
    config = replace(smoke(hdr_curves(), 6), cooldown=0.0)

    def run(folder, stop_after=None):
        return quietly(config, runs=folder, stop_after=stop_after, pairs=MapViews(maps, config.pairs))

    straight = torch.load(run(tmp_path / "a"), weights_only=True)
    run(tmp_path / "b", stop_after=3)
    resumed = torch.load(run(tmp_path / "b"), weights_only=True)
    assert (resumed["step"], resumed["pairs"]) == (6, 24)
    learner, batch = HdrCurves(config, "cpu"), MapViews(maps, config.pairs).batch(9)
    before = learner.losses(batch, 0.0)["hdr"].item()
    untrained = learner.networks().state_dict()
    assert {name.partition(".")[0] for name in straight["nets"]} == {"hdr"}
    for name, value in straight["nets"].items():
        assert torch.equal(value, resumed["nets"][name]), name
        if name.endswith("weight"):
            assert not torch.equal(value, untrained[name]), name
    learner.nets.load_state_dict(straight["nets"])
    assert learner.losses(batch, 0.0)["hdr"].item() < 0.9 * before


@pytest.mark.parametrize("workers", [0, 1])
def test_a_run_sees_the_designs_maps_and_draws_no_shapes(tmp_path, monkeypatch, workers):
    """Twenty minutes would be lost on these, which it never looks at."""
    assert hdr_curves().light == designs().light
    config = smoke(hdr_curves())
    asked = []
    monkeypatch.setattr(supply, "build_surfaces", lambda *settings: asked.append(settings))
    monkeypatch.setattr(supply, "stream", lambda source, steps, workers: map(source().batch, steps))
    stock = supply.load_assets(config.light, None)
    made = supply.open_batches(config, stock, None, tmp_path, "cpu", False, range(2), workers)
    direct = MapViews(supply._maps(config.light, stock), config.pairs)
    assert [torch.equal(batch.ldr, direct.batch(step).ldr) for step, batch in enumerate(made)] == [True] * 2
    assert not asked


def test_a_run_on_maps_alone_needs_no_shapes(tmp_path):
    (tmp_path / "hdri" / "train").mkdir(parents=True)
    write_hdr(tmp_path / "hdri" / "train" / "room.hdr", own_map(5, 0).radiance)
    light = replace(hdr_curves().light, commercial_only=False)
    assert [supply.sees_objects(run) for run in (hdr_curves(), designs())] == [False, True]
    stock = supply.load_assets(light, tmp_path, supply.sees_objects(hdr_curves()))
    assert (len(stock.maps), len(stock.shapes)) == (1, 0)
    with pytest.raises(InputError, match="meshes"):
        supply.load_assets(light, tmp_path, supply.sees_objects(designs()))


def test_the_run_is_kept_in_half_floats(maps, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = replace(smoke(hdr_curves(), 3), name="hdr_curves")
    path = quietly(config, runs=tmp_path / "runs", pairs=MapViews(maps, config.pairs))
    result = CliRunner().invoke(app, ["weights", "kept", "hdr_curves"])
    assert result.exit_code == 0, result.output
    kept = tmp_path / "kept" / "checkpoint.pt"
    assert kept.stat().st_size < 0.3 * path.stat().st_size
    trained, smaller = (load_nets(one).state_dict() for one in (path, kept))
    for name, value in smaller.items():
        torch.testing.assert_close(value, trained[name], rtol=1e-3, atol=1e-6)
