"""The tiny designs: what each sees, which steps their scores compare, and the command that scores trained runs."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from support.some_batch import some_batch
from support.some_pair import ball_pair

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from typer.testing import CliRunner  # noqa: E402

from anyprobe.cli.app import app  # noqa: E402
from anyprobe.core.response import response  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceSet, thinned  # noqa: E402
from anyprobe.evaluate.scaling import STEPS, ScalingScores, Shown, changes, scaling_lines  # noqa: E402
from anyprobe.nets.tiny_nets import SIZE  # noqa: E402
from anyprobe.train.loop import learning_rate, make_learner, save_checkpoint  # noqa: E402
from anyprobe.train.runs import RUNS, smoke  # noqa: E402
from anyprobe.train.scaling import SCALING, world_64k, world_64k_fixed  # noqa: E402
from anyprobe.train.tiny_designs import IMAGE, SHOWN, TINY, TinyDesigns  # noqa: E402
from anyprobe.train.tiny_methods import TinyMethods, small_map  # noqa: E402


def tiny_batch(count: int = 4):
    batch = some_batch(count)
    return replace(
        batch, photo=batch.photo[..., :SIZE, :SIZE], irradiance=batch.irradiance[..., :SIZE, :SIZE]
    )


@pytest.fixture(scope="module")
def learner():
    return TinyDesigns(smoke(world_64k()), "cpu")


def test_runs_differ_in_their_length_and_their_photos_alone():
    first = asdict(world_64k())
    for run in [run for run in SCALING if "fixed" not in run.__name__]:
        config = asdict(RUNS[run.__name__]())
        assert config.pop("name") == run.__name__
        assert config["steps"] * config["pairs"]["batch"] == (640_000 if "640k" in run.__name__ else 64_000)
        assert config["pairs"].pop("laboratory") == run.__name__.startswith("laboratory")
        for name in ("name", "steps"):
            config.pop(name, None)
        expected = {key: value for key, value in first.items() if key in config}
        expected["pairs"] = {key: value for key, value in first["pairs"].items() if key != "laboratory"}
        assert config == expected


def test_the_fixed_run_differs_in_its_end_alone():
    """A rate that stays, and maps that sharpen to the last step."""
    first, fixed = asdict(world_64k()), asdict(RUNS["world_64k_fixed"]())
    changed = {key: value for key, value in fixed.items() if value != first[key]}
    assert changed == {"name": "world_64k_fixed", "cooldown": 0.0, "gradual_share": 1.0}
    for place in ("world", "laboratory"):
        fixed, again = (asdict(RUNS[f"{place}_64k_fixed{end}"]()) for end in ("", "_again"))
        assert fixed == asdict(RUNS[f"{place}_64k"]()) | {**changed, "name": f"{place}_64k_fixed"}
        assert again["pairs"].pop("seed") == fixed["pairs"].pop("seed") + 1
        assert again == fixed | {"name": f"{place}_64k_fixed_again"}
    rates = {learning_rate(world_64k_fixed(), step) for step in range(100, 1000)}
    assert rates == {world_64k().learning_rate}


def test_the_log_tells_by_how_much_losses_change_from_step_to_step():
    """Mean over a row's steps, the first of which has none before it; nothing is learned from these."""
    learner = TinyDesigns(smoke(world_64k()), "cpu")
    batches = [tiny_batch(), replace(tiny_batch(), photo=1 - tiny_batch().photo)]
    seen = [learner.losses(batch, 0.5) for batch in (*batches, batches[0])]
    assert set(seen[0]) == set(learner.columns)
    for name in SHOWN:
        assert seen[0][f"{name}_change"] == 0.0
        for before, after in zip(seen, seen[1:], strict=False):
            assert after[f"{name}_change"] == abs(after[name] - before[name]) != 0.0
            assert not after[f"{name}_change"].requires_grad


def test_losses_do_not_mix(learner):
    batch = tiny_batch()
    for name in (*TINY, IMAGE):
        learner.nets.zero_grad(set_to_none=True)
        learner.losses(batch, 0.5)[name].backward()
        touched = {k for k, net in learner.nets.items() if any(p.grad is not None for p in net.parameters())}
        assert touched == {name}


