"""anyprobe relight and Light.render: where the object stands, what changes, what does not, what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.refused import refused
from support.scenes import made_map, sphere_photo

import anyprobe
from anyprobe.core.camera import ASSUMED_LONG_FOV_DEG, MOST_STRETCH
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.estimate.ground import contact_of, estimate_ground, up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.files.objects import OBJECTS, open_object
from anyprobe.light.filtering import irradiance_map
from anyprobe.notices import give
from anyprobe.pictures.images import read_image
from anyprobe.relight.appearance import least_scale, material_from_photo
from anyprobe.relight.ground_view import View
from anyprobe.relight.insert import Arrangement, Stage, cast_shadow
from anyprobe.relight.placement import shaded
from anyprobe.relight.shadow import REACH
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe.scatter.materials import Material

pytestmark = pytest.mark.usefixtures("rough_shadows", "networks_opened_once")

WIDTH, HEIGHT, DIAMETER = 240, 160, 60
WHITE = Material(albedo=np.ones(3), f0=np.zeros(3), alpha=1.0)


@pytest.fixture
def photo():
    return load_photo(sphere_photo((60, 90), DIAMETER, HEIGHT, WIDTH))


@pytest.fixture
def stage(photo):
    return Stage(photo, sphere(24))


# Light.render


def test_render_is_linear_radiance_and_coverage():
    light = anyprobe.Light(radiance=np.full((16, 32, 3), 0.5, np.float32))
    metal = Material(albedo=np.zeros(3), f0=np.ones(3), alpha=0.1)
    picture = light.render(sphere(24), metal, size=32)
    assert picture.shape == (32, 32, 4)
    inside = picture[..., 3] == 1
    assert 0.55 < inside.mean() < np.pi / 4
    np.testing.assert_allclose(picture[10:22, 10:22, :3], 0.5, rtol=0.02)  # the white furnace
    assert picture[0, 0].max() == 0


def test_render_agrees_with_lambert():
    """A white Lambert sphere sends E(n) / pi to a far camera; but for the Schlick term's grazing sheen."""
    light = anyprobe.Light(radiance=made_map())
    picture = light.render(sphere(48), WHITE, size=32, fov_deg=2.0)
    middle = irradiance_map(made_map())[8, 16] / np.pi  # near the horizon, in front: the far side
    behind = irradiance_map(made_map())[7:9][:, [0, -1]].mean(axis=(0, 1)) / np.pi
    np.testing.assert_allclose(picture[14:18, 14:18, :3].mean(axis=(0, 1)), behind, rtol=0.03)
    assert np.abs(behind / middle - 1).max() > 0.1  # the two can be told apart


def test_render_turns_with_the_camera():
    """A camera on the emitter's side sees the lit side."""
    light = anyprobe.Light(radiance=made_map())
    half_turn = np.diag([-1.0, 1.0, -1.0])
    toward = light.render(sphere(24), "matte", size=24)[..., :3].sum()
    away = light.render(sphere(24), "matte", size=24, world_from_camera=half_turn)[..., :3].sum()
    assert toward > 1.3 * away  # the emitter is behind the camera, z = 0.5


# Where it stands


@pytest.mark.parametrize(("center_x", "side"), [(60, 1), (180, -1)])
def test_object_stands_beside_on_the_same_row(center_x, side):
    photo = load_photo(sphere_photo((center_x, 90), DIAMETER, HEIGHT, WIDTH))
    stage = Stage(photo, sphere(24), Arrangement(size=0.8))
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    assert pixels[:, 1].max() == pytest.approx(90 + DIAMETER / 2, abs=1.0)
    assert (pixels[:, 0].mean() - center_x) * side > DIAMETER / 2
    assert np.ptp(pixels[:, 1]) == pytest.approx(0.8 * DIAMETER, rel=0.1)
    assert stage.warnings == ()
    left, right = pixels[:, 0].min(), pixels[:, 0].max()
    assert left >= 0
    assert right <= WIDTH
    assert (left > center_x + DIAMETER / 2) if side > 0 else (right < center_x - DIAMETER / 2)


