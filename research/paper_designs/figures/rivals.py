"""Figs. 12 and 13: the paper's method beside Georgoulis et al. and Meka et al., as mirror spheres and as bars."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from anyprobe.core.frames import normalize
from anyprobe.core.response import inverse_response
from anyprobe.estimate.runtime import Models
from anyprobe.learning.evaluate.metrics import direction_error_deg
from anyprobe.light.dominant_light import find_dominant_light
from research.compare.figures import mirror_sphere, sphere_scores
from research.paper_designs.figures.real import RealPhoto, real_maps, real_photos
from research.paper_designs.figures.sheet import Tile, bars, save, sheet
from research.paper_designs.figures.trained import (
    MEASURED,
    METHODS,
    Trained,
    judged_batch,
    judged_pairs,
    maps_of,
    photo_of,
)

ROWS = 4
"""Synthetic pairs shown of each material group; real photos of each object."""
SPHERE = 112
RING = 5
COLORS = {"Ours": "#f08c14", "Georgoulis et al.": "#6a9f58", "Meka et al.": "#4a73d1"}
FIGURES = {"sphere_psnr": "PSNR", "sphere_rmse": "RMSE", "sphere_ssim": "SSIM"}
DIGITS = {"PSNR": 1, "RMSE": 3, "SSIM": 3, "angle to the lamp, degrees": 0}
SHIPPED = "paper, as shipped"


def draw_synthetic(one: Trained, out: Path) -> None:
    """Fig. 12, upper rows: test pairs, specular and diffuse; the RMSE of the mirror sphere in its corner."""
    rows = []
    for specular in (True, False):
        chosen = judged_pairs(one, specular, ROWS, shown=True)
        batch = judged_batch(one, chosen)
        side, maps = one.run.scale.side, maps_of(one.nets, batch, one.run.scale.side, one.run.scale.rows)
        for k, photo in enumerate(photo_of(batch, side)):
            truth = maps.ldr["truth"][k]
            kind = "specular" if specular else "diffuse"
            row = [Tile(picture=photo, caption=f"{kind}, {one.test.map_names[int(chosen.map[k])]}"[:34])]
            for name in METHODS:
                error = sphere_scores(maps.ldr[name][k], truth)["sphere_rmse"]
                row.append(Tile(picture=mirror_sphere(maps.ldr[name][k], SPHERE), corner=f"{error:.3f}"))
            rows.append([*row, Tile(picture=mirror_sphere(truth, SPHERE))])
    save(sheet(["photo" + " " * 24, *METHODS.values(), "truth"], rows), out / "figure_12.jpg")


def draw_real(one: Trained, folders: Iterable[Path], out: Path) -> None:
    """Fig. 12, lower rows: the first photos of every object of the folders; a ring where a mirror shows the lamp."""
    lift, paper = Models("lift", threads=1), Models("paper", threads=1)
    rows, shown = [], {}
    for folder in folders:
        for real in real_photos(folder):
            thing = real.name.split("_")[0]
            shown[thing] = shown.get(thing, 0) + 1
            if shown[thing] > 2:
                continue
            ldr = real_maps(one, real, lift).ldr
            maps = {name: ldr[name][0] for name in METHODS}
            maps[SHIPPED] = paper(real.crop.image, real.crop.tan_half).ldr
            photo = real.crop.image[..., :3] + 1.0 - real.crop.image[..., 3:]
            row = [Tile(picture=photo, caption=f"{'specular' if real.specular else 'diffuse'}, {real.name}")]
            row += [Tile(picture=_marked(mirror_sphere(one.clip(0, 1), SPHERE), real.lamp)) for one in maps.values()]
            rows.append(row)
    save(sheet(["photo" + " " * 18, *METHODS.values(), SHIPPED], rows), out / "figure_12_real.jpg")


def _marked(sphere: np.ndarray, lamp: np.ndarray | None) -> np.ndarray:
    """A mirror sphere with a red ring where it shows the lamp."""
    if lamp is None:
        return sphere
    half = normalize(lamp + np.array([0.0, 0.0, 1.0]))
    size = len(sphere)
    y, x = np.mgrid[:size, :size] + 0.5
    away = np.hypot(x - (half[0] + 1) / 2 * size, y - (1 - half[1]) / 2 * size)
    return np.where((np.abs(away - RING) < 1.2)[..., None], np.array([1.0, 0.1, 0.1]), sphere)


def draw_bars(one: Trained, folders: Iterable[Path], out: Path) -> None:
    """Fig. 13, and its numbers: synthetic pairs by mirror spheres, real photos by the angle to their lamp.

    No real photo in hand has a measured map, which the paper's Real-Spec and Real-Diff need.
    """
    panels: dict[str, dict[str, dict[str, float]]] = {title: {} for title in FIGURES.values()}
    for specular, group in ((True, "Synth-Spec"), (False, "Synth-Diff")):
        maps = maps_of(
            one.nets, judged_batch(one, judged_pairs(one, specular, MEASURED)), one.run.scale.side, one.run.scale.rows
        )
        for name, title in METHODS.items():
            pairs = zip(maps.ldr[name], maps.ldr["truth"], strict=True)
            scores = [sphere_scores(ldr, truth) for ldr, truth in pairs]
            for figure, panel in FIGURES.items():
                panels[panel].setdefault(group, {})[title] = float(np.mean([row[figure] for row in scores]))
    angles = lamp_angles_of(one, folders)
    if angles:
        panels["angle to the lamp, degrees"] = angles
    for panel, groups in panels.items():
        for group, values in groups.items():
            print(
                f"{panel}, {group}: " + ", ".join(f"{name} {value:.{DIGITS[panel]}f}" for name, value in values.items())
            )
    save(bars(panels, COLORS, DIGITS), out / "figure_13.png")


def lamp_angles_of(one: Trained, folders: Iterable[Path]) -> dict[str, dict[str, float]]:
    """Median angles [degrees] between dominant light and lamp by group and method."""
    lift, found = Models("lift", threads=1), {}
    for folder in folders:
        for real in real_photos(folder):
            if real.lamp is None:
                continue
            group = "Real-Spec" if real.specular else "Real-Diff"
            for name, angle in _angles(one, real, lift).items():
                found.setdefault(group, {}).setdefault(METHODS[name], []).append(angle)
    return {
        group: {name: float(np.median(values)) for name, values in found[group].items()}
        for group in ("Real-Spec", "Real-Diff")
        if group in found
    }


def _angles(one: Trained, real: RealPhoto, lift: Models) -> dict[str, float]:
    maps = real_maps(one, real, lift)
    light = {name: inverse_response(maps.ldr[name][0]) for name in METHODS} | {"ours": maps.radiance[0]}
    return {
        name: direction_error_deg(find_dominant_light(np.asarray(radiance, np.float32)).direction, real.lamp)
        for name, radiance in light.items()
    }
