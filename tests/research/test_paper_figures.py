"""research.paper_designs.figures: pictures of a tiny run, and what they are drawn of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.errors import InputError  # noqa: E402
from anyprobe.render.shapes import sphere  # noqa: E402
from research.paper_designs.blocks import picture_of  # noqa: E402
from research.paper_designs.figures import __main__ as command  # noqa: E402
from research.paper_designs.figures import losses, relit, rivals, trained  # noqa: E402
from research.paper_designs.figures.mixed import cut_planes  # noqa: E402
from research.paper_designs.figures.real import real_maps, real_photos  # noqa: E402
from research.paper_designs.figures.sheet import Tile, bars, save, sheet  # noqa: E402
from research.paper_designs.figures.trained import METHODS, judged_batch, judged_pairs, maps_of  # noqa: E402
from research.paper_designs.scale import SCALES  # noqa: E402
from research.paper_designs.tables import build_tables, cached_tables  # noqa: E402
from research.paper_designs.train import KEPT_LOSSES, Run, Trainer  # noqa: E402

SCALE = replace(SCALES["small"], normals=120, light_rows=64, batch=6, width=12, code=16)
RUN = Run(pairs=75, seed=0, scale=SCALE)
NAMES = {"thatch_chapel": 0, "snowy_field": 1, "field": 2}
"""Maps of the frozen set; the last may not be published."""


def some_map(seed: int) -> np.ndarray:
    """A soft sky with a window."""
    rng = np.random.default_rng(seed)
    sky = 0.5 + 0.2 * pixel_directions(64) @ rng.normal(size=(3, 3)).astype(np.float32)
    sky[10:20, 30:44] += 5.0
    return np.maximum(sky, 0.02).astype(np.float32)


@pytest.fixture(scope="module")
def tables():
    maps = {name: some_map(seed) for name, seed in NAMES.items()}
    return build_tables(SCALE, maps, {"drill": sphere(16), "horse": sphere(24)})


@pytest.fixture
def runs(tables, tmp_path, monkeypatch):
    """A folder as train leaves it, of three steps."""
    monkeypatch.setitem(SCALES, "small", SCALE)
    folder = tmp_path / "runs" / "small"
    cached_tables(folder / "tables_test.pt", lambda: tables)
    trainer = Trainer(RUN, tables)
    while trainer.step < RUN.steps:
        trainer.advance()
    (folder / RUN.name).mkdir()
    trainer.save(folder / RUN.name / "checkpoint.pt")
    return tmp_path / "runs"


@pytest.fixture
def one(runs):
    return trained.trained(runs, "small", RUN.pairs, RUN.seed)


def test_losses_are_kept_step_by_step_through_a_stop(tables, tmp_path):
    whole, first, second = (Trainer(RUN, tables) for _ in range(3))
    steps = [whole.advance() for _ in range(RUN.steps)]
    shown = [[losses[name].value() for name in KEPT_LOSSES] for losses in steps]
    first.advance()
    first.save(tmp_path / "checkpoint.pt")
    second.load(tmp_path / "checkpoint.pt")
    while second.step < RUN.steps:
        second.advance()
    assert whole.losses == shown
    assert np.asarray(second.losses) == pytest.approx(np.asarray(shown), rel=1e-6)


def test_a_run_that_is_not_there_or_has_not_ended_is_refused(runs, tables):
    with pytest.raises(InputError, match="expected a finished run, found none"):
        trained.trained(runs, "small", 100, 0)
    trainer = Trainer(RUN, tables)
    trainer.advance()
    trainer.save(runs / "small" / RUN.name / "checkpoint.pt")
    with pytest.raises(InputError, match=f"expected step {RUN.steps}, got 1"):
        trained.trained(runs, "small", RUN.pairs, 0)


def test_pairs_that_are_shown_are_of_assets_that_may_be_published(one):
    for specular in (True, False):
        every = judged_pairs(one, specular)
        assert {int(k) % 2 for k in every.material} == {0 if specular else 1}
        shown = judged_pairs(one, specular, 4, shown=True)
        assert [one.test.map_names[int(k)] for k in sorted(shown.map)] == ["thatch_chapel", "snowy_field"]
        assert {one.test.shape_names[int(k)] for k in shown.shape} == {"drill"}


def test_maps_are_those_of_the_networks_beside_the_truth(one):
    batch = judged_batch(one, judged_pairs(one, True, 2))
    maps = maps_of(one.nets, batch, SCALE.side, SCALE.rows)
    assert set(maps.ldr) == {*METHODS, "truth"}
    assert maps.ldr["truth"] == pytest.approx(picture_of(batch.ldr, SCALE.rows).permute(0, 2, 3, 1).numpy())
    for values in maps.ldr.values():
        assert values.shape == (2, SCALE.rows, 2 * SCALE.rows, 3)
    assert np.ptp(maps.ldr["meka"], axis=-1).max() == 0  # it says no colour
    assert maps.radiance.shape == (2, SCALE.rows, 2 * SCALE.rows, 3)


def test_each_figure_is_drawn(one, tmp_path, capsys):
    losses.draw_losses(one, tmp_path)
    rivals.draw_synthetic(one, tmp_path)
    rivals.draw_bars(one, [], tmp_path)
    relit.draw_relit(one, tmp_path)
    said = capsys.readouterr().out
    assert "Ours, gradual targets: last 10% of steps: loss" in said
    assert "SSIM, Synth-Diff: Ours" in said
    assert "Georgoulis et al.: RMSE of the relit object" in said
    assert sorted(path.name for path in tmp_path.glob("figure_*")) == [
        "figure_06.png",
        "figure_12.jpg",
        "figure_13.png",
        "figure_14.jpg",
    ]
    for path in tmp_path.glob("figure_*"):
        assert np.ptp(np.asarray(Image.open(path).convert("L"))) > 100


def test_a_ring_is_where_the_mirror_shows_the_lamp():
    grey = np.full((112, 112, 3), 0.5)
    for lamp, place in (((0, 0, 1), (56, 56)), ((1, 0, 0), (56 + 56 * 0.5**0.5, 56)), ((0, 1, 0), (56, 16.4))):
        marked = rivals._marked(grey, np.array(lamp, float))
        rows, columns = np.nonzero((marked != 0.5).any(axis=-1))
        assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx(place, abs=0.6)
    assert rivals._marked(grey, None) is grey


def test_real_photos_have_lamps_and_kinds(tmp_path, one):
    ball = np.zeros((64, 64, 3), np.uint8)
    y, x = np.mgrid[:64, :64]
    inside = np.hypot(x - 31.5, y - 31.5) < 24
    ball[inside] = 150
    Image.fromarray(ball).save(tmp_path / "owl_1.png")
    Image.fromarray(inside.astype(np.uint8) * 255).save(tmp_path / "owl_mask.png")
    (tmp_path / "lights.csv").write_text(
        "file,mask,object,material,x,y,z\nowl_1.png,owl_mask.png,owl,glossy brown,0,0,2\n"
    )
    (real,) = real_photos(tmp_path)
    assert real.specular
    assert real.lamp == pytest.approx([0, 0, 1], abs=1e-2)

    class Lift:
        def __call__(self, image, tan_half):
            normals = np.zeros((64, 64, 3), np.float32)
            normals[..., 2] = 1.0
            return type("Outputs", (), {"normals": normals})

    maps = real_maps(one, real, Lift())
    assert maps.ldr["ours"].shape == (1, SCALE.rows, 2 * SCALE.rows, 3)


def test_the_cut_takes_in_the_object_from_its_nearest_to_its_farthest_point():
    depth = np.array([[2.0, 3.0, 9.0], [2.5, 0.0, 9.0]])
    mask = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    near, far = cut_planes(depth, mask)
    assert 1.9 < near < 2.0
    assert far == 3.0


def test_a_page_has_its_tiles_and_bars_their_heights(tmp_path):
    page = sheet(["a", "b"], [[Tile(picture=np.zeros((8, 8, 3))), Tile(picture=np.zeros((8, 16, 3)))]])
    assert page.width >= 3 * 112
    shown = bars({"RMSE": {"Synth": {"x": 1.0, "y": 0.5}}}, {"x": "#ff0000", "y": "#0000ff"}, {"RMSE": 2})
    colors = np.asarray(shown).reshape(-1, 3).tolist()
    assert colors.count([255, 0, 0]) / colors.count([0, 0, 255]) == pytest.approx(2.0, rel=0.1)
    save(page, tmp_path / "page.jpg")
    assert Image.open(tmp_path / "page.jpg").size == page.size


def test_another_figure_is_refused():
    with pytest.raises(InputError, match="expected a figure of"):
        command.main("3")


def test_a_texture_leaves_the_mask_and_what_is_true():
    from support.some_pair import some_pair

    from research.paper_designs.figures.textured import textured

    pair = some_pair()
    painted = textured(pair)
    assert (painted.photo[..., 3] == pair.photo[..., 3]).all()
    assert (painted.radiance == pair.radiance).all()
    assert (painted.photo[..., :3] != pair.photo[..., :3]).any()
    assert (painted.photo[~pair.normals.any(axis=-1), :3] == pair.photo[~pair.normals.any(axis=-1), :3]).all()