@pytest.mark.parametrize(("grey", "said"), [(0, True), (128, False)])
def test_black_that_hides_shadows_is_said(grey, said):
    """Of a cut-out too, unless it is black because it is transparent."""
    picture = sphere_photo((60, 90), DIAMETER, HEIGHT, WIDTH)
    rgb, alpha = picture[..., :3].copy(), picture[..., 3]
    rgb[alpha == 0] = grey
    stage = Stage(load_photo(rgb, mask=alpha), sphere(24), Arrangement(size=0.8))
    assert any("so dark" in line for line in stage.warnings) == said
    transparent = load_photo(np.dstack([rgb, alpha]))
    assert not any("so dark" in line for line in Stage(transparent, sphere(24), Arrangement(size=0.8)).warnings)


@pytest.mark.ci
@pytest.mark.parametrize("diameter", [40, 150])
@pytest.mark.parametrize("where", [(0, 0), (0.5, 0.5), (1, 1)])
@pytest.mark.parametrize("stretch", [(1, 1, 1), (1, 0.2, 0.2), (0.2, 1, 0.2), (0.2, 0.2, 1)])
@pytest.mark.parametrize("size", [0.8, 4.0])
def test_border_cuts_off_only_what_was_put_there(diameter, where, stretch, size):
    middle = [
        diameter / 2 + 1 + share * (side - diameter - 2) for share, side in zip(where, (WIDTH, HEIGHT), strict=True)
    ]
    photo = load_photo(sphere_photo(tuple(map(int, middle)), diameter, HEIGHT, WIDTH))
    unit_sphere = sphere(24)
    mesh = Mesh(
        positions=unit_sphere.positions * np.array(stretch), faces=unit_sphere.faces, normals=unit_sphere.normals
    )
    stage = Stage(photo, mesh, Arrangement(size=size))
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    assert (pixels >= -0.5).all()
    assert (pixels <= np.array([WIDTH, HEIGHT]) + 0.5).all()
    assert np.ptp(pixels, axis=0).max() > 0.1 * diameter * min(stretch)
    assert not any("outside" in line for line in stage.warnings)
    if size > 1 and (diameter > 40 or stretch == (0.2, 0.2, 1)):  # reaches behind the camera there
        return
    put = Stage(photo, mesh, Arrangement(size=size / 4, at=(WIDTH - 1, HEIGHT - 1), pitch_deg=15))
    over = put.view.pixels(put.placement.mesh.positions)[:, 0].max() - WIDTH
    assert over > 0
    assert any("outside" in line for line in put.warnings) == (over > 0.5)
    # what is drawn is the part that the photo shows, and all of it, however large the object
    drawn = put.window
    shown = np.clip(put.view.pixels(put.placement.mesh.positions), 0, (WIDTH, HEIGHT))
    assert (shown >= (drawn.left, drawn.top)).all()
    assert (shown <= (drawn.left + drawn.size, drawn.top + drawn.size)).all()
    assert drawn.size <= max(WIDTH, HEIGHT) + 4


@pytest.mark.parametrize(("fov_deg", "stretch"), [(38.0, 1.044), (None, 1.117), (65.0, 1.145)])
def test_sphere_near_the_border_is_long_by_the_lens_and_a_warning_says_so(fov_deg, stretch):
    """Seen at an angle t from the axis a distant sphere is 1 / cos t longer than wide."""
    photo = load_photo(sphere_photo((60, 90), DIAMETER, HEIGHT, WIDTH), fov_deg=fov_deg)
    stage = Stage(photo, sphere(48), Arrangement(at=(225, 90), size=0.3, pitch_deg=10))
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    wide, high = np.ptp(pixels, axis=0)
    assert wide / high == pytest.approx(stretch, abs=0.02)
    assert stage.view.long_fov_deg == pytest.approx(fov_deg or ASSUMED_LONG_FOV_DEG)
    said = [one for one in stage.warnings if "longer than wide" in one]
    assert [[give.name for give in one.remedy] for one in said] == (
        [] if stretch < MOST_STRETCH else [["at", "fov_deg"] if fov_deg is None else ["at"]]
    )


