"""python -m research.world_check: photos of the fast world against the same layouts by Mitsuba, by family.

Objects and covers are of one colour, as textures are laid on otherwise. Both pictures are exposed alike and compared in
display values of the mean camera curve.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y
from anyprobe.core.response import response
from anyprobe.light.light_sources import find_dominant_light
from anyprobe_train.world.batch import LIGHT_OF, Traced, World, trace
from anyprobe_train.world.layout import Standing, draw_layout, falling
from anyprobe_train.world.lights import LIGHT_ROWS, draw_light
from anyprobe_train.world.photo import SQUARE_PX
from anyprobe_train.world.views import shape_rng, standing_mesh
from research.results import commit, write_result
from research.scenes import layouts
from research.scenes.render import render_layout
from research.world.whole_scenes import Panel, Phone, Thing

LONG_PX = 4 * SQUARE_PX
SEED = 41
DARK, CLIPPED = 0.08, 0.98
"""Display luminance below which a pixel is dark, and from which on it is clipped."""


def traced(world: World, family: str, number: int) -> Traced:
    """Trace layout `number` of a family, without textures."""
    rng = np.random.default_rng((SEED, number, len(family)))
    light = draw_light(rng, world.maps, LIGHT_OF[family])
    view = world.views[int(rng.integers(world.count(0)))]
    layout = draw_layout(rng, family, view, light, world.maps, [])
    for panel in layout.panels:
        panel.albedo = np.tile(panel.albedo.mean(axis=(0, 1)), (2, 2, 1)).astype(np.float32)
    return trace(world.maps, family, layout, view, rng, painted_share=0.0)


def as_layout(world: World, family: str, one: Traced) -> layouts.Layout:
    """Return what was traced as a layout to render."""
    frame, made = one.frame, one.layout
    sides = np.array(frame.tangents) / frame.most * LONG_PX
    width, height = (int(round(side)) for side in sides)
    phone = Phone(
        world_from_camera=frame.camera,
        position=one.view["eye"].astype(float),
        focal=LONG_PX / 2 / frame.most,
        width=width,
        height=height,
        pitch_deg=0.0,
        roll_deg=frame.roll_deg,
    )
    light = made.light.sky[: 2 * LIGHT_ROWS**2].reshape(LIGHT_ROWS, 2 * LIGHT_ROWS, 3)
    thing = _thing(world, Standing(view=one.view, turn=0.0, scale=1.0, place=np.zeros(3)), one)
    panels, lit = [_panel(panel) for panel in made.panels], falling(made.light)
    if family == "ground":
        cover = layouts._own_ground(light, lit.astype(float), phone.position)
        panels = [replace(panels[0], cover=cover)]
    return layouts.Layout(
        family=family,
        thing=thing,
        others=(),
        panels=tuple(panels),
        lamps=tuple(layouts.Lamp(center=c, radius=r, radiance=p) for c, r, p in made.lamps),
        light=np.ascontiguousarray(light),
        phone=phone,
        center=np.array([0.0, float(one.view["top"]) / 2, 0.0]),
        map_name=made.light.name,
        shape_name=str(one.view["shape"]),
        on_map=family == "ground",
        ground_radiance=lit / np.pi if family == "ground" else None,
    )


def _thing(world: World, standing: Standing, one: Traced) -> Thing:
    mesh = standing_mesh(world.views.files, shape_rng(world.views.files, int(standing.view["shape"])))
    turn = rotation_y(standing.turn).T
    positions = (standing.scale * mesh.positions @ turn + standing.place).astype(np.float32)
    mesh = replace(mesh, positions=positions, normals=(mesh.normals @ turn).astype(np.float32))
    return Thing(mesh=mesh, material=one.material)


def _panel(panel) -> Panel:
    matrix = np.eye(4)
    normal = np.cross(panel.right, panel.up)
    matrix[:3, :3] = np.stack([panel.right * panel.half[0], panel.up * panel.half[1], normal], axis=1)
    matrix[:3, 3] = panel.origin
    cover = layouts.Cover(kind="check", albedo=panel.albedo, alpha=panel.alpha, side=panel.side)
    return Panel(world_from_panel=matrix, half=panel.half, cover=cover)


def compared(world: World, family: str, number: int, quality: int) -> tuple[dict[str, float], np.ndarray]:
    """Return the figures of a layout, and both pictures side by side, in display values."""
    one = traced(world, family, number)
    render = render_layout(as_layout(world, family, one), quality)
    own = one.own
    fast = own[..., :3] + (1 - own[..., 3:]) * one.behind
    square = np.zeros((LONG_PX, LONG_PX, 4), np.float32)
    height, width = render.mask.shape
    top, left = (LONG_PX - height) // 2, (LONG_PX - width) // 2
    square[top : top + height, left : left + width, :3] = render.picture
    square[top : top + height, left : left + width, 3] = 1.0
    mask = np.zeros((LONG_PX, LONG_PX), np.float32)
    mask[top : top + height, left : left + width] = render.mask
    times = LONG_PX // SQUARE_PX
    small = square.reshape(SQUARE_PX, times, SQUARE_PX, times, 4).mean(axis=(1, 3))
    mask = mask.reshape(SQUARE_PX, times, SQUARE_PX, times).mean(axis=(1, 3))
    inside = small[..., 3] > 0.99
    bright = luminance(small[..., :3])
    lit = bright > 1e-3 * bright[inside].mean()  # Mitsuba has the backs of faces black
    thing = inside & (own[..., 3] > 0.95) & (mask > 0.95) & lit
    ground = inside & (own[..., 3] < 0.02) & (mask < 0.02)
    gain = 0.22 / max(float((bright[inside] ** 0.45).mean() ** (1 / 0.45)), 1e-9)
    a, b = (np.clip(response(picture * gain), 0.0, 1.0) * inside[..., None] for picture in (fast, small[..., :3]))
    near = ground & _near(own[..., 3] > 0.5, 10)
    shown = luminance(a), luminance(b)
    found = [find_dominant_light(truth).direction for truth in (one.truth, render.truth)]
    maps = [np.clip(response(truth * gain), 0.0, 1.0) for truth in (one.truth, render.truth)]

    def rmse(where: np.ndarray) -> float:
        return float(np.sqrt(((a - b)[where] ** 2).mean())) if where.any() else np.nan

    figures = {
        "object": rmse(thing),
        "object_level": float((shown[0] - shown[1])[thing].mean()) if thing.any() else np.nan,
        "ground": rmse(ground),
        "near": rmse(near),
        "near_level": float((shown[0] - shown[1])[near].mean()) if near.any() else np.nan,
        "truth": float(np.sqrt(((maps[0] - maps[1]) ** 2).mean())),
        "truth_deg": float(np.degrees(np.arccos(np.clip(found[0] @ found[1], -1, 1)))),
    }
    for name, limit in (("dark", lambda x: x < DARK), ("clipped", lambda x: x >= CLIPPED)):
        figures[name] = float(limit(shown[0])[inside].mean() - limit(shown[1])[inside].mean())
    return figures, np.hstack([a, b, 0.5 + 2 * (a - b) * inside[..., None]])


def _near(mask: np.ndarray, pixels: int) -> np.ndarray:
    from anyprobe_train.dataset.mask_errors import widen

    return widen(mask, pixels)


def check(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri and meshes.")],
    cache: Annotated[Path, Parameter(help="Folder of the world.")],
    count: Annotated[int, Parameter(help="Layouts of each family."), bounded(1)] = 12,
    quality: Annotated[int, Parameter(help="Times the paths of research.scenes."), bounded(1)] = 4,
    family: Annotated[list[str] | None, Parameter(help="Only this one; repeat for more.")] = None,
    sheet: Annotated[Path | None, Parameter(help="Picture of both and their difference.")] = None,
    out: Annotated[Path, Parameter(name=("--out", "-o"))] = Path("runs/world-check.json"),
) -> None:
    """Print the medians of each family: display RMSE on the object, beside it and near it, and shares of pixels."""
    from PIL import Image

    world, rows, tiles = World.open(data, cache), {}, []
    for name in family or LIGHT_OF:
        rows[name] = []
        for number in range(count):
            figures, picture = compared(world, name, number, quality)
            rows[name].append(figures)
            tiles.append(picture)
            print(
                f"{name} {number} " + " ".join(f"{key} {value:.3f}" for key, value in figures.items()), file=sys.stderr
            )
            if sheet is not None:
                strips = [np.vstack(tiles[k : k + count]) for k in range(0, len(tiles) - len(tiles) % count, count)]
                if strips:
                    Image.fromarray(np.uint8(255 * np.clip(np.hstack(strips), 0, 1))).save(sheet)
        medians = {key: round(float(np.nanmedian([row[key] for row in rows[name]])), 4) for key in rows[name][0]}
        print(f"{name}: {json.dumps(medians)}")
    write_result(out, {"commit": commit(), "rows": rows})


if __name__ == "__main__":
    run_command(check)