def test_direct_sees_the_photo_and_the_others_irradiance(learner):
    batch = tiny_batch()
    other = replace(batch, irradiance=1.0 - batch.irradiance)
    with torch.no_grad():
        before, after = learner.losses(batch, 0.95), learner.losses(other, 0.95)
    for name, design in TINY.items():
        assert (before[name] != after[name]) == design.sees_irradiance, name


def test_targets_of_ours_alone_sharpen(learner):
    with torch.no_grad():
        early, late = learner.losses(tiny_batch(), 0.0), learner.losses(tiny_batch(), 0.95)
    for name, design in TINY.items():
        assert (early[name] != late[name]) == design.gradual, name
    assert early["ours"] < 0.8 * early["ours_sharp"]  # noise is hard to say, its mean is not
    assert late["ours"] == late["ours_sharp"]


def test_a_thinned_surface_keeps_every_fourth_pixel():
    normals = np.zeros((1, 3, 8, 8), np.float16)
    normals[0, 0] = np.arange(64).reshape(8, 8)
    surfaces = SurfaceSet(normals=normals, tan_half=np.ones(1), elevation=np.zeros(1))
    assert thinned(surfaces, 1) is surfaces
    np.testing.assert_array_equal(thinned(surfaces, 4).normals[0, 0], [[18, 22], [50, 54]])


def shown(**gains) -> Shown:
    truth = np.random.default_rng(0).random((16, 32, 3))
    picture = np.random.default_rng(1).random((32, 32, 3))
    return Shown(
        maps={name: truth + gain for name, gain in gains.items()},
        irradiance=picture - 0.25,
        true_map=truth,
        true_irradiance=picture,
    )


def test_steps_are_paired_and_mean_both_first_weights():
    """Errors are offsets here, so that RMSEs are known."""
    scores = ScalingScores()
    rest = {"irradiance, told": 0.0, "irradiance_2, told": 0.0, "ours, told": 0.0, "ours_2, told": 0.0}
    for extra in (0.0, 0.02):
        ours = {"ours": 0.2, "ours_2": 0.3, "irradiance": 0.4 + extra, "irradiance_2": 0.3}
        scores.add(shown(direct=0.5, direct_2=0.3, **ours, **rest), f"map {extra}", "shape")
    found = scores.result()
    assert found["irradiance"]["rmse"] == pytest.approx(0.25)
    step = found["order"]["direct -> irradiance"]["ldr_rmse"]
    assert step["seeds"] == pytest.approx([-0.09, 0.0])
    assert step["mean"] == pytest.approx(-0.045)
    assert step["standard_error"] == pytest.approx(0.005)  # of -0.05 and -0.04
    scores.maps = ["map"] * 2
    assert scores.result()["order"]["direct -> irradiance"]["ldr_rmse"]["standard_error"] is None
    scores.shapes = ["one", "other"]
    assert scores.result()["order"]["direct -> irradiance"]["ldr_rmse"] == step
    assert found["order"]["ours -> ideal"]["ldr_rmse"]["mean"] == pytest.approx(-0.25)
    content = {"runs": {"world_64k": {"pairs": 64_000, **found}}, "pairs": 2, "command": "c", "commit": "d"}
    page = "\n".join(scaling_lines(content))
    assert "| world | 64,000 | ldr rmse | +0.04500 +- 0.00500, holds |" in page
    assert "its standard error (by map);" in page  # as files of before have it
    told = "\n".join(scaling_lines(content | {"standard_errors": "by map and shape"}))
    assert "its standard error (by map and shape);" in told
    row = next(line for line in page.splitlines() if line.startswith("| world | 64,000 | 0.2500"))
    assert row.split(" | ")[4] == "0.4000"  # direct, mean of both
    assert "Change of the loss" not in page


