"""Whole photos: an object on a table, path-traced, taken by a phone, and the light that a probe in its place sees.

Everything is a function of a part and an index. Renders are kept in linear values, one file each; how the phone exposes
them is worked out when they are read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.dataset.camera import Shot, draw_shot, one_photo
from anyprobe_train.dataset.recipe import Recipe, read_recipes
from research.left_out import load_left_out
from research.world.whole_render import Render, render_scene
from research.world.whole_scenes import Scene, draw_scene

COUNT = 100
LISTS = {"test": "whole_test.txt", "left-out": "whole_left_out.txt"}
PARTS = tuple(LISTS)
"""Held-out maps and shapes; training assets that no shipped weights learn from, to choose by."""
KEY_SPREAD = 0.35
"""Standard deviation of ln of the radiance that the meter brings its mean to."""
LENS_WRITTEN = 0.5
"""Share of the photos whose EXIF says the lens."""
PLAINS = (1.0, 1.0, 1.0, 0.92, 0.5, 0.0)
"""Display values behind cut-outs of one colour."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WholePhoto:
    """A photo and what is true of it.

    picture: [H, W, 3] uint8, of cut-outs with alpha [H, W, 4]. mask: [H, W] bool. truth: [64, 128, 3] what a probe in
    the object's centre sees with the object away, in the camera's frame and the photo's exposure units.
    long_fov_deg, pitch_deg, roll_deg: of the camera; pitch_deg is how far it looks down. fov_known: whether EXIF says
    the lens. contact: x, y [px] of the point on the table under the object's middle. cut_out: "", "alpha" or "plain".
    family: kind of scene.
    """

    recipe: Recipe
    picture: np.ndarray
    mask: np.ndarray
    truth: np.ndarray
    long_fov_deg: float
    fov_known: bool
    pitch_deg: float
    roll_deg: float
    contact: tuple[float, float]
    cut_out: str
    map_name: str
    shape_name: str
    family: str = "table"


def recipes_of(part: str, count: int = COUNT) -> list[Recipe]:
    """Return the first `count` recipes of a part, which never change."""
    if part not in LISTS:
        raise InputError(f"part {part!r}: expected one of {', '.join(PARTS)}; choose one of them")
    return read_recipes(Path(__file__).parent / LISTS[part])[:count]


def store_of(data: Path, part: str) -> AssetStore:
    """Return the maps and shapes of a part, from a data folder with hdri and meshes."""
    return load_left_out(data) if part == "left-out" else load_asset_store(data, "test", commercial_only=False)


def whole_photos(data: Path, part: str, kept: Path, count: int = COUNT) -> Iterator[WholePhoto]:
    """The photos of a part in order; those that kept / part lacks are rendered and put there.

    Raises:
        MissingExtra: some have to be rendered, and Mitsuba cannot run.
    """
    store = store_of(data, part)
    for recipe, scene, render in renders(store, part, kept, count):
        yield photograph(recipe, scene, render, store)


def renders(
    store: AssetStore, part: str, kept: Path, count: int = COUNT, first: int = 0
) -> Iterator[tuple[Recipe, Scene, Render]]:
    """Yield what whole_photos photographs, from number `first` on."""
    for recipe in recipes_of(part, count)[first:]:
        path = kept / part / f"{recipe.key}.npz"
        scene = draw_scene(recipe, store)
        if not path.is_file():
            write_render(path, render_scene(scene, store.map(recipe.map_id).radiance))
        yield recipe, scene, read_render(path)


def photograph(recipe: Recipe, scene: Scene, render: Render, store: AssetStore, shot: int = 0) -> WholePhoto:
    """As the phone takes it: metering, white balance, lens, curve, noise, JPEG.

    shot: 0 for the part's own; each other number is another camera and exposure.
    """
    rng = recipe.rng().spawn(8 + shot)[7 + shot]
    mask = render.mask > 0.5
    weights = pixel_solid_angles(MAP_HEIGHT)[..., None]
    camera = draw_shot(rng, 1)
    balance = distributions.draw_white_balance(rng, (render.truth * weights).sum(axis=(0, 1))[None])[0]
    gain = _gain(rng, render, mask)
    plain, known = PLAINS[rng.integers(len(PLAINS))], bool(rng.random() < LENS_WRITTEN)
    picture = _taken(camera, render.picture * gain, balance, rng)
    if scene.cut_out == "plain":
        cover = render.mask[..., None]
        picture = np.round(picture * cover + 255 * plain * (1 - cover)).astype(np.uint8)
    elif scene.cut_out == "alpha":
        alpha = np.round(255 * render.mask).astype(np.uint8)[..., None]
        picture = np.concatenate([np.where(alpha > 0, picture, 0), alpha], axis=-1)
    contact = scene.phone.pixels(np.zeros(3))
    return WholePhoto(
        recipe=recipe,
        picture=picture,
        mask=mask,
        truth=(render.truth * gain * balance).astype(np.float32),
        long_fov_deg=scene.phone.long_fov_deg,
        fov_known=known,
        pitch_deg=scene.phone.pitch_deg,
        roll_deg=scene.phone.roll_deg,
        contact=(float(contact[0]), float(contact[1])),
        cut_out=scene.cut_out,
        map_name=store.map(recipe.map_id).name,
        shape_name=store.shape(recipe.shape_id).name,
    )


def _gain(rng: np.random.Generator, render: Render, mask: np.ndarray) -> float:
    """From the map's units to the photo's: the meter's mean of object and frame is brought to a key."""
    bright = luminance(render.picture)
    frame = distributions.seen_level(bright)
    mean = float(bright[mask].mean()) if mask.any() else frame
    return distributions.draw_photo_gain(rng, mean, frame, KEY_SPREAD)


def _taken(shot: Shot, radiance: np.ndarray, balance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """one_photo of a picture that is not square: its border is continued, and cut off again."""
    height, width, _ = radiance.shape
    side = max(height, width)
    square = np.pad(radiance * balance, ((0, side - height), (0, side - width), (0, 0)), mode="edge")
    whole = np.ones((side, side), bool)
    balanced = replace(shot, white_balance=np.ones(3, np.float32))
    return one_photo(balanced, square, whole, None, rng)[:height, :width]


def write_render(path: Path, render: Render) -> None:
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(
            stream,
            picture=render.picture.clip(0, 6e4).astype(np.float16),
            mask=np.round(render.mask * 255).astype(np.uint8),
            truth=render.truth,
        )


def read_render(path: Path) -> Render:
    with np.load(path, allow_pickle=False) as stored:
        return Render(
            picture=stored["picture"].astype(np.float32),
            mask=stored["mask"].astype(np.float32) / 255,
            truth=stored["truth"],
        )
