"""Batches of photos to learn from: batch k is a function of (seed, k) alone, see LightBatch for what is in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from anyprobe.core.color import luminance
from anyprobe.errors import InputError
from anyprobe.light.environment import integral
from anyprobe.light.light_sources import split_sources
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.mask_errors import disturb_mask, gross_error
from anyprobe_train.world.kernels import probe_map
from anyprobe_train.world.layout import Layout, Standing, draw_layout
from anyprobe_train.world.lights import Light, draw_light
from anyprobe_train.world.look import Look, develop, draw_look
from anyprobe_train.world.maps import Maps, open_maps
from anyprobe_train.world.photo import (
    SQUARE_PX,
    Frame,
    Seen,
    draw_photo_frame,
    lit_scene,
    object_over,
    over_window,
    painted,
    pick_material,
    plane_box,
    see_object,
    see_other,
    share_in_photo,
    standing_points,
)
from anyprobe_train.world.shading import picture
from anyprobe_train.world.views import CAMERAS, SHAPES, Views, shape_files
from anyprobe_train.world.windows import Window, window_resampled

Record = TypeVar("Record")
PHOTO_FAMILIES = ("ground", "table", "things", "dark", "procedural", "cut_out", "no_object")
SHARES = (0.22, 0.18, 0.17, 0.09, 0.08, 0.21, 0.05)
LIGHT_OF = {"ground": "ground", "table": "real", "things": "real", "dark": "dark", "procedural": "procedural"}
LAYOUTS_OF = {"cut_out": ("none", "none", "table", "things"), "no_object": ("ground", "none", "table", "things")}
"""Families whose layouts those of some others have, each as often."""
PHOTOS_OF_LIGHT = 6
"""Photos that share a light, each with another object, camera and layout."""
MOST_SAID, NORMALS = 3, 48
MASK_SIDE, MASK_ROOM = 128, 1.5
"""Side of the picture that a mask is drawn in, and its width over the object's window."""
EXACT, GROSS = 0.3, 0.12
"""Shares of the masks without an error and with a gross one."""
LENS_KNOWN = 0.5
ASSUMED_TANGENT = float(np.tan(np.radians(30.0)))
"""Tangent of half the longer side, where the lens is not known: 60 degrees."""
BACKDROPS = (0.0, 0.0, 1.0, 0.5, 0.92)
"""Display values behind cut-outs."""
DIM = 0.1
"""Light above white of less than this share of all light is that of no source."""
WITH_OTHERS = ("table", "things", "procedural")
"""Layouts in which other objects may stand."""
PAINTED = 0.17
"""Share of the objects that have a texture."""
SAME_PITCH = 0.08
"""Largest difference of the height that two cameras look from, for their objects to stand in one photo."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightBatch:
    """N photos; everything in the photo's camera frame, pictures in display values.

    context: [N, 96, 96, 5] uint8, the whole photo by area, its centre that of the square: RGB, given mask, inside.
    crop: [N, 96, 96, 4] uint8, the square window around the given mask's box times 1.1: RGB x mask, mask.
    lens: [N, 5] as given: tangents of half the square, of the crop's centre (right, up), of half its side; 1 if known.
    fov: [N] degrees of the longer side. up: [N, 3]. normals: [N, 48, 48, 3] int8 x 127 over the crop's window.
    material: [N, 4] metal, reflectance; NaN without an object.
    truth: [N, 64, 128, 3] float16, what a probe in the object's place sees, in units of the photo's white.
    sources: [N, 3, 8] by falling power: exists, direction, angular radius [degrees], power above white.
    soft: [N] share of the power above white that no source has, see `sources_of`. outdoors: [N] 1, 0 or NaN.
    family: [N] index into PHOTO_FAMILIES.
    """

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


def fieldwise(make: Callable[..., Any], *records: Record) -> Record:
    """Return a record of what a function makes of each field of some of its kind."""
    names = [one.name for one in fields(records[0])]  # type: ignore[arg-type]
    return type(records[0])(**{name: make(*(getattr(one, name) for one in records)) for name in names})


@dataclass(frozen=True, kw_only=True, slots=True)
class World:
    """Assets that photos are drawn from.

    batch: photos in a batch. first, every, most: files of views that batch 0 draws from, batches after which one more
    joins, and their number in the end.
    """

    maps: Maps
    views: Views
    batch: int = 32
    first: int = 32
    every: int = 16
    most: int = 420

    @classmethod
    def open(cls, data: Path | None, cache: Path, part: str = "train", shapes: str = "", **settings: int) -> World:
        """Open the maps of a part, "train" or "left-out", and its shapes or another's; what is missing is made.

        Raises:
            InputError: no data.
        """
        if data is None or not all((data / name).is_dir() for name in ("hdri", "meshes")):
            text = "expected a folder with hdri and meshes, got none; fetch them with anyprobe-train data"
            raise InputError(text, subject="data", source=data or "")
        return cls(maps=open_maps(data, cache, part), views=Views(shape_files(data, shapes or part), cache), **settings)

    def count(self, k: int) -> int:
        """Return the number of views that batch k draws from."""
        return min(self.first + k // self.every, self.most) * SHAPES * CAMERAS


def assets_of(world: World) -> str:
    """Say what a world has, as runs that learn from it keep it."""
    return f"{len(world.maps.names)} maps, {len(world.views.files.paths)} shapes"


def make_batch(world: World, seed: int, k: int) -> LightBatch:
    """Return batch k: the same for the same data."""
    rng = np.random.default_rng((seed, k))
    numbers = rng.choice(len(PHOTO_FAMILIES), world.batch, p=SHARES)
    kinds = [light_kind(PHOTO_FAMILIES[n], rng) for n in numbers]
    lights: dict[str, list[Light]] = {}
    for kind in sorted(set(kinds)):
        count = -(-kinds.count(kind) // PHOTOS_OF_LIGHT)
        lights[kind] = [draw_light(rng, world.maps, kind) for _ in range(count)]
    photos = []
    for number, kind in zip(numbers, kinds, strict=True):
        light = lights[kind][rng.integers(len(lights[kind]))]
        photos.append(take(world, PHOTO_FAMILIES[number], light, k, np.random.default_rng((seed, k, len(photos)))))
    return LightBatch(**{one.name: np.stack([photo[one.name] for photo in photos]) for one in fields(LightBatch)})


def light_kind(family: str, rng: np.random.Generator) -> str:
    """Draw the kind of light of a photo."""
    if family in LIGHT_OF:
        kind = LIGHT_OF[family]
        return "procedural" if family == "things" and rng.random() < 0.3 else kind
    return ("ground", "real", "real", "dark")[rng.integers(4)] if family == "cut_out" else "ground"


@dataclass(frozen=True, kw_only=True, slots=True)
class Traced:
    """A scene as its photo shows it, before the camera: the object (None: there is none), it and all else (None: cut
    out) over the context's square, what a probe sees, and what they are made of; in_photo: share_in_photo of that;
    others: the other objects by themselves, the farthest first."""

    layout: Layout
    view: np.void
    frame: Frame
    material: Material
    metal: bool
    reflectance: np.ndarray
    seen: Seen | None
    own: np.ndarray
    others: list[np.ndarray]
    in_photo: np.ndarray
    behind: np.ndarray | None
    truth: np.ndarray


def take(world: World, family: str, light: Light, k: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Draw and take one photo: the arrays of LightBatch without their first axis."""
    view = world.views[int(rng.integers(world.count(k)))]
    surroundings = LAYOUTS_OF[family][rng.integers(4)] if family in LAYOUTS_OF else family
    others = companions(world, view, k, rng) if surroundings in WITH_OTHERS else []
    layout = draw_layout(rng, surroundings, view, light, world.maps, others)
    return _tensors(family, trace(world.maps, family, layout, view, rng), rng)