def test_foot_is_where_it_was_asked(photo):
    stage = Stage(photo, sphere(24), Arrangement(at=(170, 140), pitch_deg=10))
    np.testing.assert_allclose(stage.view.pixels(stage.placement.foot), [170, 140], atol=1e-6)
    assert stage.placement.foot @ stage.view.up == pytest.approx(-1)
    heights = stage.placement.mesh.positions @ stage.view.up + 1
    assert heights.min() == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("roll_deg", "source", "used_deg"), [(15.0, "estimated", 15.0), (2.0, "exif", 2.0), (2.0, "estimated", 0.0)]
)
def test_an_object_stands_upright_where_the_camera_is_rolled(photo, roll_deg, source, used_deg):
    ground = replace(estimate_ground(photo, pitch_deg=20.0), roll_deg=roll_deg, source=source)
    placed = Stage(photo, open_object("vase"), Arrangement(ground=ground)).placement
    top = placed.mesh.positions[np.argmax(placed.mesh.positions @ ground.up)] - placed.foot
    ring = placed.mesh.positions[placed.mesh.positions @ ground.up > top @ ground.up + placed.foot @ ground.up - 1e-6]
    axis = ring.mean(axis=0) - placed.foot
    np.testing.assert_allclose(axis / np.linalg.norm(axis), up_of(20.0, used_deg), atol=0.01)


def test_further_is_smaller(photo):
    sizes = []
    for row in (110, 150):
        mesh = Stage(photo, sphere(24), Arrangement(at=(170, row), pitch_deg=15)).placement.mesh
        sizes.append(np.ptp(Stage(photo, sphere(24)).view.pixels(mesh.positions)[:, 0]))
    assert sizes[0] < 0.8 * sizes[1]


@pytest.mark.parametrize("name", list(OBJECTS))
def test_objects_of_our_own_stand_on_their_base(photo, name):
    mesh = open_object(name)
    assert np.linalg.norm(mesh.positions, axis=1).max() <= 1.001
    Stage(photo, mesh)


def test_real_object_in_front_hides_the_virtual_one(photo):
    foot = 90 + DIAMETER // 2 - 12
    stage = Stage(photo, sphere(24), Arrangement(at=(75, foot), size=1.0, pitch_deg=15))
    picture = stage.relit(made_map(), "gold")
    inside = photo.mask > 0.99
    np.testing.assert_array_equal(picture[inside], photo.rgb[inside])
    assert (picture != photo.rgb).any()


@pytest.mark.parametrize("stretch", [(1, 1, 1), (0.3, 1, 0.3), (1, 0.5, 1)])
def test_default_is_half_as_high_as_the_real_object(photo, stretch):
    unit = sphere(24)
    mesh = Mesh(positions=unit.positions * np.array(stretch), faces=unit.faces, normals=unit.normals)
    stage = Stage(photo, mesh, Arrangement(pitch_deg=8))  # from above what is flat looks higher
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    assert np.ptp(pixels[:, 1]) == pytest.approx(DIAMETER / 2, rel=0.15)


