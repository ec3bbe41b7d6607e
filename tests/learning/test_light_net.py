"""The light network, its losses and its run: laws that hold for any weights."""

from __future__ import annotations

import os
import signal
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe_train.light import left_out_light  # noqa: E402
from anyprobe_train.light.both_ways import both_ways  # noqa: E402
from anyprobe_train.light.drawing import POWER_FLOOR, MapDrawing, directions_of  # noqa: E402
from anyprobe_train.light.light_losses import LIGHT_WEIGHTS, LightLoss, total_of  # noqa: E402
from anyprobe_train.light.light_run import LightRunConfig, run_light  # noqa: E402
from anyprobe_train.light.network import LeanNet  # noqa: E402
from anyprobe_train.light.object_map import ObjectMap, lifted_means  # noqa: E402
from anyprobe_train.light.pictured import learned, mirrored_inputs, mirrored_truth, tensors_of  # noqa: E402
from anyprobe_train.light.shape import CropFrame, ShapeNet, turned_towards  # noqa: E402
from anyprobe_train.light.traced import traced_photos, with_traced  # noqa: E402
from anyprobe_train.train.checkpoint import save_init_weights  # noqa: E402
from anyprobe_train.train.muon import MuonAndAdam, orthogonal  # noqa: E402
from anyprobe_train.world.batch import make_batch  # noqa: E402

pytestmark = pytest.mark.ci


@dataclass(frozen=True)
class Stub:
    """A batch as the world makes it."""

    context: np.ndarray
    crop: np.ndarray
    lens: np.ndarray
    fov: np.ndarray
    up: np.ndarray
    normals: np.ndarray
    material: np.ndarray
    truth: np.ndarray
    sources: np.ndarray
    soft: np.ndarray
    outdoors: np.ndarray
    family: np.ndarray


def batch_of(seed: int, n: int = 4) -> Stub:
    """Draw a batch under one disc of light each."""
    rng = np.random.default_rng(seed)

    def unit(*shape: int) -> np.ndarray:
        values = rng.normal(size=(n, *shape, 3))
        return values / np.linalg.norm(values, axis=-1, keepdims=True)

    sources = np.zeros((n, 3, 8), np.float32)
    sources[:, 0, 0], sources[:, 0, 1:4], sources[:, 0, 4] = 1, unit(), 12
    cosine = np.einsum("nc,hwc->nhw", sources[:, 0, 1:4], pixel_directions(64))
    disc = cosine > np.cos(np.radians(12))
    truth = np.where(disc[..., None], 30.0, rng.uniform(0.1, 0.6, (n, 1, 1, 3)))
    above = np.maximum(truth - 1, 0) * pixel_solid_angles(64)[..., None]
    sources[:, 0, 5:] = above.sum(axis=(1, 2))
    return Stub(
        context=rng.integers(0, 256, (n, 96, 96, 5)).astype(np.uint8),
        crop=rng.integers(0, 256, (n, 96, 96, 4)).astype(np.uint8),
        lens=np.tile([0.6, 0.1, -0.2, 0.2, 1.0], (n, 1)).astype(np.float32),
        fov=rng.uniform(30, 80, n).astype(np.float32),
        up=np.tile([0.1, 0.9, 0.42], (n, 1)).astype(np.float32),
        normals=np.round(127 * unit(48, 48)).astype(np.int8),
        material=np.tile([0, 0.5, 0.4, 0.3], (n, 1)).astype(np.float32),
        truth=truth.astype(np.float16),
        sources=sources,
        soft=np.zeros(n, np.float32),
        outdoors=np.array([1, 0, np.nan, 1][:n], np.float32),
        family=np.zeros(n, np.uint8),
    )


@pytest.fixture(scope="module")
def net() -> LeanNet:
    torch.manual_seed(0)
    return LeanNet().eval()


def test_every_answer_is_finite_whatever_is_missing(net: LeanNet) -> None:
    inputs, truth = tensors_of(batch_of(1, 2))
    nothing = type(inputs)(**{one.name: torch.zeros_like(getattr(inputs, one.name)) for one in fields(inputs)})
    nothing = replace(nothing, lens=inputs.lens)
    for given in (inputs, nothing):
        with torch.no_grad():
            answer = net(given)
        for one in fields(answer):
            assert torch.isfinite(getattr(answer, one.name)).all(), one.name
    assert answer.ln_radiance.shape == truth.radiance.shape
    assert answer.normals.shape == truth.normals.shape


