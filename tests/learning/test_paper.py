"""The paper's reproduction: sizes, schedule, pairs and exact resumption."""

import json
import os
import signal
from dataclasses import asdict, replace

import numpy as np
import pytest
from PIL import Image
from support.scenes import sphere_photo

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from support.shading_terms import brdf  # noqa: E402

from anyprobe.core.response import response  # noqa: E402
from anyprobe.core.sampling import hammersley  # noqa: E402
from anyprobe.errors import InputError, ModelError  # noqa: E402
from anyprobe.estimate.light_graph import graph_inputs  # noqa: E402
from anyprobe.estimate.runtime import STAGES, Models  # noqa: E402
from anyprobe.light.environment import rotate  # noqa: E402
from anyprobe.paper.chain import estimate_light  # noqa: E402
from anyprobe.paper.equations import filter_exponent  # noqa: E402
from anyprobe.render.integrate import shade, shading_pyramid  # noqa: E402
from anyprobe.scatter.materials import Material  # noqa: E402
from anyprobe_train.dataset.asset_store import own_map  # noqa: E402
from anyprobe_train.paper import graphs, schedule, shipped  # noqa: E402
from anyprobe_train.paper.figure_run import Run  # noqa: E402
from anyprobe_train.paper.figures import FIGURES  # noqa: E402
from anyprobe_train.paper.graphs import export_chain  # noqa: E402
from anyprobe_train.paper.lobes import Rings, light_places, light_waves, lobes, shown  # noqa: E402
from anyprobe_train.paper.losses import l2, picture_rmse  # noqa: E402
from anyprobe_train.paper.materials import MATERIALS  # noqa: E402
from anyprobe_train.paper.networks import HdrNet, IlluminationNet, IrradianceNet, in_chain  # noqa: E402
from anyprobe_train.paper.open_tables import open_tables  # noqa: E402
from anyprobe_train.paper.pairs import balanced, drawn, pairs_of, reexposed  # noqa: E402
from anyprobe_train.paper.pieces import PIECES, network_of, piece_named  # noqa: E402
from anyprobe_train.paper.reproduce import reproduce  # noqa: E402
from anyprobe_train.paper.rivals import spheres_of, unwrapped_mirror, unwrapped_sphere  # noqa: E402
from anyprobe_train.paper.settings import SETTINGS  # noqa: E402
from anyprobe_train.paper.table_1 import verdict  # noqa: E402
from anyprobe_train.paper.tables import exposed, exposure_of  # noqa: E402
from anyprobe_train.paper.training import checkpoint_of, load_net, stored  # noqa: E402