def test_thin_spout_below_is_not_where_the_object_stands():
    """The contact line is the mask's lower border without what is narrower than a thirtieth of the object."""
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[40:100, 30:130], mask[100:130, 50:52] = 1, 1
    assert contact_of(mask) == (80.0, 100)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_object_stands_where_the_real_one_leaves_it_the_light(side):
    """On the other side it is in the shadow, up to the light over the real one."""
    photo = load_photo(sphere_photo((WIDTH // 2, 90), DIAMETER, HEIGHT, WIDTH))
    toward = np.array([side, 0.5, 0.0]) / np.hypot(1.0, 0.5)
    placed = Stage(photo, sphere(24), Arrangement(pitch_deg=15, toward_light=toward)).placement
    assert side * placed.foot[0] > 0
    shares = [
        shaded(np.array([[x, 0.0, -0.5]]), np.array([0.3]), np.array([1.0, 1.0]), np.array([0.0, 1.0, 0.0]), toward)
        for x in (-1.2, 1.2)
    ]
    assert (shares[0] - shares[1])[0] * side == pytest.approx(2 / 3)


def test_an_object_stands_where_spheres_are_drawn_round_if_it_can(photo):
    """Also under a wide lens, which makes them long towards the corners."""
    wide = Stage(replace(photo, long_fov_deg=90.0), sphere(24))
    assert wide.view.stretch(*wide.view.pixels(wide.placement.mesh.positions).mean(axis=0)) < 1.12


@pytest.mark.parametrize(("left", "right"), [(20, 150), (90, 220)])
def test_never_over_the_real_object(left, right):
    """Whatever the shape and the side, the pixels of the real object stay as they are."""
    picture = sphere_photo((120, 80), DIAMETER, HEIGHT, WIDTH)
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[20:140, left:right] = 1
    photo = replace(load_photo(picture), mask=mask)
    for name in OBJECTS:
        stage = Stage(photo, open_object(name))
        pixels = stage.view.pixels(stage.placement.mesh.positions)
        beside = pixels[:, 0].min() >= right - 0.5 or pixels[:, 0].max() <= left + 0.5
        assert beside != stage.placement.is_in_front
        assert any("no room beside" in line for line in stage.warnings) != beside


def test_without_room_it_is_refused():
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[110:152, 4:236] = 1
    with refused("at"):
        standing_by(mask)


def test_a_horizon_within_the_border_leaves_no_room():
    """The real object's base is hardly below it, and lower than all that may be stood on."""
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[60:HEIGHT, 20:60] = 1
    with refused("at"):
        Stage(load_photo(np.full((HEIGHT, WIDTH, 3), 100, np.uint8), mask=mask), sphere(24), Arrangement(pitch_deg=-20))


def test_with_little_room_it_is_small():
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[20 : HEIGHT - 8, 8:212] = 1
    stage = standing_by(mask)
    assert not stage.placement.is_in_front
    assert 0.2 < stage.placement.share < 0.35
    assert not any("no room" in line for line in stage.warnings)


def standing_by(mask: np.ndarray, shape: str = "sphere", size: float = 0.5) -> Stage:
    even = load_photo(np.full((HEIGHT, WIDTH, 3), 100, np.uint8), mask=mask)
    return Stage(even, open_object(shape), Arrangement(size=size))


@pytest.mark.parametrize("below", [False, True])
def test_an_object_that_runs_over_the_lower_border_hides_where_it_stands(below):
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[60 : HEIGHT if below else HEIGHT - 1, 20:60] = 1
    assert any("the photo's lower border cuts the real object" in line for line in standing_by(mask).warnings) == below


def test_what_stands_lower_and_aside_is_not_in_front():
    photo = load_photo(Path(__file__).parents[2] / "examples" / "table.jpg", box=(130, 100, 325, 385))
    stage = Stage(photo, OBJECTS["sphere"](), Arrangement(ground=anyprobe.estimate(photo).ground))
    assert (stage.placement.is_in_front, stage.warnings) == (False, ())


def test_it_stands_below_what_overhangs():
    """Of a mushroom the stem stands on the ground, and beside that is room, though none is beside the cap."""
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[20:70, 10:230], mask[70:140, 100:140] = 1, 1
    stage = standing_by(mask, size=0.4)
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    assert (stage.placement.is_in_front, stage.warnings) == (False, ())
    assert pixels[:, 1].max() == pytest.approx(140, abs=1)
    assert pixels[:, 1].min() >= 70
    assert stage.placement.share == pytest.approx(1.0, abs=0.01)


def test_where_no_side_has_room_it_stands_in_front_and_says_so():
    """The ground before a wide object is free: all of it is seen there, it hides nothing, and it is nearer."""
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[20:80, 4:236] = 1
    stage = standing_by(mask, size=0.4)
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    assert stage.placement.is_in_front
    assert pixels[:, 1].min() >= 79.5
    assert pixels[:, 1].max() <= HEIGHT
    assert "in front" in stage.warnings[0]
    assert stage.warnings[0].remedy == give("at", "size")
    assert -stage.placement.foot[2] < -stage.view.on_ground(120, 80)[2]


@pytest.mark.ci
@pytest.mark.parametrize("seed", range(12))
def test_neither_object_covers_the_other(seed):
    """Masks of a few ellipses, cut by the border or not."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    for x, y in rng.uniform((40, 60), (200, 130), (3, 2)):
        a, b = rng.uniform(20, 90, 2)
        mask[((columns - x) / a) ** 2 + ((rows - y) / b) ** 2 < 1] = 1
    for name in OBJECTS:
        stage = standing_by(mask, name)
        left, top, right, bottom = pixel_box(stage)
        assert top >= 0
        assert left >= 0
        assert right <= WIDTH
        assert bottom <= HEIGHT
        assert not mask[top:bottom, left:right].any()


def pixel_box(stage: Stage) -> tuple[int, ...]:
    """Left, top, right, bottom of the inserted object in whole pixels, to half a pixel."""
    pixels = stage.view.pixels(stage.placement.mesh.positions)
    low, high = np.ceil(pixels.min(axis=0) - 0.5), np.floor(pixels.max(axis=0) + 0.5)
    return (*low.astype(int), *high.astype(int))


@pytest.mark.ci
def test_object_in_a_large_photo_is_enlarged(photo, stage, monkeypatch):
    """Drawn coarser, then brought to its window: the same picture but for its edge."""
    whole = stage.draw(made_map(), "matte")
    monkeypatch.setattr("anyprobe.relight.insert.MOST_DRAWN", whole.shape[0] // 2)
    coarse = stage.draw(made_map(), "matte")
    assert coarse.shape == whole.shape
    inside = whole[..., 3] == 1
    assert np.abs(coarse - whole)[inside].mean() < 0.03 * whole[inside].mean()
    assert abs(coarse[..., 3].sum() / whole[..., 3].sum() - 1) < 0.05


# What changes


def test_far_pixels_keep_their_bits(photo, stage):
    picture = stage.relit(made_map(), "gold")
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    away = np.linalg.norm(stage.view.on_ground(columns, rows) - stage.placement.foot, axis=-1)
    away = np.where(np.isfinite(away), away, np.inf)  # above the horizon
    left, top, side = stage.window.left, stage.window.top, stage.window.size
    drawn = (columns > left) & (columns < left + side) & (rows > top) & (rows < top + side)
    far = (away > 1.5 * REACH * stage.placement.radius) & ~drawn
    assert far.mean() > 0.4
    np.testing.assert_array_equal(picture[far], photo.rgb[far])
    np.testing.assert_array_equal(picture[photo.mask == 1], photo.rgb[photo.mask == 1])
    near = (away < stage.placement.radius) & ~drawn | drawn
    assert (picture[near] != photo.rgb[near]).any(axis=-1).mean() > 0.5


def test_white_object_shows_the_light_through_the_camera(photo, stage):
    """Under an even light of 0.5 a white furnace's sphere is response(0.5)."""
    metal = Material(albedo=np.zeros(3), f0=np.ones(3), alpha=0.05)
    picture = stage.relit(np.full((16, 32, 3), 0.5, np.float32), metal)
    middle = stage.view.pixels(stage.placement.mesh.positions.mean(axis=0)).astype(int)
    np.testing.assert_allclose(picture[middle[1], middle[0]], response(np.full(3, 0.5)), atol=0.01)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("level", "material", "stops"), [(0.5, "plaster", 0), (4.0, "plaster", 1.8), (4.0, "chrome", 0)]
)
def test_a_material_too_bright_for_the_photo_is_exposed_down_and_a_warning_says_so(stage, level, material, stops):
    """Plaster reflects nearly all light; a metal that mirrors what is white in the photo stays white."""
    picture = stage.relit(np.full((16, 32, 3), level, np.float32), material)
    said = [one for one in stage.warnings if "too bright" in one]
    assert len(said) == (stops > 0)
    assert stage.stops_down == pytest.approx(stops, abs=0.4)
    row, column = stage.view.pixels(stage.placement.mesh.positions.mean(axis=0)).astype(int)[::-1]
    assert (picture[row, column].min() < 1) == (material == "plaster")


def test_shadow_is_drawn_wherever_it_lies(photo, monkeypatch):
    stage = Stage(photo, sphere(24), Arrangement(size=0.3, at=(160, 130), pitch_deg=20))
    shadow = stage.shadow(made_map())
    found = cast_shadow(photo, stage.view, shadow)
    monkeypatch.setattr(View, "part_around", lambda *_: (slice(0, HEIGHT), slice(0, WIDTH)))
    np.testing.assert_array_equal(found, cast_shadow(photo, stage.view, shadow))
    assert (found != photo.rgb).any()


def test_shadow_lies_away_from_the_emitter(photo):
    """The made map's emitter is at the upper left behind the camera: the shadow falls to the right."""
    stage = Stage(photo, sphere(24), Arrangement(at=(140, 130), size=0.6, pitch_deg=25))
    darker = stage.shadow(made_map())
    offset = 1.4 * stage.placement.radius * np.array([1.0, 0, 0])
    right, left = (darker.at(stage.placement.foot[None] + offset), darker.at(stage.placement.foot[None] - offset))
    assert right.mean() < left.mean() - 0.2


def test_material_of_the_photo_is_found_again():
    """A red Lambert-like sphere under a known map: its albedo to a tenth."""
    albedo = np.array([0.6, 0.2, 0.1])
    truth = Material(albedo=albedo, f0=np.full(3, 0.045), alpha=0.8)
    light = anyprobe.Light(radiance=made_map())
    drawn = light.render(sphere(32), truth, size=80, fov_deg=5.0)
    photo = load_photo(np.dstack([response(drawn[..., :3]), drawn[..., 3]]).astype(np.float32))
    found = material_from_photo(photo, made_map())
    np.testing.assert_allclose(found.albedo, albedo, rtol=0.1)
    assert found.alpha == 0.8


@pytest.mark.parametrize(("dimmed", "gain"), [(1.0, 1 / 0.9), (2.0, 1.0), (0.25, 4 / 0.9)])
def test_light_too_dim_for_a_white_object_is_made_brighter(dimmed, gain):
    light = np.full((16, 32, 3), 0.5, np.float32)
    photo = load_photo(sphere_photo((60, 90), DIAMETER, HEIGHT, WIDTH))
    white = np.where(photo.mask[..., None] > 0, response(np.full(3, 0.5)), 0).astype(np.float32)
    assert least_scale(replace(photo, rgb=white), dimmed * light) == pytest.approx(gain, rel=0.02)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"at": (5000, 5000)}, "at: expected a pixel of"),
        ({"at": (np.nan, 50)}, "at: expected a pixel of"),
        ({"at": (120, 2), "pitch_deg": 5}, "at: 120,2 is above the horizon"),
        ({"size": 0}, "size: "),
        ({"turn_deg": np.inf}, "turn_deg: "),
        ({"pitch_deg": -80}, "pitch_deg: "),
    ],
)
def test_what_cannot_be_placed_is_said_of_the_python_argument(photo, given, said):
    with pytest.raises(InputError, match=f"^{said}") as raised:
        Stage(photo, sphere(8), Arrangement(**given))
    assert "--" not in str(raised.value)