def test_columns_of_the_sphere_go_on_beyond_the_seam(net: LeanNet) -> None:
    values = torch.rand(1, net.lifted[0].in_channels, 16, 32)
    with torch.no_grad():
        there, here = net.lifted(values.roll(5, dims=3)), net.lifted(values).roll(5, dims=3)
    assert torch.allclose(there, here, atol=1e-6)


def test_a_mirror_twice_changes_nothing_and_agrees_with_directions() -> None:
    inputs, truth = tensors_of(batch_of(2))
    twice = mirrored_inputs(mirrored_inputs(inputs)), mirrored_truth(mirrored_truth(truth))
    for once, again in zip((inputs, truth), twice, strict=True):
        for one in fields(once):
            a, b = getattr(once, one.name), getattr(again, one.name)
            assert torch.equal(torch.nan_to_num(a), torch.nan_to_num(b)), one.name
    other = mirrored_truth(truth)
    brightest = other.radiance.sum(dim=1).flatten(1).argmax(dim=1)
    d = torch.from_numpy(pixel_directions(64)).flatten(0, 1)[brightest].float()
    assert ((d * other.sources[:, 0, 1:4]).sum(dim=1) > np.cos(np.radians(14))).all()


def test_a_drawn_source_has_its_power_and_stands_in_its_place() -> None:
    drawing = MapDrawing()
    direction = torch.nn.functional.normalize(torch.tensor([[[0.4, 0.7, -0.5]]]), dim=2).expand(1, 3, 3)
    power = torch.tensor([[2.0, 1.0, 0.5]])
    exists = torch.tensor([[30.0, -30.0, -30.0]])
    powers = torch.log(power[:, None].expand(1, 3, 3) + POWER_FLOOR)
    shown, density = torch.full((1, 3, 64, 128), -40.0), torch.zeros(1, 1, 64, 128)
    radius = torch.full((1, 3), float(np.log(10.0)))
    logit = 60 * (drawing.place_directions @ direction[0, 0]) + drawing.ln_place_angles
    places = torch.log_softmax(logit, dim=0).expand(1, 3, -1)
    light = shown, torch.log(power + POWER_FLOOR), density
    radiance, expected = drawing(*light, direction, exists, radius, powers, places)
    total = (radiance * drawing.solid_angles).sum(dim=(2, 3))
    assert torch.allclose(total, power, rtol=1e-3)
    assert torch.allclose((expected * drawing.solid_angles).sum(dim=(2, 3)), power, rtol=1e-3)
    half = radiance[0, 0] > radiance[0, 0].max() / 2
    area = float((drawing.solid_angles[0, 0] * half).sum())
    assert area == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(10))), rel=0.12)
    near = torch.cos(torch.deg2rad(torch.tensor([1.0, 1.0])))
    found = drawing.directions(places, 60 * (directions_of(64) @ direction[0, 0]).view_as(density))[0, :2]
    assert (found @ direction[0, 0] > near).all()
    unsure = drawing.directions(places, density)[0, :2]  # all directions are as likely by the density
    assert (unsure @ direction[0, 0] > near).all()
    away = torch.tensor([[[0.4, 0.7, -0.5], [-0.4, 0.7, 0.5], [-0.4, 0.7, 0.5]]])
    away = torch.nn.functional.normalize(away, dim=2)
    alone, _ = drawing(*light, away, torch.full((1, 3), 30.0), radius, powers, places)
    assert torch.allclose(alone, radiance, rtol=1e-3)  # the others are not where they would be drawn


def test_a_source_is_as_likely_as_its_place():
    drawing, exists = MapDrawing(), torch.zeros(1, 1)  # as likely as not, somewhere
    direction = torch.tensor([[[0.0, 0.6, -0.8]]])
    anywhere = (drawing.ln_place_angles - float(np.log(4 * np.pi))).view(1, 1, -1)
    there = torch.log_softmax(60 * (drawing.place_directions @ direction[0, 0]), dim=0).view(1, 1, -1)
    share = (1 - np.cos(np.radians(30))) / 2
    assert float(drawing.likely(anywhere, direction, exists, 30.0)) == pytest.approx(0.5 * share, rel=0.1)
    assert float(drawing.likely(there, direction, exists, 30.0)) == pytest.approx(0.5, abs=0.01)
    assert float(drawing.likely(there, -direction, exists, 30.0)) == pytest.approx(0.0, abs=0.01)


