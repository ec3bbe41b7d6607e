"""Trained designs as methods: each is given what its name says, and nothing else."""

import json
import re
from dataclasses import asdict, replace

import numpy as np
import pytest
from support.some_pair import ball_pair
from typer.testing import CliRunner

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from anyprobe.cli.app import app  # noqa: E402
from anyprobe.core.response import response  # noqa: E402
from anyprobe.errors import InputError, ModelError  # noqa: E402
from anyprobe.evaluate.panel import score_pair  # noqa: E402
from anyprobe.light.reconstruct import THRESHOLD, blend_weight  # noqa: E402
from anyprobe.train.config import designs, designs_laboratory, hdr_curves, paper  # noqa: E402
from anyprobe.train.design_methods import DesignMethods, read_run  # noqa: E402
from anyprobe.train.designs import DESIGNS, RIVALS, Designs  # noqa: E402
from anyprobe.train.hdr_curves import HdrCurves  # noqa: E402
from anyprobe.train.runs import smoke  # noqa: E402


def checkpoint(path, config):
    nets = Designs.networks(config.irradiance_learns)
    for name in ("ours", "irradiance"):  # untrained ones of one seed are the same
        for p in nets[name].parameters():
            p.data += 0.05 * torch.randn(p.shape, generator=torch.Generator().manual_seed(len(name)))
    stored = {"nets": nets.state_dict(), "step": 7, "config": json.dumps(asdict(config))}
    torch.save(stored | {"pairs": 112}, path)
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "checkpoint.pt"
    return DesignMethods(checkpoint(path, smoke(designs())))


@pytest.fixture(scope="module")
def methods(run):
    return run.methods()


def test_every_method_scores(methods):
    pair = ball_pair()
    rows = score_pair(pair, {name: method(pair) for name, method in methods.items()})
    assert set(rows) == {
        "direct",
        "irradiance",
        "ours",
        "irradiance_2",
        "ours_2",
        "ideal",
        "georgoulis",
        "meka",
    }
    for name in ("direct", "irradiance", "ours", "ideal"):
        assert np.isfinite(rows[name]["hdr_psnr"])
    assert "hdr_psnr" not in rows["georgoulis"]
    assert "irradiance_ssim" not in rows["direct"]
    assert rows["ours"]["irradiance_ssim"] == rows["ideal"]["irradiance_ssim"]


def test_each_sees_what_its_name_says(methods):
    """The true irradiance changes ideal alone; normals change Meka alone; the map's truth only ideal's HDR."""
    pair = ball_pair()
    others = {
        "irradiance": (replace(pair, irradiance=pair.irradiance[::-1].copy()), {"ideal"}),
        "normals": (replace(pair, normals=pair.normals[:, ::-1].copy()), {"meka"}),
        "photo": (
            replace(pair, photo=np.concatenate([255 - pair.photo[..., :3], pair.photo[..., 3:]], axis=-1)),
            set(methods) - {"ideal"},
        ),
    }
    before = {name: method(pair).ldr for name, method in methods.items()}
    for changed, expected in others.values():
        moved = {
            name for name, method in methods.items() if not np.array_equal(method(changed).ldr, before[name])
        }
        assert moved == expected


def test_ideal_radiance_is_exact_where_the_true_map_is_not_saturated(methods):
    pair = ball_pair()
    radiance = methods["ideal"](pair).radiance
    below = response(pair.radiance).max(axis=-1) <= THRESHOLD
    assert 0.05 < below.mean() < 1.0
    np.testing.assert_allclose(radiance[below], pair.radiance[below], rtol=1e-3, atol=1e-5)


def test_meka_is_grey(methods):
    ldr = methods["meka"](ball_pair()).ldr
    assert np.ptp(ldr, axis=-1).max() == 0.0


def test_a_run_says_what_it_has_learned_from(tmp_path):
    run = read_run(checkpoint(tmp_path / "a.pt", smoke(designs(), 9)))
    assert (run["steps"], run["of_steps"], run["pairs"], run["irradiance_pairs"]) == (7, 9, 112, 320_000)
    with pytest.raises(ModelError, match="run of designs, got one of paper"):
        read_run(checkpoint(tmp_path / "b.pt", smoke(paper())))
    with pytest.raises(ModelError, match="anyprobe train designs"):
        read_run(tmp_path / "none.pt")


