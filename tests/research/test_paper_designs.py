"""The paper's experiment in small: pairs against the renderer, gradual targets, exact resuming, scores."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skimage.metrics import structural_similarity

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe.core.response import inverse_response  # noqa: E402
from anyprobe.core.sampling import hammersley  # noqa: E402
from anyprobe.render.integrate import shade, shading_pyramid  # noqa: E402
from anyprobe.render.shapes import sphere  # noqa: E402
from research.paper_designs.designs import DESIGNS, Designs, Losses, inputs_of  # noqa: E402
from research.paper_designs.gradual import epoch_of, filtered  # noqa: E402
from research.paper_designs.judge import Judge, clustered_error, scores, ssim, unwrap_mirror, unwrap_sphere  # noqa: E402
from research.paper_designs.pairs import Order, balanced, make_batch  # noqa: E402
from research.paper_designs.report import read_points, verdict, with_earlier, write_report  # noqa: E402
from research.paper_designs.scale import MATERIALS, SCALES, VIEWS  # noqa: E402
from research.paper_designs.tables import build_tables, views_of  # noqa: E402
from research.paper_designs.train import Run, Trainer, judged_at, rate_at, train  # noqa: E402
from research.paper_designs.transport import TO_EYE, hemisphere  # noqa: E402

SCALE = replace(SCALES["small"], normals=120, light_rows=64, batch=6, width=8, code=16)


def some_map(seed: int) -> np.ndarray:
    """A soft sky with a window."""
    rng = np.random.default_rng(seed)
    directions = pixel_directions(64)
    sky = 0.4 + 0.3 * directions @ rng.normal(size=(3, 3)).astype(np.float32) * 0.5
    sky[10:20, 30:44] += 3.0
    return np.maximum(sky, 0.02).astype(np.float32)


@pytest.fixture(scope="module")
def tables():
    maps = {f"map {k}": some_map(k) for k in range(2)}
    return build_tables(SCALE, maps, {"sphere": sphere(16), "again": sphere(24)})


@pytest.fixture(autouse=True)
def one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.mark.parametrize("number", range(len(MATERIALS)))
def test_photo_and_irradiance_are_what_the_renderer_shades(tables, number):
    """Every normal of one map and camera, against importance sampling of the same light."""
    light = views_of(some_map(0), SCALE.light_rows)[5]
    normals = hemisphere(SCALE.normals)
    kept = normals[:, 2] > 0.2
    wo = np.broadcast_to(TO_EYE, normals.shape)
    material = MATERIALS[number]
    coat, wide = shading_pyramid(light, material.alpha), shading_pyramid(light)
    shading = shade(coat, normals[kept], wo[kept], float(material.alpha), hammersley(1024), wide=wide)
    shown = (
        tables.shades.view(torch.uint8).reshape(-1, len(MATERIALS), SCALE.normals + 1, 8)[5, number, :-1].numpy()[kept]
    )
    for columns, expected in ((slice(0, 3), shading.radiance(material)), (slice(3, 6), shading.irradiance)):
        radiance = inverse_response(shown[:, columns] / 255.0)
        expected = expected.clip(0, 1)
        assert np.abs(radiance - expected).mean() < 0.015 * expected.mean()


def test_photo_is_of_the_shape_material_and_light_that_the_numbers_say(tables):
    chosen = balanced(tables, 8, 3)
    batch = make_batch(tables, chosen)
    for k in range(8):
        n = batch.normals[k].permute(1, 2, 0)[12, 12]
        number = int((tables.normals[:-1] @ n).argmax())
        row = (int(chosen.map[k]) * VIEWS + int(chosen.view[k])) * len(MATERIALS) + int(chosen.material[k])
        value = tables.shades[row, number].reshape(1).view(torch.uint8).float() / 255
        assert torch.equal(batch.photo[k, :3, 12, 12], value[:3])
        assert torch.equal(batch.irradiance[k, :, 12, 12], value[3:6])
    light = views_of(some_map(int(chosen.map[0])), 64)[int(chosen.view[0])]
    area = pixel_solid_angles(64)[:, :, None]
    mean = (light * area).reshape(16, 4, 32, 4, 3).sum(axis=(1, 3)) / (area * 4).reshape(16, 4, 1, 1).sum(axis=1)
    shown = inverse_response(batch.ldr[0].permute(1, 2, 0).numpy())
    assert np.abs(shown - mean.clip(0, 1)).max() < 0.05


def test_a_sphere_shows_what_is_behind_the_camera_in_its_middle(tables):
    """Normals face the camera, right is right and up is up."""
    batch = make_batch(tables, balanced(tables, 1, 3))
    normals = batch.normals[0]
    assert normals[2, 12, 12] > 0.95
    assert normals[0, 12, 21] > 0.6
    assert normals[1, 3, 12] > 0.6
    assert not batch.photo[0, :, 0, 0].any()


def test_true_mirrors_unwrap_to_the_map(tables):
    batch = make_batch(tables, balanced(tables, 6, 3))
    unwrapped = unwrap_sphere(batch.sphere, SCALE.rows)
    grey = unwrap_mirror(batch.mirror, batch.normals, batch.photo[:, 3:], SCALE.rows)
    flipped = batch.ldr.flip(3)
    for guess, limit in ((unwrapped, 0.06), (grey, 0.12)):
        error = (guess - batch.ldr).square().mean().sqrt()
        assert error < limit
        assert error < 0.8 * (guess - flipped).square().mean().sqrt()


def test_every_pair_comes_once_an_epoch_and_seeds_differ(tables):
    order = Order(tables, 16, seed=0)
    assert tables.count == 2 * VIEWS * len(MATERIALS) * 2
    seen = [order.chosen(step) for step in range(tables.count // 16)]
    numbers = torch.cat([((c.map * VIEWS + c.view) * len(MATERIALS) + c.material) * 2 + c.shape for c in seen])
    assert torch.equal(numbers.sort().values, torch.arange(tables.count))
    over_the_end = Order(tables, 500, seed=0).chosen(1)
    assert len(over_the_end.map) == 500
    other = Order(tables, 16, seed=1).chosen(0)
    assert not torch.equal(other.map * VIEWS + other.view, seen[0].map * VIEWS + seen[0].view)


def test_gradual_targets_are_equation_6(tables):
    """Against the sum over all pixels, weighted by solid angle, at the first epochs; sharp at the last."""
    ldr = tables.ldr[3:4]
    truth = ldr[0].permute(1, 2, 0).double().numpy() / 255
    directions = pixel_directions(SCALE.rows).astype(float)
    area = np.broadcast_to(pixel_solid_angles(SCALE.rows), (SCALE.rows, 2 * SCALE.rows))
    for epoch, power in ((1, 1), (2, 8), (3, 27)):
        soft = filtered(ldr, epoch)[0].permute(1, 2, 0).float().numpy()
        for row, column in ((0, 0), (6, 31), (9, 4)):
            weight = np.maximum(directions @ directions[row, column], 0.0) ** power * area
            expected = (weight[..., None] * truth).sum(axis=(0, 1)) / weight.sum()
            assert soft[row, column] == pytest.approx(expected, abs=2e-3)
    middle = slice(4, 12)  # near the poles neighbours are close
    last = filtered(ldr, 11).float() - ldr.float() / 255
    assert last[:, :, middle].abs().max() < 1e-3
    assert [epoch_of(progress) for progress in (0.0, 0.0908, 0.0910, 0.999)] == [1, 1, 2, 11]


def test_a_run_that_stopped_goes_on_as_one_that_did_not(tables, tmp_path):
    run = Run(pairs=10 * SCALE.batch, seed=4, scale=SCALE)
    whole = Trainer(run, tables)
    expected = [whole.advance() for _ in range(10)]
    first = Trainer(run, tables)
    for _ in range(6):
        first.advance()
    first.save(tmp_path / "checkpoint.pt")
    second = Trainer(run, tables)
    second.load(tmp_path / "checkpoint.pt")
    for before in expected[6:]:
        now = second.advance()
        assert {name: float(x) for name, x in now.items()} == {name: float(x) for name, x in before.items()}
    for name, value in whole.nets.state_dict().items():
        assert torch.equal(value, second.nets.state_dict()[name]), name
    with pytest.raises(ValueError, match="use another folder"):
        Trainer(replace(run, seed=5), tables).load(tmp_path / "checkpoint.pt")


def test_no_loss_reaches_another_network(tables):
    nets = Designs(SCALE, 0)
    losses = Losses(nets, tables)(make_batch(tables, balanced(tables, 6, 1)), 0.0)
    assert set(losses) == set(nets)
    for name, loss in losses.items():
        nets.zero_grad()
        loss.backward(retain_graph=True)
        reached = {other for other in nets if any(p.grad is not None for p in nets[other].parameters())}
        assert reached == {name}


def test_designs_see_and_aim_at_what_they_are_named_for(tables):
    """At the first epoch targets that sharpen are a grey blur, the others are the map."""
    nets, batch = Designs(SCALE, 0), make_batch(tables, balanced(tables, 6, 1))
    losses = {name: loss.item() for name, loss in Losses(nets, tables)(batch, 0.0).items()}
    seen = inputs_of(batch, nets.irradiance_image(batch).detach())
    assert torch.equal(seen["truth"][:, :3], batch.irradiance)
    assert not torch.equal(seen["estimate"][:, :3], batch.irradiance)
    soft = filtered(tables.ldr, 1)[batch.light].float()
    for name, design in DESIGNS.items():
        target = soft if design.gradual else batch.ldr
        guess = nets.run(name, seen[design.sees])
        assert losses[name] == pytest.approx((guess - target).square().mean().item(), rel=1e-4)
    assert {name for name, design in DESIGNS.items() if design.gradual} == {"ours", "ideal"}
    a, b = nets["direct"].state_dict(), nets["ideal"].state_dict()
    assert all(torch.equal(a[key], b[key]) for key in a)


def test_ssim_is_scikit_images():
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 2, 3, 24, 24), dtype=np.float32)
    b = (a + b) / 2
    found = ssim(torch.from_numpy(a), torch.from_numpy(b), wraps=False)
    for k in range(2):
        _, full = structural_similarity(
            a[k], b[k], data_range=1.0, channel_axis=0, gaussian_weights=True, sigma=1.5,
            use_sample_covariance=False, full=True,
        )  # fmt: skip
        assert float(found[k]) == pytest.approx(full[:, 5:-5, 5:-5].mean(), abs=1e-4)
    turned = ssim(torch.from_numpy(a).roll(7, 3), torch.from_numpy(b).roll(7, 3), wraps=True)
    assert torch.allclose(turned, ssim(torch.from_numpy(a), torch.from_numpy(b), wraps=True), atol=1e-6)


def test_pairs_of_one_map_count_as_one_for_the_error():
    rng = np.random.default_rng(1)
    maps, shapes = np.arange(400) // 40, np.arange(400) % 8
    by_map = rng.normal(size=10)[maps]
    assert clustered_error(by_map, maps, shapes) == pytest.approx(by_map.std() / 3, rel=0.01)
    alone = rng.normal(size=400)
    assert clustered_error(alone, np.arange(400), np.arange(400) % 399) == pytest.approx(alone.std() / 20, rel=0.1)


def test_a_step_holds_only_where_every_seed_says_so():
    assert verdict([(0.03, 0.01), (0.02, 0.004)]) == "holds"
    assert verdict([(0.03, 0.01), (0.02, 0.011)]) == "open"
    assert verdict([(-0.03, 0.01), (-0.02, 0.004)]) == "reversed"
    assert verdict([(0.03, 0.01)]) == "one seed"


def test_runs_are_judged_evenly_on_a_logarithm_and_rates_rise_and_fall():
    assert judged_at(200_000, 125) >= {20, 200, 2000, 20_000, 200_000}
    assert len(judged_at(200_000, 125)) == 17
    rates = [rate_at(step, 20_000) for step in (0, 499, 10_000, 17_000, 19_999)]
    assert rates == pytest.approx([2e-6, 1e-3, 1e-3, 5e-4, 1e-5], rel=1e-3)


def test_what_was_trained_becomes_a_page(tables, tmp_path):
    judge = Judge(tables, tables, 40)
    for seed in (0, 1):
        train(Run(pairs=12, seed=seed, scale=SCALE), tables, judge, tmp_path)
    points = read_points(tmp_path)
    assert [(point.pairs, point.seed, point.after) for point in points] == [(12, 0, 12), (12, 1, 12)]
    assert points[0].columns["test/direct/rmse"].shape == (40,)
    pytest.importorskip("matplotlib", reason="draws the plot")
    (tmp_path / "README.md").write_text("# Title\n<!-- results -->\nold\n<!-- end of results -->\nrest\n")
    write_report(tmp_path, tmp_path)
    page = (tmp_path / "README.md").read_text()
    assert page.startswith("# Title\n<!-- results -->")
    assert page.endswith("<!-- end of results -->\nrest\n")
    assert "old" not in page
    assert "| Irradiance -> Ours |" in page
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_a_report_keeps_earlier_sizes_and_ceilings_and_what_is_new_wins():
    def row(pairs: int, value: float) -> dict:
        return {"pairs": pairs, "seed": 0, "after": pairs, "test/direct/rmse": value}

    earlier = {
        "pairs": 100,
        "rows": {"direct": {"test_rmse": 0.3}, "mean map": {"test_rmse": 0.4}},
        "steps": {"20": "old", "100": "old"},
        "curves": [row(20, 0.3), row(100, 0.3)],
    }
    new = {"rows": {"direct": {"test_rmse": 0.2}}, "steps": {"100": "new", "1000": "new"}, "pairs": 1000}
    new["curves"] = [row(100, 0.25), row(1000, 0.2)]
    both = with_earlier(new, earlier)
    assert both["rows"] == {"direct": {"test_rmse": 0.2}, "mean map": {"test_rmse": 0.4}}
    assert list(both["steps"].items()) == [("20", "old"), ("100", "new"), ("1000", "new")]
    assert [one["test/direct/rmse"] for one in both["curves"]] == [0.3, 0.25, 0.2]
    assert both["pairs"] == 1000
    shorter = with_earlier(earlier, both)  # the table stays the longest run's
    assert shorter["pairs"] == 1000
    assert shorter["rows"] == both["rows"]


def test_scores_do_not_depend_on_who_else_is_judged(tables):
    nets, chosen = Designs(SCALE, 0), balanced(tables, 12, 1)
    alone = scores(nets, tables, balanced(tables, 6, 1))
    together = scores(nets, tables, replace(chosen, **{n: getattr(chosen, n)[:6] for n in chosen.__slots__}))
    assert set(alone) == set(together)
    assert together["direct/rmse"].shape == (6,)