def test_losses_of_the_truth_are_nothing(net: LeanNet) -> None:
    inputs, truth = tensors_of(batch_of(3))
    loss = LightLoss()
    with torch.no_grad():
        answer = net(inputs)
    ln = torch.log(truth.radiance.clamp(min=1e-4))
    above = ((truth.radiance - 1).clamp(min=0) * loss.angles).sum(dim=(2, 3))
    sources = truth.sources[:, [1, 0, 2]]  # in another order
    true = replace(
        answer,
        ln_radiance=ln,
        ln_expected=ln,
        ln_shown=ln.clamp(max=0.0),
        ln_power=torch.log(above + POWER_FLOOR),
        places=torch.log_softmax(
            (sources[:, :, 1:4] @ loss._places.T - 1.0) / (1 - np.cos(np.radians(5.0))) + loss._ln_angles, dim=2
        ),
        exists=40.0 * sources[:, :, 0] - 20.0,
        directions=sources[:, :, 1:4],
        ln_radius=torch.log(sources[:, :, 4].clamp(min=2.0)),
        ln_powers=torch.log(sources[:, :, 5:] + POWER_FLOOR),
        normals=torch.nn.functional.normalize(truth.normals, dim=1),
        soft=torch.full_like(answer.soft, -20.0),
    )
    terms = loss(true, truth)
    assert set(terms) == set(LIGHT_WEIGHTS)
    for name in ("display", "scales", "ln", "power", "spheres", "places", "exists", "radius", "source_power", "soft"):
        assert float(terms[name]) == pytest.approx(0.0, abs=2e-3), name
    assert float(terms["normals"]) == pytest.approx(0.0, abs=1e-5)


def test_mirrored_photos_get_mirrored_answers(net: LeanNet, monkeypatch) -> None:
    """Also where photo and mirror image do not agree on which of the sources is the first."""
    torch.manual_seed(3)
    slots, places = 12 * torch.randn(8, 3, 32, 64), net.drawing.places
    inputs, _ = tensors_of(batch_of(9))
    answers = []
    for photos, said in ((inputs, slots), (mirrored_inputs(inputs), slots.roll(4, 0))):
        monkeypatch.setattr(net.drawing, "places", lambda density, _, said=said: places(density, said))
        with torch.no_grad():
            answers.append(both_ways(net, photos))
    ours, theirs = answers
    side = torch.tensor([-1.0, 1.0, 1.0])
    assert torch.allclose(ours.directions[:, 0], side * theirs.directions[:, 0], atol=1e-3)
    assert torch.allclose(ours.ln_radiance, theirs.ln_radiance.flip(3), atol=0.05)


def test_a_mirrored_photo_costs_what_the_photo_costs_at_a_mirrored_answer(net: LeanNet) -> None:
    inputs, truth = tensors_of(batch_of(4))
    loss = LightLoss()
    with torch.no_grad():
        answer = net(inputs)
        other = replace(answer, ln_radiance=answer.ln_radiance.flip(3), ln_expected=answer.ln_expected.flip(3))
        ours, theirs = loss.of_map(answer, truth.radiance), loss.of_map(other, truth.radiance.flip(3))
    for name in ("display", "spheres", "level", "color"):
        assert float(ours[name]) == pytest.approx(float(theirs[name]), rel=1e-3), name


def test_estimated_normals_are_in_the_frame_of_the_camera() -> None:
    """Untrained, each point faces the camera, wherever in the photo it is."""
    shape = ShapeNet().eval()
    with torch.no_grad():
        for parameter in shape.head.parameters():
            parameter.zero_()
        center, half = torch.tensor([[0.5, -0.3], [0.0, 0.0]]), torch.tensor([[0.01], [0.4]])
        ray, *seen_from = CropFrame()(center, half)
        normals = turned_towards(shape(torch.rand(2, 4, 128, 128), *seen_from), ray)
    assert torch.allclose(normals.square().sum(dim=1), torch.ones(2, 64, 64), atol=1e-5)
    facing = torch.nn.functional.normalize(torch.tensor([-0.5, 0.3, 1.0]), dim=0)
    assert ((normals[0] * facing[:, None, None]).sum(dim=0) > np.cos(np.radians(1.0))).all()
    corner = torch.nn.functional.normalize(torch.tensor([0.4, -0.4, 1.0]), dim=0)  # upper left
    assert float(normals[1, :, 0, 0] @ corner) > np.cos(np.radians(2.0))