def trace(
    maps: Maps,
    family: str,
    layout: Layout,
    view: np.void,
    rng: np.random.Generator,
    painted_share: float = PAINTED,
    size: int = SQUARE_PX,
) -> Traced:
    """Trace a photo of a layout, its square so many pixels wide."""
    material, metal = pick_material(rng)
    seed = int(rng.integers(2**31))
    frame = draw_photo_frame(rng, view)
    has_object = family != "no_object"
    reflectance = material.f0 + (1 - material.f0) * material.albedo
    scene = lit_scene(view if has_object else None, view["eye"], layout, material, seed)
    first = int(has_object)
    beside = [see_other(scene, layout, first + k, rng) for k in range(len(layout.others))]
    seen, own = None, np.zeros((size, size, 4), np.float32)
    if has_object:
        standing = Standing(view=view, turn=0.0, scale=1.0, place=np.zeros(3))
        surface = standing_points(standing)
        colors = painted(rng, maps, material, *surface[2:], painted_share)
        reflectance = (colors[1] + (1 - colors[1]) * colors[0]).mean(axis=0)
        seen = see_object(scene, standing, surface, material, colors, seed + 1)
        own = object_over(seen, frame, frame.square, size)
    away = [-float(np.linalg.norm(one.place - view["eye"])) for one in layout.others]
    others = [object_over(beside[k], frame, frame.square, size) for k in np.argsort(away)]  # the farthest first
    behind, in_photo = None, share_in_photo(frame, frame.square, size)
    if family != "cut_out":
        wanted = (in_photo > 0) & (cv2.erode(own[..., 3], np.ones((5, 5))) < 0.999)  # beside the object
        shown = np.eye(3), 1.0, np.zeros((1, 1, 3), np.float32), np.zeros((1, 1), np.float32)
        if seen is not None:
            shown = seen.camera, seen.tangent, seen.radiance, seen.cover
        behind = picture(*scene, frame.camera, frame.most, wanted, *shown, seed + 2)
        for other in others:
            behind = other[..., :3] + (1 - other[..., 3:]) * behind
    truth = probe_map(*scene, (0.0, float(view["top"]) / 2, 0.0), frame.camera, 64)
    return Traced(
        layout=layout,
        view=view,
        frame=frame,
        material=material,
        metal=metal,
        reflectance=reflectance,
        seen=seen,
        own=own,
        others=others,
        in_photo=in_photo,
        behind=behind,
        truth=truth,
    )