# The command


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--scale", 0), "--scale: expected 0.02 to 20 times the real object, got 0"),
        (("--turn", "inf"), "--turn: expected degrees"),
        (("--at", "nonsense"), "--at: expected X,Y in pixels, got 'nonsense'"),
        (("--light", "nothere.exr"), "nothere.exr: no such file"),
        (("--model", "lft"), "--model: expected one of"),
        (("--insert", "spere"), "did you mean sphere?"),
        (("--insert-material", "Glass"), "got 'Glass'; materials that light passes through are left out"),
        (("--insert-material", "gras"), "got 'gras'; did you mean grass?"),
    ],
)
def test_bad_options_are_refused_before_the_photo_is_read(command, work, photo_path, monkeypatch, given, said):
    def unread(*_):
        pytest.fail("the photo was read")

    monkeypatch.setattr("anyprobe.cli.relight.read_image", unread)
    assert said in command("relight", photo_path, *given).complaint


@pytest.mark.ci
def test_command_writes_the_picture_and_says_where(command, work, photo_path):
    done = command("relight", photo_path, "--insert", "vase", "--insert-material", "gold", "--json")
    assert done.status == 0, done.err
    given = json.loads(done.out)
    assert given["picture"] == str(Path("relit", "sphere_relit.png"))  # never among the photos
    assert read_image(given["picture"]).rgb.shape == (96, 128, 3)