@pytest.mark.parametrize(
    ("named", "laboratory", "words"),
    [
        (designs, True, "--laboratory: expected a run of designs_laboratory, got .* leave it out"),
        (designs_laboratory, False, "expected --laboratory, where it has learned, got none; add it"),
    ],
)
def test_a_run_is_scored_where_it_has_learned(tmp_path, work, named, laboratory, words):
    """Else the other's published results would be written over, which the command finds before all else."""
    path = checkpoint(tmp_path / "checkpoint.pt", smoke(named()))
    assert read_run(path)["laboratory"] is not laboratory
    option = ["--laboratory"] if laboratory else []
    asked = ["compare", "--hdri", "h", "--meshes", "m", "--run", str(tmp_path), *option]
    refused = CliRunner().invoke(app, asked)
    assert isinstance(refused.exception, InputError)
    assert re.search(words, str(refused.exception))
    assert [one.name for one in work.iterdir()] == ["checkpoint.pt"]
    (work / "log.csv").write_text("step,pairs\n")
    asked = ["compare", "--hdri", "h", "--meshes", "m", "--run", str(tmp_path)]
    refused = CliRunner().invoke(app, asked + ([] if laboratory else ["--laboratory"]))
    assert "log.csv: expected rows of a run's log, got none" in str(refused.exception)


def test_a_run_whose_irradiance_network_learned_shows_that_one(tmp_path):
    path = checkpoint(tmp_path / "a.pt", smoke(designs_laboratory()))
    stored = torch.load(path, weights_only=True)
    stored["nets"]["irradiance_image.head.bias"] += 0.1
    torch.save(stored, path)
    frozen, learned = (
        DesignMethods(one).methods()["irradiance"](ball_pair()).irradiance
        for one in (checkpoint(tmp_path / "b.pt", smoke(designs())), path)
    )
    inside = (frozen > 0) & (learned < 1)
    np.testing.assert_allclose((learned - frozen)[inside], 0.1, atol=1e-5)
    assert read_run(path)["irradiance_pairs"] == 320_000 + 112


def test_another_hdr_network_changes_radiance_and_no_map(tmp_path):
    """Of all designs and ideal, where a map is saturated alone; results say whose it is."""
    path = checkpoint(tmp_path / "designs.pt", smoke(designs()))
    stored = torch.load(path, weights_only=True)
    for name in DESIGNS:
        stored["nets"][f"{name}.head.bias"] += 2.0  # untrained maps are grey
    torch.save(stored, path)
    nets = HdrCurves.networks()
    nets["hdr"].head.bias.data += 1.0
    about = {"step": 5, "config": json.dumps(asdict(smoke(hdr_curves()))), "pairs": 20}
    torch.save({"nets": nets.state_dict()} | about, tmp_path / "hdr.pt")
    own, other = DesignMethods(path), DesignMethods(path, tmp_path / "hdr.pt")
    pair = ball_pair()
    for (name, before), after in zip(own.methods().items(), other.methods().values(), strict=True):
        before, after = before(pair), after(pair)
        np.testing.assert_array_equal(before.ldr, after.ldr)
        assert (before.radiance is None) == (name in RIVALS)
        if name not in RIVALS:
            gamma = blend_weight(response(pair.radiance) if name == "ideal" else before.ldr)[..., 0]
            assert gamma.max() > 0.2
            moved = np.log(after.radiance / before.radiance).mean(axis=-1)
            assert (moved[gamma > 0.2] > 0.1).all()
            assert not moved[gamma == 0].any()
            if gamma.max() == 1:
                np.testing.assert_allclose(moved[gamma == 1], 1.0, atol=1e-4)
    facts = {"hdr_run": "hdr_curves-dry", "hdr_steps": 5, "hdr_pairs": 20}
    assert other.run == own.run | facts == read_run(path) | facts
    with pytest.raises(ModelError, match="expected a run of hdr_curves, got one of designs"):
        DesignMethods(path, path)
    with pytest.raises(ModelError, match="expected a run of designs, got one of hdr"):
        DesignMethods(tmp_path / "hdr.pt")


def test_mixtures_go_from_the_estimate_to_the_truth(run, methods):
    pair = ball_pair()
    for name in ("ours", "irradiance"):
        np.testing.assert_array_equal(run.mixed(name, pair, 0.0)[1], methods[name](pair).ldr)
    irradiance, ldr = run.mixed("ours", pair, 1.0)
    np.testing.assert_array_equal(ldr, methods["ideal"](pair).ldr)
    truth = pair.irradiance / 255.0 * pair.crop[..., 3:]
    np.testing.assert_allclose(irradiance, truth, atol=1e-6)
    half = run.mixed("ours", pair, 0.5)[0]
    np.testing.assert_allclose(half, (run.mixed("ours", pair, 0.0)[0] + irradiance) / 2, atol=1e-6)
