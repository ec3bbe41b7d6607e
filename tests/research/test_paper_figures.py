"""research.paper_designs.figures: pictures of the kept half-size designs, and what they are drawn of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from support.some_pair import sphere_pair

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.frames import reflect  # noqa: E402
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions  # noqa: E402
from anyprobe.core.response import inverse_response, response  # noqa: E402
from anyprobe.errors import InputError  # noqa: E402
from anyprobe.light.reconstruct import blend_weight  # noqa: E402
from anyprobe.render.spheres import sphere_normals  # noqa: E402
from anyprobe.render.surface import pixel_rays  # noqa: E402
from research.paper_designs.figures import __main__ as command  # noqa: E402
from research.paper_designs.figures import half_size, losses, relit, rivals  # noqa: E402
from research.paper_designs.figures.half_size import METHODS, SHIPPED, HalfSize  # noqa: E402
from research.paper_designs.figures.mixed import box_of, cut_planes  # noqa: E402
from research.paper_designs.figures.real import real_normals, real_photos  # noqa: E402
from research.paper_designs.figures.sheet import FONT, Tile, bars, save, sheet, wrapped  # noqa: E402
from research.paper_designs.judge import spread_mirror  # noqa: E402


def has_history() -> bool:
    try:
        half_size.kept_file(half_size.LOG)
    except InputError:
        return False
    return True


needs_history = pytest.mark.skipif(not has_history(), reason="needs a clone with its history")


@pytest.fixture(scope="module")
def half():
    return HalfSize()


@needs_history
def test_the_kept_networks_see_light_in_a_sphere(half):
    pair = sphere_pair()
    found = rivals.estimates(half, pair)
    assert tuple(found) == METHODS
    for name, one in found.items():
        assert one.ldr.shape == (64, 128, 3)
        assert 0 <= one.ldr.min() <= one.ldr.max() <= 1
        assert (one.radiance is None) == (name not in ("Ours", SHIPPED))
    assert np.ptp(found["Meka et al."].ldr, axis=-1).max() == 0  # it says no colour
    dark = blend_weight(found["Ours"].ldr)[..., 0] == 0
    assert found["Ours"].radiance[dark] == pytest.approx(inverse_response(found["Ours"].ldr)[dark], rel=1e-5)
    truth = response(pair.radiance)
    assert truth[:32].mean() > truth[32:].mean() + 0.2  # light from above, which all of them see
    for one in found.values():
        assert one.ldr[:32].mean() > one.ldr[32:].mean() + 0.03


@needs_history
def test_each_figure_is_drawn(half, tmp_path, capsys):
    pair = sphere_pair()
    pairs = [pair, replace(pair, material=replace(pair.material, alpha=0.9))]
    losses.draw_losses(half_size.kept_losses(), tmp_path)
    rivals.draw_synthetic(half, pairs, tmp_path)
    rivals.draw_bars([], tmp_path)
    relit.draw_relit(half, pairs[:1], tmp_path)
    said = capsys.readouterr().out
    assert "ours: last 10% of steps: loss" in said
    assert "SSIM, Synth-Diff, 500 pairs: 0.288 Ours, 0.288 Georgoulis et al. (Ours " in said
    assert "Georgoulis et al.: RMSE of the relit object 0.356, 1000 pairs" in said
    assert sorted(path.name for path in tmp_path.glob("figure_*")) == [
        "figure_06.png",
        "figure_12.jpg",
        "figure_13.png",
        "figure_14.jpg",
    ]
    for path in tmp_path.glob("figure_*"):
        assert np.ptp(np.asarray(Image.open(path).convert("L"))) > 100


def test_a_clone_without_history_is_told(monkeypatch):
    monkeypatch.setattr(half_size, "COMMIT", "0000000")
    with pytest.raises(InputError, match="git fetch --unshallow"):
        half_size.kept_file(half_size.LOG)


def test_a_mirror_image_goes_where_its_pixels_see_the_map():
    """A sphere seen from near by: every pixel of the mirror image is the map where the reflected ray meets it."""
    tan_half = 0.4
    normals, inside = sphere_normals(64)
    picture = np.zeros((64, 64, 3), np.float32)
    picture[inside] = normals
    uv = direction_to_uv(reflect(pixel_rays(tan_half, 64), picture))
    light = 0.5 + 0.4 * pixel_directions(64) @ np.array([[0.6], [0.0], [0.8]], np.float32)
    mirror = torch.from_numpy(bilinear(light, uv)).permute(2, 0, 1)[None] * torch.from_numpy(inside.copy())[None, None]
    there = torch.from_numpy(inside.astype(np.float32))[None, None]
    spread = spread_mirror(mirror.float(), torch.from_numpy(uv)[None], there, 64)[0].permute(1, 2, 0).numpy()
    seen = pixel_directions(64)[..., 2] > 0.3
    assert np.abs(spread - light)[seen].max() < 0.06


def test_pairs_that_are_shown_are_of_assets_that_may_be_published(monkeypatch):
    """Recipes are "map, shape, side": two maps and one shape are free; each map is shown once."""
    licences = {"a": "CC0-1.0", "b": "CC0-1.0", "c": "not stated", "drill": "CC BY 4.0", "horse": "not stated"}

    class Store:
        def __init__(self, maps, shapes):
            self.map = self.shape = lambda name: SimpleNamespace(licence=licences[name])

    def pairs(recipes, store, kept):
        return [SimpleNamespace(name=one.name, specular=one.specular) for one in recipes]

    def recipe(map_id, shape_id, specular):
        name = f"{map_id} {shape_id} {specular}"
        return SimpleNamespace(name=name, map_id=map_id, shape_id=shape_id, specular=specular)

    listed = [("a", "horse", True), ("c", "drill", True), ("a", "drill", True), ("b", "drill", True)]
    listed += [("a", "drill", False), ("b", "drill", False), ("b", "drill", False)]
    monkeypatch.setattr(half_size, "AssetStore", Store)
    monkeypatch.setattr(half_size, "load_maps", lambda folder: folder)
    monkeypatch.setattr(half_size, "load_shapes", lambda folder: folder)
    monkeypatch.setattr(half_size, "kept_pairs", pairs)
    monkeypatch.setattr(half_size, "read_recipes", lambda path: [recipe(*one) for one in listed])
    shown = [pair.name for pair in half_size.shown_pairs(Path("data"), 1)]
    assert shown == ["a drill True", "b drill False"]


def test_a_ring_is_where_the_mirror_shows_the_lamp():
    grey = np.full((112, 112, 3), 0.5)
    for lamp, place in (((0, 0, 1), (56, 56)), ((1, 0, 0), (56 + 56 * 0.5**0.5, 56)), ((0, 1, 0), (56, 16.4))):
        marked = rivals._marked(grey, np.array(lamp, float))
        rows, columns = np.nonzero((marked != 0.5).any(axis=-1))
        assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx(place, abs=0.6)
    assert rivals._marked(grey, None) is grey


def test_real_photos_have_lamps_and_kinds(tmp_path):
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
            return SimpleNamespace(normals=np.tile(np.array([0, 0, 1], np.float32), (64, 64, 1)))

    normals = real_normals(real, Lift())
    assert normals.shape == (64, 64, 3)
    assert 0.5 < normals[..., 2].mean() < 0.9  # the sphere fills its crop, and nothing else has normals


def test_photos_need_no_table_but_masks(tmp_path):
    disc = np.hypot(*np.mgrid[-32:32, -32:32]) < 24
    Image.fromarray(disc.astype(np.uint8) * 150).convert("RGB").save(tmp_path / "011.png")
    with pytest.raises(InputError, match="expected photos with NAME_mask.png"):
        list(real_photos(tmp_path))
    Image.fromarray(disc.astype(np.uint8) * 255).save(tmp_path / "011_mask.png")
    (plain,) = real_photos(tmp_path)
    assert (plain.name, plain.specular, plain.lamp) == ("011", False, None)
    (tmp_path / "manifest.csv").write_text("id,source,material\n011,someone,glazed clay\n")
    (told,) = real_photos(tmp_path)
    assert told.specular


def test_the_cut_takes_in_the_object_from_its_nearest_to_its_farthest_point():
    depth, mask = np.full((20, 20), 9.0), np.zeros((20, 20))
    mask[4:16, 4:16] = 1.0
    depth[4:16, 4:16] = np.linspace(2.0, 3.0, 12)[:, None]
    depth[4, 4:16], depth[4:16, 4] = 0.5, 8.0  # means of the object's edge with nothing, and with what is behind
    depth[8, 8] = 0.0  # not measured
    near, far = cut_planes(depth, mask)
    assert near == pytest.approx(depth[6, 10] - 0.05)
    assert far == pytest.approx(depth[13, 10])
    assert box_of(mask).sum() == 144


def test_a_page_has_its_tiles_and_bars_their_heights(tmp_path):
    page = sheet(["a", "b"], [[Tile(picture=np.zeros((8, 8, 3))), Tile(picture=np.zeros((8, 16, 3)))]])
    assert page.width >= 3 * 128
    shown = bars({"RMSE": {"Synth": {"x": 1.0, "y": 0.5}}}, {"x": "#ff0000", "y": "#0000ff"}, {"RMSE": 2})
    colors = np.asarray(shown).reshape(-1, 3).tolist()
    assert colors.count([255, 0, 0]) / colors.count([0, 0, 255]) == pytest.approx(2.0, rel=0.1)
    save(page, tmp_path / "page.jpg")
    with Image.open(tmp_path / "page.jpg") as written:
        assert written.size == page.size


def test_a_note_is_as_wide_as_its_page():
    note = "photos of 64 x 64 after 160,000 pairs, and more words"
    lines = wrapped(note, 120)
    assert " ".join(lines) == note
    assert len(lines) > 2
    assert max(FONT.getlength(line) for line in lines) <= 120
    tall = sheet(["a"], [[Tile(picture=np.zeros((8, 8, 3)))]], note)
    assert tall.height > sheet(["a"], [[Tile(picture=np.zeros((8, 8, 3)))]]).height


def test_another_figure_is_refused():
    with pytest.raises(InputError, match="expected a figure of"):
        command.main("3")


def test_a_texture_leaves_the_mask_and_what_is_true():
    from research.paper_designs.figures.textured import textured

    pair = sphere_pair()
    painted = textured(pair)
    assert (painted.photo[..., 3] == pair.photo[..., 3]).all()
    assert (painted.radiance == pair.radiance).all()
    assert (painted.photo[..., :3] != pair.photo[..., :3]).any()
    assert (painted.photo[~pair.normals.any(axis=-1), :3] == pair.photo[~pair.normals.any(axis=-1), :3]).all()