def test_points_are_lifted_to_the_directions_that_they_mirror() -> None:
    wi = torch.nn.functional.normalize(torch.tensor([0.6, 0.3, 0.5]), dim=0)[None, :, None, None].expand(1, 3, 4, 4)
    values = torch.tensor([0.2, 0.8])[None, :, None, None].expand(1, 2, 4, 4)
    for means in lifted_means(values, torch.full((1, 1, 4, 4), 0.5), wi):
        rows = means.shape[2]
        there = torch.nonzero(means[0, -1])
        assert len(there) == 1
        d = torch.from_numpy(pixel_directions(rows))[there[0, 0], there[0, 1]].float()
        assert float(d @ wi[0, :, 0, 0]) > np.cos(np.pi / rows)
        torch.testing.assert_close(means[0, :2, there[0, 0], there[0, 1]], values[0, :, 0, 0], rtol=2e-3, atol=0.0)


def test_an_object_off_centre_is_answered_in_the_frame_of_the_camera(monkeypatch) -> None:
    own, d = ObjectMap().eval(), torch.from_numpy(pixel_directions(64)).permute(2, 0, 1)[None].float()
    monkeypatch.setattr(own, "_completed", lambda lifted, code: -0.5 + 0.5 * d.expand(2, -1, -1, -1))
    ray, slope, wo = CropFrame()(torch.tensor([[0.0, 0.0], [0.5, -0.3]]), torch.tensor([[0.2], [0.2]]))
    rows = torch.rand(2, 4, 128, 128), (ray, slope, wo), wo, torch.zeros(2, 1, 64, 64), torch.zeros(2, 8)
    with torch.no_grad():
        found = (torch.log(own(*rows)) + 1.2) / 2.0 * 2.0 + 1.0
    assert torch.allclose(found[0], d[0].clamp(max=2.2), atol=0.01)
    turned = turned_towards(found[1:], ray[1:])  # each colour was a coordinate in the crop's frame
    assert torch.allclose(turned, d, atol=0.03)


def test_muon_steps_along_an_orthogonal_matrix() -> None:
    torch.manual_seed(4)
    for shape in ((30, 200), (200, 30)):
        values = torch.linalg.svdvals(orthogonal(torch.randn(shape)))
        assert 0.6 < float(values.min())
        assert float(values.max()) < 1.3


def test_one_step_down_the_gradient_lowers_the_loss() -> None:
    torch.manual_seed(1)
    net, loss = LeanNet(), LightLoss()
    inputs, truth = learned(*tensors_of(batch_of(5)), (1, 1))
    optimizer = torch.optim.AdamW(net.parameters(), lr=2e-3)
    seen = []
    for _ in range(4):
        total = total_of(loss(net(inputs), truth))
        optimizer.zero_grad()
        total.backward()
        assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in net.parameters())
        optimizer.step()
        seen.append(float(total.detach()))
    assert seen[-1] < seen[0]


def test_a_run_that_was_stopped_goes_on_to_the_same_bits(tmp_path) -> None:
    def batches(first: int):
        step = first
        while True:
            yield batch_of(step, 2)
            step += 1

    config = LightRunConfig(name="light", steps=3, batch=2, warmup=2)
    whole = run_light(config, batches=batches, runs=tmp_path / "a", assets="stub")
    run_light(config, batches=batches, runs=tmp_path / "b", assets="stub", last=1)
    halves = run_light(config, batches=batches, runs=tmp_path / "b", assets="stub")
    one, other = (torch.load(path, weights_only=True) for path in (whole, halves))
    assert one["step"] == other["step"] == 3
    for name, value in one["moving"].items():
        assert torch.equal(value, other["moving"][name]), name
    assert all(torch.equal(one["net"][name], other["net"][name]) for name in one["net"])


def test_a_run_that_is_asked_to_stop_keeps_its_last_step_though_its_photos_end(tmp_path) -> None:
    def batches(first: int):
        yield batch_of(first, 2)
        os.kill(os.getpid(), signal.SIGTERM)
        raise BrokenProcessPool

    config = LightRunConfig(name="light", steps=3, batch=2, warmup=2)
    path = run_light(config, batches=batches, runs=tmp_path, assets="stub")
    assert torch.load(path, weights_only=True)["step"] == 1


def test_kept_weights_go_on_in_another_folder_at_their_step(tmp_path) -> None:
    asked = []

    def batches(first: int):
        asked.append(first)
        yield batch_of(first, 2)

    config = LightRunConfig(name="light", steps=4, batch=2, warmup=2)
    first = run_light(config, batches=batches, runs=tmp_path / "a", assets="stub", last=1)
    save_init_weights(first, tmp_path / "kept.pt", with_pairs=True)
    second = run_light(config, batches=batches, runs=tmp_path / "b", assets="stub", start=tmp_path / "kept.pt")
    old, new = (torch.load(path, weights_only=True) for path in (first, second))
    assert asked == [0, 1]
    assert new["step"] == 2
    name = "start.0.weight"
    moved = (new["moving"][name] - old["net"][name]).abs().max()
    assert 0 < moved < 10 * config.learning_rate


