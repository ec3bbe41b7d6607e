"""Shadows of inserted objects beside path-traced ones: each scene is rendered again with the inserted object in it.

A sphere is put beside the object of a photo as `anyprobe relight` does. The truth is the second render over the first,
on the ground beside both objects. Compared are, in the photo,

    depth    stops by which the darkest part of the ground, of half the sphere's area, is darkened
    side     direction from the sphere's foot to its shadow's middle, on the ground; only where that is off the foot
    level    stops by which the matte sphere is brighter than the true one, in the mean over what is seen of it
    shading  root mean square difference of the stops over the matte sphere, its level apart
    mirror   root mean square difference of a chrome sphere's display values from the true one's

with the estimated light and camera, and with the true ones. The last three are of families whose renders show things
beside the object as they are; on a map's own ground they are drawn as shadows are.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import orthonormal_basis
from anyprobe.core.response import response
from anyprobe.errors import AnyprobeError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.files.objects import open_object
from anyprobe.relight.ground_view import View
from anyprobe.relight.insert import Arrangement, Stage, transmittance, window_of
from anyprobe.relight.placement import Placement, place_beside
from anyprobe.scatter.materials import material_named
from research.scenes.camera import take
from research.scenes.layouts import Layout, draw_layout
from research.scenes.parts import store_of
from research.scenes.render import render_layout
from research.world.whole_photos import read_render, write_render
from research.world.whole_render import Render
from research.world.whole_scenes import Phone, Thing

ESTIMATED, TRUE = "estimated", "true light and camera"
PHONES = {"ground": 10, "table": 9, "procedural": 14}
"""Families that are used, and the seed of the phone that takes the photos of each."""
SIZE, QUALITY = 0.6, 4
"""The sphere's size, in the object's, and times the paths of what is learned from."""
SHARE = 0.5
"""Area of the ground that is averaged for the depth, in areas of the sphere."""
OFF_FOOT = 0.5
"""Least distance of a shadow's middle from the foot, in the sphere's radii, of a shadow that has a side."""
CORE = 0.4
"""Share of the darkest place's lost light from which on ground counts for a shadow's side."""
LEAST_RATIO = 1 / 64
NEAR = 5.0
"""Reach around the foot that is compared, in the sphere's radii."""
MATTE, CHROME = "matte", "chrome"
COMPARED = 48
"""Side of the grid over a sphere's box on which two spheres are compared."""
WITHIN = 0.9
"""Share of a sphere's radius that is compared: its rim is mixed with what is behind it."""
TRIED = 60
"""Scenes of a family that are tried: in some there is no room beside the object."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shade:
    """A shadow on the ground: depth [stops], toward [2] its middle from the foot on the ground, in radii."""

    depth: float
    toward: np.ndarray


def compared(data: Path, part: str, kept: Path, estimator: Estimator, count: int) -> Iterator[dict[str, Any]]:
    """Yield the figures of so many photos of each family."""
    store = store_of(data, part)
    for family in PHONES:
        found = 0
        for number in range(TRIED):
            layout = draw_layout(family, f"{part} photos", number, store)
            path = kept / f"scenes-{part}" / f"{family}-{number:03d}.npz"
            row = _row(layout, path, estimator)
            if row is not None:
                found += 1
                yield {"scene": path.stem, **row}
            if found == count:
                break


def _row(layout: Layout, path: Path, estimator: Estimator) -> dict[str, Any] | None:
    """Return one photo's figures; None where the sphere has no place beside the object."""
    before = _kept(layout, path)
    taken = take(before, layout.phone.long_fov_deg, np.random.default_rng(PHONES[layout.family]))
    try:
        photo = load_photo(taken.picture, mask=taken.true_mask, fov_deg=layout.phone.long_fov_deg)
        light = estimator.from_photo(photo)
        first = light.dominant_light()
        place = Arrangement(size=SIZE, ground=light.ground, toward_light=first.direction, likely=first.exists)
        stage = Stage(photo, open_object("sphere"), place)
    except AnyprobeError:
        return None
    if stage.placement.is_in_front or light.ground is None:
        return None
    view = true_view(layout.phone)
    at = stage.view.pixels(stage.placement.foot)
    try:
        truly = place_beside(
            open_object("sphere"), photo, view, layout.phone.pitch_deg, SIZE * stage.placement.share, tuple(at)
        )
    except AnyprobeError:
        return None
    after = _kept(with_thing(layout, truly, MATTE), _beside(path, truly, MATTE))
    true_ratio = luminance(after.picture) / np.maximum(luminance(before.picture), 1e-6)
    free = (before.mask < 0.01) & ~silhouette(view, truly)
    truth = shade_of(true_ratio, free, view, truly)
    stages = {
        ESTIMATED: (stage, light.panorama(frame="camera", lit=True).radiance),
        TRUE: (seen_by(stage, view, truly), taken.truth),
    }
    ways = {
        ESTIMATED: (stage.view, stage.placement, stage.shadow(light.radiance)),
        TRUE: (view, truly, stages[TRUE][0].shadow(before.truth)),
    }
    shown = {}
    if not layout.on_map:
        mirroring = _kept(with_thing(layout, truly, CHROME), _beside(path, truly, CHROME))
        exposure = taken.truth.sum(axis=(0, 1)) / before.truth.sum(axis=(0, 1))
        pictures = {MATTE: after.picture * exposure, CHROME: mirroring.picture * exposure}
        shown = {name: on_sphere(picture, view, truly) for name, picture in pictures.items()}
    row: dict[str, Any] = {"true_depth": truth.depth, "true_off": float(np.linalg.norm(truth.toward))}
    for name, (seen, placed, shadow) in ways.items():
        whole = slice(0, seen.height), slice(0, seen.width)
        ratio = luminance(transmittance(seen, shadow, whole))
        own = (before.mask < 0.01) & ~silhouette(seen, placed)
        shade = shade_of(ratio, own, seen, placed)
        angle = np.degrees(np.arccos(np.clip(_unit(shade.toward) @ _unit(truth.toward), -1.0, 1.0)))
        row[name] = {"depth": shade.depth, "side_deg": float(angle)}
        if shown:
            row[name] |= body_of(*stages[name], shown)
    return row