def test_the_page_tells_how_much_losses_change():
    """Of themselves, after the first tenth of a run; the run is a kind of its own."""
    columns = {name: [9.0] + [0.5] * 9 for name in ("ours", "ours_2", "irradiance", "irradiance_2")}
    columns |= {"ours_sharp": [0.5] * 10, "ours_2_sharp": [0.5] * 10}
    columns |= {f"{name}_change": [9.0] + [0.01 * k] * 9 for k, name in enumerate(list(columns), start=1)}
    found = changes(columns)
    assert found["changes"]["irradiance_2"] == pytest.approx(0.08)
    assert changes({"ours": [1.0]}) == {}
    scores = ScalingScores()
    told = [f"{name}, told" for name, one in TINY.items() if one.sees_irradiance]
    scores.add(shown(**dict.fromkeys([*TINY, *told], 0.1)), "map", "shape")
    run = {"pairs": 64_000, **scores.result(), **found}
    content = {"runs": {"world_64k_fixed": run}, "pairs": 1, "command": "c", "commit": "d"}
    page = "\n".join(scaling_lines(content))
    assert "| world, the paper's schedule | 64,000 |" in page
    assert (
        "irradiance 6.0% and 8.0%, ours, against its target 2.0% and 4.0%, ours, against the sharp map"
        in page
    )


@pytest.fixture
def trained(tmp_path):
    """A run that has learned nothing, as training would leave it."""
    config = replace(smoke(world_64k()), name="world_64k")
    nets = make_learner(config, "cpu").nets
    (tmp_path / "world_64k").mkdir()
    (tmp_path / "world_64k" / "log.csv").write_text("step,ours,learning_rate\n25,0.5,0.001\n")
    path = tmp_path / "world_64k" / "checkpoint.pt"
    save_checkpoint(path, nets, config, torch.optim.AdamW(nets.parameters()), 5, 320)
    return path


def test_a_checkpoint_sees_each_fourth_pixel_of_a_pair(trained):
    pair = ball_pair(0)
    found = TinyMethods(trained)(pair)
    assert set(found.maps) == {*TINY, *(f"{name}, told" for name, one in TINY.items() if one.sees_irradiance)}
    for ldr in found.maps.values():
        assert ldr.shape == (16, 32, 3)
    np.testing.assert_allclose(found.true_irradiance, pair.irradiance[2::4, 2::4] / 255.0, atol=1e-6)
    np.testing.assert_allclose(
        found.true_map[3, 5], response(pair.radiance)[12:16, 20:24].mean((0, 1)), atol=1e-6
    )
    np.testing.assert_array_equal(small_map(response(pair.radiance)), found.true_map)
    hidden = np.array(pair.photo)
    hidden[0::4], hidden[1::4], hidden[3::4] = 0, 0, 0
    again = TinyMethods(trained)(replace(pair, photo=hidden))
    np.testing.assert_array_equal(again.maps["direct"], found.maps["direct"])


def test_the_command_scores_the_runs_that_are_there(trained, tmp_path, monkeypatch):
    from anyprobe.evaluate import kept_pairs

    asked = []

    def pairs(recipes, stock, kept, laboratory):
        asked.append((laboratory, {recipe.conditions for recipe in recipes}))
        return iter([ball_pair(seed) for seed in range(len(recipes))])

    monkeypatch.setattr(kept_pairs, "kept_pairs", pairs)
    for name in ("load_maps", "load_shapes"):
        monkeypatch.setattr(f"anyprobe.dataset.catalog.{name}", lambda folder, report: {})
    where = ["--hdri", "h", "--meshes", "m", "-o", str(tmp_path / "out"), "--pairs", "3"]
    result = CliRunner().invoke(app, ["scaling", "--runs", str(trained.parents[1]), *where])
    assert result.exit_code == 0, result.output
    content = json.loads((tmp_path / "out" / "scaling.json").read_text())
    assert asked == [(False, {0})]
    assert content["pairs"] == 3
    assert content["runs"]["world_64k"]["pairs"] == 320
    assert content["standard_errors"] == "by map and shape"
    assert set(content["runs"]["world_64k"]["order"]) == set(STEPS)


def test_without_a_run_the_command_says_which_it_wants(tmp_path):
    from anyprobe.errors import InputError

    result = CliRunner().invoke(app, ["scaling", "--hdri", "h", "--meshes", "m", "--runs", str(tmp_path)])
    assert isinstance(result.exception, InputError)
    assert "expected one of the runs world_64k" in str(result.exception)
    assert not list(tmp_path.iterdir())