def test_half_of_a_batch_is_path_traced_where_there_are_such_photos(tmp_path) -> None:
    assert traced_photos(tmp_path) is None
    for k in range(2):
        np.savez(tmp_path / f"{k}.npz", **{one.name: getattr(batch_of(k), one.name) for one in fields(Stub)})
    traced, world = traced_photos(tmp_path), batch_of(9)
    assert len(traced.family) == 8
    mixed, again = (with_traced(world, traced, 8, (7, 3)) for _ in range(2))
    np.testing.assert_array_equal(mixed.truth, again.truth)
    np.testing.assert_array_equal(mixed.context[:4], world.context)
    for row in mixed.context[4:]:
        assert any(np.array_equal(row, one) for one in traced.context)
    assert with_traced(world, None, 4, (7, 3)) is world


def test_the_sun_is_given_where_it_does_not_shine_too() -> None:
    """Above the horizon, so that the network looks whether it shines."""
    inputs, truth = tensors_of(batch_of(5))
    truth = replace(truth, outdoors=torch.ones(4), sources=torch.zeros_like(truth.sources))
    suns = torch.cat([learned(inputs, truth, (7, step))[0].sun for step in range(100)])
    given = suns[suns.square().sum(dim=1) > 0]
    assert 4 < len(given) < 60
    assert (given @ truth.up[0] > -0.25).all()  # mirrored photos have mirrored horizons


def test_matrices_step_by_the_nearest_orthogonal_matrix_and_all_else_as_adam_does() -> None:
    torch.manual_seed(0)
    net = torch.nn.Sequential(torch.nn.Conv2d(2, 4, 3), torch.nn.Linear(4, 3)).to(memory_format=torch.channels_last)
    before = {name: value.clone() for name, value in net.state_dict().items()}
    rate, share = 0.01, 0.5
    optimizer = MuonAndAdam(net, rate, rate, weight_decay=0.0, last=("1.",))
    for weights in net.parameters():
        weights.grad = torch.randn_like(weights)
    u, _, v = torch.linalg.svd(torch.randn(4, 18), full_matrices=False)
    net[0].weight.grad = (u @ torch.diag(torch.tensor([1.0, 0.8, 0.6, 0.4])) @ v).view(4, 2, 3, 3)
    optimizer.step(share)
    steps = {name: (before[name] - value) / (share * rate) for name, value in net.state_dict().items()}
    along = torch.diag(u.T @ steps["0.weight"].flatten(1) @ v.T) / (0.2 * 18**0.5)
    assert ((along > 0.6) & (along < 1.3)).all(), along  # five rounds of the iteration are that near to 1
    for name in ("0.bias", "1.weight", "1.bias"):  # the first step of Adam has the gradient's signs
        torch.testing.assert_close(steps[name].abs(), torch.ones_like(steps[name]), rtol=1e-3, atol=1e-3)


def test_left_out_scores_say_families_cross_sets_and_photos_without_objects(small_world, tmp_path, monkeypatch):
    kept = make_batch(small_world, 3, 0)
    kept.family[:] = [0, 0, 1, 5, 6]  # ground, table, cut_out, no_object
    np.savez(tmp_path / "0.npz", **{one.name: getattr(kept, one.name) for one in fields(kept)})
    asked = []
    monkeypatch.setattr(left_out_light.World, "open", lambda *parts, **settings: asked.append(parts[2:]) or small_world)
    monkeypatch.setattr(left_out_light, "CROSS_BATCHES", 1)
    score = left_out_light.left_out_scores(tmp_path, None, tmp_path)
    net = LeanNet().eval()
    found = score(net)
    assert asked == [("train", "train"), ("train", "left-out"), ("left-out", "train"), ("left-out", "left-out")]
    named = {key.removesuffix("_ldr_rmse") for key in found if key.endswith("_ldr_rmse")} - {"ldr_rmse"}
    cross = {f"{maps}_maps_{shapes}_shapes" for maps in ("seen", "new") for shapes in ("seen", "new")}
    assert named == {"ground", "table", "cut_out", "no_object", "without", *cross}
    assert found["ldr_rmse"] != found["without_ldr_rmse"]
    assert score(net) == found
    assert len(asked) == 4