def companions(world: World, view: np.void, k: int, rng: np.random.Generator, most: int = 2) -> list[np.void]:
    """Return up to so many views whose cameras look down as steeply as a view's."""
    found: list[np.void] = []
    for _ in range(24):
        other = world.views[int(rng.integers(world.count(k)))]
        if abs(other["camera"][1, 2] - view["camera"][1, 2]) < SAME_PITCH:
            found.append(other)
        if len(found) == most:
            break
    return found


def _tensors(family: str, traced: Traced, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Photograph what was traced."""
    frame, seen, behind, truth = traced.frame, traced.seen, traced.behind, traced.truth
    own, in_photo, most, whole = traced.own, traced.in_photo, frame.most, frame.square
    radiance = own[..., :3] if behind is None else own[..., :3] + (1 - own[..., 3:]) * behind
    object_mean = None
    if seen is not None:
        mean = (seen.radiance * seen.cover[..., None]).sum((0, 1)) / seen.cover.sum()
        object_mean = max(float(luminance(mean)), 1e-9)
    in_frame = luminance(radiance)[in_photo > 0.5] if behind is not None else np.zeros(0)
    look = draw_look(rng, object_mean, in_frame, truth)
    mask, window = (None, None) if seen is None else _drawn_mask(seen, frame, family, rng)
    crop_window = _crop_window(mask, window)
    blur = look.blur * (crop_window[1] - crop_window[0]) / (2 * most)
    context = np.zeros((SQUARE_PX, SQUARE_PX, 5), np.uint8)
    shown = develop(look, radiance, whole, frame, blur, rng)
    cut = None
    if behind is None:
        cut = np.uint8(round(255 * BACKDROPS[rng.integers(len(BACKDROPS))]))
        shown = np.round(_before_one_color(own, cut, look, frame, whole, rng))
    context[..., :3] = np.round(shown * in_photo[..., None])
    context[..., 4] = np.round(255 * in_photo)
    crop = np.zeros((SQUARE_PX, SQUARE_PX, 4), np.uint8)  # the object's window as its mask shows it
    if mask is not None:
        given = window_resampled(mask, window, whole, SQUARE_PX, 3) * in_photo
        context[..., 3] = np.round(255 * given)
        own = object_over(seen, frame, crop_window, SQUARE_PX)
        given = window_resampled(mask, window, crop_window, SQUARE_PX, 2) * share_in_photo(frame, crop_window)
        if behind is None:
            shown = _before_one_color(own, cut, look, frame, crop_window, rng)
        else:
            back = window_resampled(behind, whole, crop_window, SQUARE_PX, 1)
            shown = develop(look, own[..., :3] + (1 - own[..., 3:]) * back, crop_window, frame, look.blur, rng)
        crop = np.round(np.dstack([shown * given[..., None], 255 * given])).astype(np.uint8)
    known = rng.random() < LENS_KNOWN
    scale = 1.0 if known else ASSUMED_TANGENT / most
    middle = (crop_window[0] + crop_window[1]) / 2, (crop_window[2] + crop_window[3]) / 2
    lens = [most * scale, middle[0] * scale, middle[1] * scale, (crop_window[1] - crop_window[0]) / 2 * scale, known]
    exposed = np.minimum(truth * look.gain, 6e4).astype(np.float16)
    sources, soft = sources_of(exposed.astype(np.float32))
    return {
        "context": context,
        "crop": crop,
        "lens": np.array(lens, np.float32),
        "fov": np.float32(2 * np.degrees(np.arctan(most))),
        "up": frame.up.astype(np.float32),
        "normals": _normals(traced.view, seen, frame, crop_window),
        "material": np.array([traced.metal, *traced.reflectance] if seen is not None else [np.nan] * 4, np.float32),
        "truth": exposed,
        "sources": sources,
        "soft": np.float32(soft),
        "outdoors": np.float32(traced.layout.light.outdoors),
        "family": np.uint8(PHOTO_FAMILIES.index(family)),
    }


def _drawn_mask(seen: Seen, frame: Frame, family: str, rng: np.random.Generator) -> tuple[np.ndarray, Window]:
    """Return a given mask [MASK_SIDE, MASK_SIDE] float32 over a window of the photo's plane, and that."""
    low, high = plane_box(seen, frame)
    (x, y), half = (low + high) / 2, float((high - low).max()) / 2 * MASK_ROOM
    window = x - half, x + half, y + half, y - half
    true = object_over(seen, frame, window, MASK_SIDE)[..., 3] > 0.5
    across = np.abs(np.linspace(x - half, x + half, MASK_SIDE)) < frame.tangents[0]
    down = np.abs(np.linspace(y + half, y - half, MASK_SIDE)) < frame.tangents[1]
    in_photo = down[:, None] & across[None]
    true = true & in_photo
    choice = rng.random()
    if choice < EXACT or (family == "cut_out" and choice < 0.8):
        return true.astype(np.float32), window
    made = (gross_error(true, rng) if choice > 1 - GROSS else disturb_mask(true, rng)) & in_photo
    kept = (made & true).sum() > 0.4 * true.sum() and made.sum() > 20
    return (made if kept else true).astype(np.float32), window


def _crop_window(mask: np.ndarray | None, window: Window | None) -> Window:
    """Return the square window around a mask's box times 1.1; of no mask an empty one in the middle."""
    if mask is None or window is None or not mask.any():
        return 0.0, 0.0, 0.0, 0.0
    rows, columns = (np.flatnonzero(mask.max(axis=axis)) for axis in (1, 0))
    pixel = (window[1] - window[0]) / MASK_SIDE
    left, right = window[0] + pixel * columns[0], window[0] + pixel * (columns[-1] + 1)
    top, bottom = window[2] - pixel * rows[0], window[2] - pixel * (rows[-1] + 1)
    half = 1.1 * max(right - left, top - bottom) / 2
    x, y = (left + right) / 2, (top + bottom) / 2
    return x - half, x + half, y + half, y - half


def _before_one_color(
    own: np.ndarray, cut: np.uint8, look: Look, frame: Frame, window: Window, rng: np.random.Generator
) -> np.ndarray:
    """Return display values of a window that shows the object, own [S, S, 4], before one colour."""
    share = own[..., 3:]
    shown = develop(look, own[..., :3] / np.maximum(share, 1e-3), window, frame, 0.0, rng)
    return share * shown + (1 - share) * cut


def _normals(view: np.void, seen: Seen | None, frame: Frame, crop_window: Window) -> np.ndarray:
    if seen is None:
        return np.zeros((NORMALS, NORMALS, 3), np.int8)
    turn = seen.camera.T @ frame.camera
    own = np.dstack([view["normals"].astype(np.float32) / 127 * seen.cover[..., None], seen.cover])
    there = over_window(own.astype(np.float32), seen, frame, crop_window, NORMALS)
    n = there[..., :3] @ turn.astype(np.float32)
    n /= np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-6)
    return np.round(127 * n * (there[..., 3:] > 0.5)).astype(np.int8)


def sources_of(truth: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the sources [MOST_SAID, 8] of a map [64, 128, 3] above white, see LightBatch, and its softness, of
    luminances: 1 - P / max(A, DIM W) in [0, 1], P the power of all sources, A all power above white, W the integral of
    all radiance."""
    above = np.maximum(truth - 1.0, 0.0)
    result = np.zeros((MOST_SAID, 8), np.float32)
    power, whole = (float(luminance(integral(one))) for one in (above, truth))
    if power <= 0:
        return result, 1.0
    found = sorted(split_sources(above)[0], key=lambda one: -luminance(one.power))[:MOST_SAID]
    for row, one in zip(result, found, strict=False):
        row[:] = 1.0, *one.direction, one.radius_deg, *one.power
    said = luminance(result[:, 5:].sum(axis=0)) / max(power, DIM * whole, 1e-9)
    return result, float(np.clip(1.0 - said, 0.0, 1.0))