TINY = SETTINGS["tiny"]
QUICK = replace(TINY, scored=4, log_every=100, score_every=100)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with the tables of the tiny setting."""
    folder = tmp_path_factory.mktemp("paper")
    for split in ("train", "test"):
        open_tables(None, folder, TINY, split)
    return folder


def beside(runs, folder):
    """A folder of runs of its own with the same tables."""
    folder.mkdir()
    (folder / "tables").symlink_to(runs / "tables")
    return folder


def test_networks_have_the_published_sizes():
    full = SETTINGS["full"]
    nets = (
        (IrradianceNet(full.side, full.width), (4, 128, 128), (3, 128, 128), 7_315_811),
        (IlluminationNet(full.side, full.rows, full.width, full.code), (4, 128, 128), (3, 64, 128), 6_370_979),
        (HdrNet(full.rows, full.width), (3, 64, 128), (3, 64, 128), 4_168_547),
    )
    for net, before, after, numbers in nets:
        assert net.eval()(torch.rand(1, *before)).shape == (1, *after)
        assert sum(x.numel() for x in net.parameters()) == numbers


def test_irradiance_is_a_residual_to_the_photo():
    net = IrradianceNet(TINY.side, TINY.width).eval()
    torch.nn.init.zeros_(net.residual.head.weight)
    torch.nn.init.zeros_(net.residual.head.bias)
    photo = torch.rand(2, 4, TINY.side, TINY.side).round()
    torch.testing.assert_close(net(photo), photo[:, :3] * photo[:, 3:])


def test_targets_sharpen_in_eleven_steps():
    epochs = [schedule.epoch_of(step, 110) for step in range(110)]
    assert [epochs.count(e) for e in range(1, 12)] == [10] * 11
    assert [filter_exponent(e) for e in (1, 2, 11)] == [1, 8, 1331]
    ldr = torch.rand(2, 3, 16, 32)
    spread = [schedule.filtered_target(ldr, epoch).std() for epoch in (1, 4, 11)]
    assert spread == sorted(spread)
    torch.testing.assert_close(schedule.filtered_target(torch.ones(1, 3, 16, 32), 3), torch.ones(1, 3, 16, 32))


def test_rate_rises_stays_and_falls():
    rates = [schedule.rate_at(step, 1000) for step in range(1000)]
    assert rates[49] == rates[699] == max(rates) == schedule.RATE
    assert rates[0] < rates[10] < rates[49]
    assert rates[999] == pytest.approx(schedule.RATE * schedule.LOWEST_RATE, rel=0.01)


def test_errors_of_a_picture():
    truth = torch.rand(2, 3, 8, 8)
    estimate = truth.clone()
    estimate[..., :4] += 0.1
    assert l2(estimate, truth).item() == pytest.approx(0.005, rel=1e-4)
    torch.testing.assert_close(picture_rmse(estimate, truth), torch.full((2,), 0.005**0.5))


def sent_back(f0: float, alpha: float, cosine: float) -> float:
    """Integral of the coat's f (n.wi) dwi over a grid in the half vector's polar angle and azimuth."""
    theta, step = (np.arange(400) + 0.5) * np.pi / 800, np.pi / 800
    t, p = np.meshgrid(theta, (np.arange(200) + 0.5) * np.pi / 100, indexing="ij")
    h = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    wo = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    facing = h @ wo
    wi = 2 * facing[..., None] * h - wo
    grey = Material(albedo=np.zeros(3), f0=np.full(3, f0), alpha=alpha)
    f = brdf(grey, wo + 0 * wi, wi, np.array([0.0, 0.0, 1.0]) + 0 * wi)[..., 0]
    return float((f * wi[..., 2].clip(min=0) * 4 * facing.clip(min=0) * np.sin(t)).sum() * step * np.pi / 100)


def test_lobes_of_even_light_are_the_albedos():
    rings = Rings(count=48)
    waves = light_waves(np.ones((64, 128, 3), np.float32), light_places(np.eye(3), rings))[1][None]
    cosine = np.cos(rings.angles(48)[:40])  # beyond, a lobe is narrower than a ring
    for material in MATERIALS:
        photo, irradiance = shown(waves, lobes(material, rings), rings)[0].reshape(2, 3, 48, 192)
        torch.testing.assert_close(irradiance, torch.ones_like(irradiance), atol=1e-4, rtol=0)
        if material.albedo[0] == 0:
            wanted = [sent_back(float(material.f0[0]), material.alpha, one) for one in cosine[::13]]
            np.testing.assert_allclose(photo[0, :40:13, 0], wanted, atol=0.02)


def test_lobes_agree_with_the_renderer():
    radiance = own_map(5, 0).radiance[::4, ::4].copy()
    rings, material = Rings(count=32), MATERIALS[6]
    waves = light_waves(radiance, light_places(np.eye(3), rings))[1][None]
    photo, irradiance = shown(waves, lobes(material, rings), rings)[0].reshape(2, 3, 32, 128).numpy()
    normals = rings.directions(32)[::5, ::17]
    n = normals.reshape(-1, 3)
    wo = np.broadcast_to(np.array([0, 0, 1], np.float32), n.shape)
    shading = shade(shading_pyramid(radiance, material.alpha), n, wo, material.alpha, hammersley(4096))
    reference = shading.radiance(material).T.reshape(3, *normals.shape[:2])
    assert np.abs(photo[:, ::5, ::17] - reference).mean() < 0.03 * reference.mean()
    reference = shading.irradiance.T.reshape(3, *normals.shape[:2])
    assert np.abs(irradiance[:, ::5, ::17] - reference).mean() < 0.03 * reference.mean()


def test_a_normal_is_nearest_to_itself():
    rings = Rings(count=8)
    np.testing.assert_array_equal(rings.nearest(3.0 * rings.directions(8)).ravel(), np.arange(rings.number))


def test_a_map_has_one_exposure():
    radiance = own_map(5, 1).radiance
    assert exposure_of("0a1b2c3d") == exposure_of("0a1b2c3d")
    assert 0.5 <= exposure_of("0a1b2c3d") <= 2.0
    np.testing.assert_allclose(exposed(7.0 * radiance, 0.8), 2.0 * exposed(radiance, 0.4), rtol=1e-4)


def test_pairs_are_looked_up(runs):
    tables = open_tables(None, runs, TINY, "train")
    which = drawn(tables, np.arange(len(tables.maps)), 6, step=2)
    again = drawn(tables, np.arange(len(tables.maps)), 6, step=2)
    pairs, plain = pairs_of(tables, which), pairs_of(tables, replace(again, mirrored=not which.mirrored))
    side = TINY.side
    assert pairs.photo.shape == pairs.irradiance.shape == (6, 4, side, side)
    assert pairs.photo.is_contiguous(memory_format=torch.channels_last)
    assert ((pairs.mask == 0) | (pairs.mask == 1)).all()
    assert 0.05 < pairs.mask.mean() < 0.8
    assert (pairs.photo[:, :3] * (1 - pairs.mask)).abs().max() == 0
    torch.testing.assert_close(pairs.photo.flip(3), plain.photo)
    torch.testing.assert_close(pairs.ldr.flip(3), plain.ldr)
    brighter = reexposed(pairs, torch.full((6,), 2.0))
    assert (brighter.ldr >= pairs.ldr - 0.01).all()
    torch.testing.assert_close(reexposed(pairs, torch.ones(6)).ldr, pairs.ldr, atol=0.005, rtol=0)


def test_rivals_pictures_unwrap_to_the_map(runs):
    tables = open_tables(None, runs, TINY, "train")
    smooth = schedule.filtered_target(torch.rand(2, 3, 32, 64), 3)
    assert picture_rmse(unwrapped_sphere(spheres_of(smooth), 32), smooth).max() < 0.2 * smooth.std()
    which = replace(drawn(tables, np.arange(len(tables.maps)), 4, step=1), mirrored=False)
    pairs, turned = pairs_of(tables, which), pairs_of(tables, replace(which, mirrored=True))
    torch.testing.assert_close(pairs.normals.norm(dim=1, keepdim=True), pairs.mask)
    torch.testing.assert_close(turned.normals.flip(3) * torch.tensor([-1.0, 1, 1])[:, None, None], pairs.normals)
    assert unwrapped_mirror(pairs.mirror, pairs.normals, pairs.mask, 16).shape == (4, 3, 16, 32)


def begun(runs, setting, *pieces):
    """Leave pieces as training does at its step 3; return their networks."""
    nets = [network_of(piece, setting) for piece in pieces]
    for piece, net in zip(pieces, nets, strict=True):
        path = checkpoint_of(runs, piece.name)
        path.parent.mkdir()
        torch.save({"net": net.state_dict(), "step": 3, "piece": asdict(piece)}, path)
        line = {"step": 3, "steps": 12, "loss": 0.1, "unfiltered": 0.1, "box rmse": 0.25}
        (path.parent / "log.jsonl").write_text(json.dumps(line))
    return nets


def exported(runs, folder, setting):
    """Write the chain, at step 3 of its training, to a folder of graphs; return its networks."""
    nets = begun(runs, setting, *map(piece_named, ("irradiance_net", "ours", "hdr_net")))
    export_chain(runs, setting, folder)
    return [in_chain(net) for net in nets]


@pytest.mark.filterwarnings("ignore")  # of the tracer
def test_the_exported_chain_estimates_as_torch_does(runs, tmp_path, monkeypatch):
    pytest.importorskip("onnx", reason="needs ./train[torch]")
    setting = replace(SETTINGS["full"], width=4, code=16)
    nets = exported(beside(runs, tmp_path / "runs"), tmp_path / "graphs", setting)
    weights = sum(x.numel() for net in nets for x in net.parameters())
    assert sum(path.stat().st_size for path in (tmp_path / "graphs").glob("*.onnx")) < 2.5 * weights
    photo = sphere_photo()
    said = Models(str(tmp_path / "graphs"))(graph_inputs(photo[..., :3] / np.float32(255), photo[..., 3] / 255, 60.0))
    with torch.no_grad():
        made = estimate_light(torch.from_numpy(said.image.transpose(2, 0, 1).copy())[None], *nets)
    radiance = rotate(made.radiance[0].permute(1, 2, 0).numpy(), said.camera_from_crop)
    assert np.abs(response(said.radiance) - response(radiance)).max() < 0.02
    for module in (shipped, graphs):
        monkeypatch.setattr(module, "weights_folder", lambda model: tmp_path / "graphs")
    for name, picture, expected in (("ours", torch.rand(2, 4, 128, 128), nets[1]), ("hdr_net", made.ldr, nets[2])):
        taken = load_net(setting, tmp_path / "empty", name)  # what ships stands in where nothing is trained
        with torch.no_grad():
            torch.testing.assert_close(taken(picture), expected(picture), atol=0.02, rtol=0.02)
    assert load_net(replace(setting, share=0.5), tmp_path / "empty", "ours").step == 3
    with pytest.raises(InputError, match="expected ours to be trained"):
        load_net(replace(setting, code=8), tmp_path / "empty", "ours")
    card = (tmp_path / "graphs" / "README.md").read_text()
    (tmp_path / "again").mkdir()
    checkpoint_of(tmp_path / "runs", "hdr_net").unlink()  # another run's, or none
    export_chain(tmp_path / "runs", setting, tmp_path / "again")
    hdr = [(tmp_path / folder / "hdr.onnx").read_bytes() for folder in ("graphs", "again")]
    assert hdr[0] == hdr[1]
    again = (tmp_path / "again" / "README.md").read_text()
    assert "| `hdr.onnx` | 0.1 M | 3 of 77,000 | 48 |" in again
    assert ("run paper --data" in card, "--only ours" in card) == (True, False)
    assert ("run paper --data" in again, "--only ours" in again) == (False, True)
    run = Run(runs=tmp_path / "empty", setting=setting, data=None)
    assert run.chain(torch.rand(1, 4, 128, 128)).ldr.shape == (1, 3, 64, 128)
    assert run.notes["hdr_net"] == "hdr_net at step 3 of 77,000"
    assert "| `illumination.onnx` | 0.1 M | 3 of 100,000 | 48 |" in card
    assert "LDR map: rmse 0.25." in card
    assert "Not yet scored." in card


@pytest.mark.filterwarnings("ignore")  # of the tracer
def test_a_chain_of_small_pictures_is_refused(runs, tmp_path):
    pytest.importorskip("onnx", reason="needs ./train[torch]")
    exported(beside(runs, tmp_path / "runs"), tmp_path / "graphs", TINY)
    with pytest.raises(ModelError, match=r"irradiance.onnx: expected a network of pictures \(4, 128, 128\), got"):
        Models(str(tmp_path / "graphs"))


@pytest.mark.parametrize(
    ("setting", "fault"),
    [
        (TINY, "photos of 32 pixels"),
        (SETTINGS["full"], "irradiance_net at step 3 of 120000"),
        (replace(SETTINGS["full"], share=0), "no table_1.md of them"),
    ],
)
def test_only_trained_networks_ship(runs, tmp_path, monkeypatch, setting, fault):
    monkeypatch.setattr(graphs, "weights_folder", lambda model: tmp_path / "weights")
    monkeypatch.setattr(graphs, "steps_of", lambda piece, setting: max(3, round(piece.steps * setting.share)))
    with pytest.raises(InputError, match=f"trained to their end and scored, got {fault}"):
        exported(beside(runs, tmp_path / "runs"), tmp_path / "weights", replace(setting, width=4, code=16))
    assert not (tmp_path / "weights").exists()


def test_scored_pairs_are_balanced(runs):
    tables = open_tables(None, runs, TINY, "test")
    which = balanced(tables, 48, seed=1)
    for numbers, count in ((which.material, 8), (which.map, len(tables.maps)), (which.shape, len(tables.shapes))):
        assert np.ptp(np.bincount(numbers, minlength=count)) <= 1


def test_a_run_resumes_to_the_bit(runs, tmp_path):
    whole, halves = beside(runs, tmp_path / "whole"), beside(runs, tmp_path / "halves")
    for name in ("irradiance_net", "ours", "hdr_net"):
        assert reproduce(None, whole, QUICK, only=name, stop=7, say=lambda line: None)
        for stop in (3, 7):
            assert reproduce(None, halves, QUICK, only=name, stop=stop, say=lambda line: None)
        one, other = stored(whole, name), stored(halves, name)
        assert one["step"] == other["step"] == 7
        assert one["net"].keys() == other["net"].keys()
        for key, value in one["net"].items():
            assert torch.equal(value, other["net"][key]), key
        for key, state in one["optimizer"]["state"].items():
            assert torch.equal(state["exp_avg_sq"], other["optimizer"]["state"][key]["exp_avg_sq"])


def test_sigterm_saves_and_ends(runs, tmp_path):
    folder, before = beside(runs, tmp_path / "runs"), signal.getsignal(signal.SIGTERM)
    often = replace(QUICK, log_every=2)

    def stop_at_four(line):
        if "step 4," in line:
            os.kill(os.getpid(), signal.SIGTERM)

    assert not reproduce(None, folder, often, only="irradiance_net", say=stop_at_four)
    assert signal.getsignal(signal.SIGTERM) is before
    assert stored(folder, "irradiance_net")["step"] == 4
    assert reproduce(None, folder, often, only="irradiance_net", say=lambda line: None)
    lines = (folder / "irradiance_net" / "log.jsonl").read_text().splitlines()
    steps = [json.loads(line)["step"] for line in lines]
    assert steps == [2, 4, 6, 8, 10, 12]
    assert "unseen rmse" in json.loads(lines[-1])


def test_another_setting_does_not_go_on(runs, tmp_path):
    folder = beside(runs, tmp_path / "runs")
    reproduce(None, folder, QUICK, only="irradiance_net", stop=2, say=lambda line: None)
    with pytest.raises(InputError, match="settings"):
        reproduce(None, folder, replace(QUICK, batch=5), only="irradiance_net", say=lambda line: None)


def test_estimates_need_the_first_network(runs, tmp_path):
    with pytest.raises(InputError, match="irradiance_net"):
        reproduce(None, beside(runs, tmp_path / "runs"), QUICK, only="ours", say=lambda line: None)


def real_photos(folder):
    """Write a photo of a ball wherever figures look for real ones; return the folder."""
    photo = Image.fromarray(sphere_photo()[..., :3])
    mask = Image.fromarray(sphere_photo()[..., 3])
    for name in ("real_lights", "real_figures", "photos", "real_masks"):
        (folder / name).mkdir(parents=True)
        photo.save(folder / name / "ball.png")
        mask.save(folder / name / "ball_mask.png")
    for name, material in (("real_lights", "glossy"), ("real_figures", "white matte")):
        row = f"ball.png,ball_mask.png,{material} ball,{material},-0.6,0.6,0.53"
        (folder / name / "lights.csv").write_text(f"file,mask,object,material,x,y,z\n{row}\n")
    (folder / "real_masks" / "manifest.csv").write_text("id,kind\nball,painted ball\n")
    return folder


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore")  # of the tracer
def test_the_tiny_setting_goes_from_nothing_to_table_and_graphs(command, tmp_path):
    pytest.importorskip("onnx", reason="needs ./train[torch]")
    folder, tiny = tmp_path / "paper", ("--setting", "tiny")
    said = command("run", "paper", "--runs", tmp_path, *tiny).out
    assert all(f"{piece.name} step 1" in said for piece in PIECES)
    table = (folder / "table_1.md").read_text()
    assert said.endswith(table + "\n")
    assert table.count("| LDR |") == 9
    assert table.count(" to ") == 6
    command("paper", "--runs", folder, *tiny, "--graphs", tmp_path / "graphs")
    assert {path.name for path in (tmp_path / "graphs").iterdir()} == {*(f"{s}.onnx" for s in STAGES), "README.md"}
    assert table in (tmp_path / "graphs" / "README.md").read_text()


@pytest.mark.ci
@pytest.mark.parametrize("number", FIGURES)
def test_figures_say_the_steps_of_their_networks(command, runs, tmp_path, number):
    folder = beside(runs, tmp_path / "runs")
    begun(folder, TINY, *PIECES)
    data = real_photos(tmp_path / "data")
    asked = ("paper", "--runs", folder, "--setting", "tiny", "--figure", number)
    lines = command(*asked, "--data", data).out.splitlines()
    with Image.open(lines[-1]) as picture:
        assert picture.width > 200
    assert number < 11 or "irradiance_net at step 3 of 12" in lines
    assert number != 13 or sum(line.startswith("angle to the lamp, Real-") for line in lines) == 2
    assert number != 13 or "angle to the lamp, all real photos, of a light at the camera: 58.01" in lines
    assert number < 12 or "give --data" in command(*asked).complaint


def test_a_step_is_decided_equal_or_open():
    found = [verdict(*pair) for pair in ((0.01, 0.002), (-0.01, 0.002), (0.001, 0.003), (0.004, 0.009))]
    assert found == ["decided", "reversed", "equal", "open"]