def seen_by(stage: Stage, view: View, placed: Placement) -> Stage:
    """Return the stage seen by another camera, with the object placed as given."""
    other = copy(stage)
    other.view, other.placement, other.likely = view, placed, 1.0
    other.window = window_of(placed, view)
    return other


def body_of(stage: Stage, radiance: np.ndarray, shown: dict[str, np.ndarray]) -> dict[str, float]:
    """Return level, shading and mirror of the spheres drawn on a stage, beside the true ones of on_sphere."""
    window, drawn = stage.window, {}
    for name in shown:
        picture = np.zeros((stage.view.height, stage.view.width, 3), np.float32)
        part = window.part(stage.view.height, stage.view.width)
        one = stage.draw(radiance, name)
        picture[part] = one[
            part[0].start - window.top : part[0].stop - window.top,
            part[1].start - window.left : part[1].stop - window.left,
            :3,
        ]
        drawn[name] = on_sphere(picture, stage.view, stage.placement)
    matte = luminance(drawn[MATTE]), luminance(shown[MATTE])
    apart = np.log2(np.maximum(matte[0], 1e-4) / np.maximum(matte[1], 1e-4))
    chrome = response(drawn[CHROME]) - response(shown[CHROME])
    return {
        "level": float(np.log2(matte[0].mean() / matte[1].mean())),
        "shading": float(apart.std()),
        "mirror": float(np.sqrt(np.square(chrome).mean())),
    }


def on_sphere(picture: np.ndarray, view: View, placed: Placement) -> np.ndarray:
    """Return the pixels [P, 3] of a grid over a sphere's box in a picture [H, W, 3], without its rim."""
    seen = view.pixels(placed.mesh.positions)
    low, high = seen.min(axis=0), seen.max(axis=0)
    y, x = np.mgrid[-1 : 1 : COMPARED * 1j, -1 : 1 : COMPARED * 1j]
    at = np.stack([x, y], axis=-1)[x * x + y * y < WITHIN**2]
    pixels = (low + high) / 2 + at * (high - low) / 2 - 0.5
    column, row = np.round(pixels).astype(int).T
    return picture[np.clip(row, 0, view.height - 1), np.clip(column, 0, view.width - 1)]