@pytest.mark.ci
@pytest.mark.parametrize("height", [0.0, 0.0005])
def test_mesh_that_lies_flat_is_refused(command, work, photo_path, photo, height):
    (work / "card.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 1 {height} 1\nv 0 0 1\nf 1 3 2\nf 1 4 3\n")
    said = command("relight", photo_path, "--insert", "card.obj").complaint
    assert "--insert: expected a mesh with a height, got one that lies flat; turn it so that +Y is up" in said
    with refused("mesh", code="invalid-mesh"):
        Stage(photo, open_object("card.obj"))
    (work / "card.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n")
    assert Stage(photo, open_object("card.obj")).placement.share == 1  # upright


@pytest.mark.parametrize("out", ["file/a.png", "file/deep/a.exr", "/proc/nowhere/a.png", "folder.png"])
def test_place_that_cannot_be_written_is_refused_before_the_work(command, work, photo_path, out, monkeypatch):
    (work / "file").write_text("a file")
    (work / "folder.png").mkdir()
    monkeypatch.setattr("anyprobe.cli.relight.photo_source", lambda photo: pytest.fail("too late"))
    complaint = command("relight", photo_path, "-o", out).complaint
    assert out in complaint
    assert "cannot be written" in complaint or "is a file, not a folder" in complaint or "is a folder" in complaint
    assert sorted(path.name for path in work.iterdir()) == ["file", "folder.png", "photos"]


def test_photo_is_never_replaced(command, work, photo_path):
    before = photo_path.read_bytes()
    assert "replace an input" in command("relight", photo_path, "-o", photo_path).complaint
    assert photo_path.read_bytes() == before


@pytest.mark.ci
def test_an_object_lit_by_a_saved_light_stands_on_the_ground_that_was_found_with_it(command, work, photo_rgba):
    """As without --light; of another map, on what the photo shows."""
    Image.fromarray(photo_rgba[..., :3]).save("table.png")
    Image.fromarray(photo_rgba[..., 3]).save("mask.png")
    shot = ("table.png", "--mask", "mask.png")
    assert command("estimate", *shot, "-o", "light").status == 0
    Path("light/table.png").unlink()
    relit = ("relight", *shot, "--json")
    wanted = json.loads(command(*relit).out)
    anyprobe.Light(radiance=made_map()).save("other.exr")
    for light in ("light/table.exr", "other.exr"):
        found = json.loads(command(*relit, "--light", light).out)
        assert [found[name] for name in ("pitch_deg", "foot_px")] == [wanted[name] for name in ("pitch_deg", "foot_px")]
    given = json.loads(command(*relit, "--light", "light/table.exr", "--pitch", 40).out)
    assert given["pitch_deg"] == 40
