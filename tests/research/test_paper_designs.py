"""The paper's experiment in small: pairs against the renderer, gradual targets, exact resuming, scores."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skimage.metrics import structural_similarity

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles  # noqa: E402
from anyprobe.core.response import inverse_response  # noqa: E402
from anyprobe.core.sampling import hammersley  # noqa: E402
from anyprobe.render.integrate import shade, shading_pyramid  # noqa: E402
from anyprobe.render.shapes import sphere  # noqa: E402
from research.paper_designs.blocks import picture_of, pixels_of, unnest  # noqa: E402
from research.paper_designs.designs import DESIGNS, Designs, Losses, inputs_of  # noqa: E402
from research.paper_designs.gradual import epoch_of, filtered  # noqa: E402
from research.paper_designs.judge import Judge, clustered_error, scores, ssim, unwrap_mirror, unwrap_sphere  # noqa: E402
from research.paper_designs.nets import PictureNet, UNet  # noqa: E402
from research.paper_designs.pairs import Order, PairMaker, balanced  # noqa: E402
from research.paper_designs.report import read_points, verdict, write_report  # noqa: E402
from research.paper_designs.scale import MATERIALS, SCALES, VIEWS  # noqa: E402
from research.paper_designs.tables import build_tables, views_of  # noqa: E402
from research.paper_designs.train import Run, Trainer, judged_at, rate_at, train  # noqa: E402
from research.paper_designs.transport import TO_EYE, hemisphere  # noqa: E402

SCALE = replace(SCALES["small"], normals=120, light_rows=64, batch=6, width=12, code=16)


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
    batch = PairMaker(tables)(chosen)
    photo, irradiance, normals = (picture_of(x, SCALE.side) for x in (batch.photo, batch.irradiance, batch.normals))
    for k in range(8):
        n = normals[k].permute(1, 2, 0)[12, 12]
        number = int((tables.normals[:-1] @ n).argmax())
        row = (int(chosen.map[k]) * VIEWS + int(chosen.view[k])) * len(MATERIALS) + int(chosen.material[k])
        value = tables.shades[row, number].reshape(1).view(torch.uint8).float() / 255
        assert torch.allclose(photo[k, :3, 12, 12], value[:3])
        assert torch.allclose(irradiance[k, :, 12, 12], value[3:6])
    light = views_of(some_map(int(chosen.map[0])), 64)[int(chosen.view[0])]
    area = pixel_solid_angles(64)[:, :, None]
    mean = (light * area).reshape(16, 4, 32, 4, 3).sum(axis=(1, 3)) / (area * 4).reshape(16, 4, 1, 1).sum(axis=1)
    shown = inverse_response(picture_of(batch.ldr, SCALE.rows)[0].permute(1, 2, 0).numpy())
    assert np.abs(shown - mean.clip(0, 1)).max() < 0.05


def test_a_sphere_shows_what_is_behind_the_camera_in_its_middle(tables):
    """Normals face the camera, right is right and up is up."""
    batch = PairMaker(tables)(balanced(tables, 1, 3))
    normals = picture_of(batch.normals, SCALE.side)[0]
    assert normals[2, 12, 12] > 0.95
    assert normals[0, 12, 21] > 0.6
    assert normals[1, 3, 12] > 0.6
    assert not picture_of(batch.photo, SCALE.side)[0, :, 0, 0].any()


def test_true_mirrors_unwrap_to_the_map(tables):
    batch = PairMaker(tables)(balanced(tables, 6, 3))
    photos = (picture_of(x, SCALE.side) for x in (batch.sphere, batch.mirror, batch.normals, batch.photo[..., 3:]))
    sphere_image, mirror, normals, mask = photos
    unwrapped = unwrap_sphere(sphere_image, SCALE.rows)
    grey = unwrap_mirror(mirror, normals, mask, SCALE.rows)
    ldr = picture_of(batch.ldr, SCALE.rows)
    flipped = ldr.flip(3)
    for guess, limit in ((unwrapped, 0.06), (grey, 0.12)):
        error = (guess - ldr).square().mean().sqrt()
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


def test_pixels_of_a_block_are_neighbours():
    for rows, columns in ((24, 24), (16, 32), (64, 128)):
        pictures = torch.randn(2, 3, rows, columns)
        pixels = pixels_of(pictures)
        assert torch.equal(picture_of(pixels, rows), pictures)
        whole = pictures[0].permute(1, 2, 0)
        assert torch.equal(pixels[0, :16].reshape(4, 4, 3), whole[:4, :4])
        assert torch.equal(pixels[0, 16:32].reshape(4, 4, 3), whole[:4, 4:8])
        assert torch.equal(pixels[0, 32:48].reshape(4, 4, 3), whole[4:8, :4])


def test_the_first_layer_is_a_strided_convolution():
    net, pictures = PictureNet(4, 24, 512, 12, 16), torch.randn(2, 4, 24, 24)
    linear = net.encoder.patch[0]
    kernel = linear.weight.reshape(12, 4, 4, 4).permute(0, 3, 1, 2)
    expected = torch.relu(torch.nn.functional.conv2d(pictures, kernel, stride=4))
    found = unnest(net.encoder(pixels_of(pictures))[0], 6, 1).permute(0, 3, 1, 2)
    assert torch.allclose(found, expected, atol=1e-5)


def test_networks_of_the_full_size_have_the_sizes_of_their_pictures():
    full = SCALES["full"]
    photo = torch.zeros(1, full.side**2, 7)
    assert PictureNet(7, full.side, 2 * full.rows**2, 12, 16)(photo).shape == (1, 2 * full.rows**2, 3)
    assert UNet(7, 1, full.side, full.side, 12, 16)(photo).shape == (1, full.side**2, 1)


def test_a_run_that_stopped_goes_on_as_one_that_did_not(tables, tmp_path):
    run = Run(pairs=10 * SCALE.batch, seed=4, scale=SCALE)
    whole = Trainer(run, tables)
    expected = [{name: loss.value() for name, loss in whole.advance().items()} for _ in range(10)]
    first = Trainer(run, tables)
    for _ in range(6):
        first.advance()
    first.save(tmp_path / "checkpoint.pt")
    second = Trainer(run, tables)
    second.load(tmp_path / "checkpoint.pt")
    for before in expected[6:]:
        assert {name: loss.value() for name, loss in second.advance().items()} == before
    for name, value in whole.nets.state_dict().items():
        assert torch.equal(value, second.nets.state_dict()[name]), name
    with pytest.raises(ValueError, match="use another folder"):
        Trainer(replace(run, seed=5), tables).load(tmp_path / "checkpoint.pt")


def test_a_step_is_adams_on_the_gradient_of_the_mean_squared_errors(tables, monkeypatch):
    monkeypatch.setattr("research.paper_designs.train.has_bfloat16", lambda device: False)
    run = Run(pairs=10 * SCALE.batch, seed=4, scale=SCALE)
    trainer, plain = Trainer(run, tables), Designs(SCALE, 4)
    trainer.advance()
    losses = Losses(plain, tables)(PairMaker(tables)(Order(tables, SCALE.batch, 4).chosen(0)), 0.0)
    means = [((1.0 if x.weight is None else x.weight) * (x.output - x.target).square()).mean() for x in losses.values()]
    optimizer = torch.optim.Adam(plain.parameters(), rate_at(0, run.steps), weight_decay=1e-4)
    sum(means).backward()
    optimizer.step()
    for name, value in plain.state_dict().items():
        assert torch.allclose(trainer.nets.state_dict()[name], value, atol=1e-6), name


def test_no_loss_reaches_another_network(tables):
    nets = Designs(SCALE, 0)
    losses = Losses(nets, tables)(PairMaker(tables)(balanced(tables, 6, 1)), 0.0)
    assert set(losses) == set(nets)
    for name, loss in losses.items():
        nets.zero_grad()
        loss.output.backward(loss.gradient(), retain_graph=True)
        reached = {other for other in nets if any(p.grad is not None for p in nets[other].parameters())}
        assert reached == {name}


def test_designs_see_and_aim_at_what_they_are_named_for(tables):
    """At the first epoch targets that sharpen are a grey blur, the others are the map."""
    nets, batch = Designs(SCALE, 0), PairMaker(tables)(balanced(tables, 6, 1))
    losses = {name: loss.value() for name, loss in Losses(nets, tables)(batch, 0.0).items()}
    seen = inputs_of(batch, nets["image"](batch.photo).detach())
    assert torch.equal(seen["truth"][..., :3], batch.irradiance)
    assert not torch.equal(seen["estimate"][..., :3], batch.irradiance)
    soft = pixels_of(filtered(tables.ldr, 1)[batch.light].float())
    for name, design in DESIGNS.items():
        target = soft if design.gradual else batch.ldr
        guess = nets[name](seen[design.sees])
        assert losses[name] == pytest.approx((guess - target).square().mean().item(), rel=1e-4)
    assert {name for name, design in DESIGNS.items() if design.gradual} == {"ours", "ideal", "normals"}
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
    steps = [Run(pairs=pairs, seed=0, scale=SCALES["small"]).steps for pairs in (2_500, 25_000, 250_000, 25_000_000)]
    assert steps == [100, 1000, 1000, 50_000]
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
    (tmp_path / "README.md").write_text("# Title\n<!-- results -->\nyesterday\n<!-- end of results -->\nrest\n")
    write_report(tmp_path, tmp_path)
    page = (tmp_path / "README.md").read_text()
    assert page.startswith("# Title\n<!-- results -->")
    assert page.endswith("<!-- end of results -->\nrest\n")
    assert "yesterday" not in page
    assert "| Irradiance -> Ours |" in page
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_scores_do_not_depend_on_who_else_is_judged(tables):
    nets, chosen = Designs(SCALE, 0), balanced(tables, 12, 1)
    alone = scores(nets, tables, balanced(tables, 6, 1))
    together = scores(nets, tables, replace(chosen, **{n: getattr(chosen, n)[:6] for n in chosen.__slots__}))
    assert set(alone) == set(together)
    assert together["direct/rmse"].shape == (6,)