def true_view(phone: Phone) -> View:
    """Return the camera as it was, its height over the ground being the unit."""
    return View(width=phone.width, height=phone.height, focal=phone.focal, up=up_of(phone.pitch_deg, phone.roll_deg))


def with_thing(layout: Layout, placed: Placement, material: str) -> Layout:
    """Return the scene with the inserted object in it."""
    phone = layout.phone
    turn, high = phone.world_from_camera, phone.position[1]
    mesh = placed.mesh
    world = replace(
        mesh,
        positions=phone.position + high * mesh.positions @ turn.T,
        normals=(mesh.normals @ turn.T).astype(np.float32),
    )
    thing = Thing(mesh=world, material=material_named(material))
    return replace(layout, others=(*layout.others, thing))


def silhouette(view: View, placed: Placement) -> np.ndarray:
    """Return the pixels [H, W] that a placed sphere covers, and those that touch them."""
    import cv2

    hull = cv2.convexHull(view.pixels(placed.mesh.positions).astype(np.float32))
    canvas = np.zeros((view.height, view.width), np.uint8)
    cv2.fillConvexPoly(canvas, np.round(hull).astype(np.int32), 1)
    return cv2.dilate(canvas, np.ones((5, 5), np.uint8)) > 0


def shade_of(ratio: np.ndarray, free: np.ndarray, view: View, placed: Placement) -> Shade:
    """Measure a shadow by the remaining share of the light [H, W] on the ground that is free of objects."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    ground = view.on_ground(x, y) - placed.foot
    near = free & (np.linalg.norm(np.nan_to_num(ground, nan=1e9), axis=-1) < NEAR * placed.radius)
    lost = np.where(near, np.clip(1.0 - ratio, 0.0, 1.0), 0.0)
    lost = np.where(lost > 0.03, lost, 0.0)
    count = max(20, round(SHARE * silhouette(view, placed).sum()))
    darkest = np.sort(lost[near])[::-1][:count]
    depth = -float(np.log2(max(1.0 - float(darkest.mean()), LEAST_RATIO))) if len(darkest) else 0.0
    side, across = orthonormal_basis(view.up)
    core = np.where(lost > CORE * (darkest[0] if len(darkest) else 1.0), lost, 0.0)
    area = core * np.linalg.norm(np.nan_to_num(view.on_ground(x, y), nan=0.0), axis=-1) ** 3  # of a pixel on the ground
    on = np.nan_to_num(np.stack([ground @ side, ground @ across], axis=-1)) / placed.radius
    middle = (on * area[..., None]).sum(axis=(0, 1)) / max(float(area.sum()), 1e-9)
    return Shade(depth=depth, toward=middle)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return medians over the scenes, and in how many with a side it is the same within 45 degrees."""
    sided = [row for row in rows if row["true_off"] > OFF_FOOT]
    said: dict[str, Any] = {"scenes": len(rows), "with_a_side": len(sided)}
    for name in (ESTIMATED, TRUE):
        off = np.array([row[name]["depth"] - row["true_depth"] for row in rows])
        said[name] = {
            "depth_error_stops": float(np.median(np.abs(off))),
            "depth_bias_stops": float(np.median(off)),
            "side_deg": float(np.median([row[name]["side_deg"] for row in sided])) if sided else None,
            "same_side": sum(row[name]["side_deg"] < 45 for row in sided),
            **_body_summary([row[name] for row in rows if "level" in row[name]]),
        }
    return said


def _body_summary(found: list[dict[str, float]]) -> dict[str, float]:
    """Return medians of level, its size, shading and mirror."""
    if not found:
        return {}
    said = {name: float(np.median([one[name] for one in found])) for name in ("level", "shading", "mirror")}
    return {"bodies": len(found), "level_error": float(np.median([abs(one["level"]) for one in found])), **said}


def _beside(path: Path, placed: Placement, material: str) -> Path:
    """Return the name of the second render, by where the sphere stands and what it is of."""
    one = placed.mesh.positions.round(4).tobytes() + repr(material_named(material)).encode()
    return path.with_name(f"{path.stem}-{zlib.crc32(one):08x}.npz")


def _kept(layout: Layout, path: Path) -> Render:
    if not path.is_file():
        write_render(path, render_layout(layout, QUALITY))
    return read_render(path)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)
