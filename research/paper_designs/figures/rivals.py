"""Figs. 12 and 13: the paper's method beside Georgoulis et al. and Meka et al., as mirror spheres and as bars."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from anyprobe.core.frames import normalize
from anyprobe.core.response import response
from anyprobe.estimate.runtime import Models
from anyprobe.light.dominant_light import find_dominant_light
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.methods import Estimate, true_normals
from anyprobe_train.evaluate.metrics import direction_error_deg
from research.compare.figures import mirror_sphere, sphere_scores
from research.paper_designs.figures.half_size import DESIGNS, METHODS, NOTE, SHIPPED, SPHERES, HalfSize, kept_scores
from research.paper_designs.figures.real import RealPhoto, real_normals, real_photos
from research.paper_designs.figures.sheet import Tile, bars, save, sheet

PHOTOS = 2
"""Real photos shown of each object."""
SPHERE = 128
RING = 6
BARS = {**DESIGNS, "mean map": "mean map"}
"""Designs of the synthetic bars, and a baseline without a network."""
COLORS = dict(zip((*METHODS, "mean map"), ("#f08c14", "#6a9f58", "#4a73d1", "#8e5ea2", "#999999"), strict=True))
FIGURES = {"ball_psnr": "PSNR", "ball_rmse": "RMSE", "ball_ssim": "SSIM"}
ANGLE = "angle to the lamp, degrees"
DIGITS = {"PSNR": 1, "RMSE": 3, "SSIM": 3, ANGLE: 0}


def draw_synthetic(half: HalfSize, pairs: Iterable[Pair], out: Path) -> None:
    """Fig. 12, upper rows: frozen pairs, specular and diffuse; the RMSE of the mirror sphere in its corner."""
    rows = []
    for pair in pairs:
        truth = response(pair.radiance)
        row = [Tile(picture=on_white(pair.crop), caption="specular" if pair.specular else "diffuse")]
        for one in estimates(half, pair).values():
            error = sphere_scores(one.ldr, truth)["sphere_rmse"]
            row.append(Tile(picture=mirror_sphere(one.ldr, SPHERE), corner=f"{error:.3f}"))
        rows.append([*row, Tile(picture=mirror_sphere(truth, SPHERE), caption=pair.map_name)])
    save(sheet(["photo", *METHODS, "truth"], rows, NOTE), out / "figure_12.jpg")


def draw_real(half: HalfSize, folders: Iterable[Path], out: Path) -> None:
    """Fig. 12, lower rows: the first photos of every object of the folders; a ring where a mirror shows the lamp."""
    lift, rows, shown = Models("lift", threads=1), [], {}
    for folder in folders:
        for real in real_photos(folder):
            thing = real.name.split("_")[0]
            shown[thing] = shown.get(thing, 0) + 1
            if shown[thing] > PHOTOS:
                continue
            kind = "specular" if real.specular else "diffuse"
            row = [Tile(picture=on_white(real.crop.image), caption=f"{kind}, {real.name}")]
            for one in _of_real(half, real, lift).values():
                row.append(Tile(picture=_marked(mirror_sphere(one.ldr, SPHERE), real.lamp)))
            rows.append(row)
    note = f"{NOTE} Normals of Meka et al.: those of lift. Ring: where a mirror would show the lamp."
    save(sheet(["photo", *METHODS], rows, note), out / "figure_12_real.jpg")


def estimates(half: HalfSize, pair: Pair) -> dict[str, Estimate]:
    """Estimate by method; Meka et al. are given the pair's true normals."""
    return half(pair.crop, pair.tan_half, true_normals(pair))


def on_white(crop: np.ndarray) -> np.ndarray:
    """A crop [S, S, 4] on white, display values [S, S, 3]."""
    return crop[..., :3] + 1.0 - crop[..., 3:]


def _of_real(half: HalfSize, real: RealPhoto, lift: Models) -> dict[str, Estimate]:
    return half(real.crop.image, real.crop.tan_half, real_normals(real, lift))


def _marked(sphere: np.ndarray, lamp: np.ndarray | None) -> np.ndarray:
    """A mirror sphere with a red ring where it shows the lamp."""
    if lamp is None:
        return sphere
    half = normalize(lamp + np.array([0.0, 0.0, 1.0]))
    size = len(sphere)
    y, x = np.mgrid[:size, :size] + 0.5
    away = np.hypot(x - (half[0] + 1) / 2 * size, y - (1 - half[1]) / 2 * size)
    return np.where((np.abs(away - RING) < 1.2)[..., None], np.array([1.0, 0.1, 0.1]), sphere)


def draw_bars(folders: Iterable[Path], out: Path) -> None:
    """Fig. 13, and its numbers: kept scores of mirror spheres under 1,000 frozen pairs, and, given folders of real
    photos, angles to their lamp.

    No real photo in hand has a measured map, which the paper's Real-Spec and Real-Diff need.
    """
    panels: dict[str, dict[str, dict[str, float]]] = {title: {} for title in FIGURES.values()}
    kept = kept_scores(SPHERES)
    for group, name in (("Synth-Spec", "specular"), ("Synth-Diff", "diffuse")):
        rows = {row["design"]: row for row in kept[name]["rows"]}
        for figure, panel in FIGURES.items():
            panels[panel][group] = {title: rows[design][figure] for design, title in BARS.items()}
            ahead = kept[name]["ahead"]["ours"]
            beside = ", ".join(
                f"{panels[panel][group][title]:.3f} {title} (Ours {ahead[design][figure]['mean']:+.3f} +- "
                f"{ahead[design][figure]['standard_error']:.3f})"
                for design, title in BARS.items()
                if design in ahead
            )
            print(f"{panel}, {group}, {kept[name]['pairs']} pairs: {panels[panel][group]['Ours']:.3f} Ours, {beside}")
    angles = lamp_angles_of(HalfSize(), folders) if folders else {}
    for group, by_method in angles.items():
        print(f"{ANGLE}, {group}: " + ", ".join(f"{name} {value:.0f}" for name, value in by_method.items()))
    if angles:
        panels[ANGLE] = angles
    colors = {name: color for name, color in COLORS.items() if name != SHIPPED or angles}
    save(bars(panels, colors, DIGITS, f"{NOTE} Synth: 1,000 frozen pairs."), out / "figure_13.png")


def lamp_angles_of(half: HalfSize, folders: Iterable[Path]) -> dict[str, dict[str, float]]:
    """Median angles [degrees] between dominant light and lamp by group and method."""
    lift, found = Models("lift", threads=1), {}
    for folder in folders:
        for real in real_photos(folder):
            if real.lamp is None:
                continue
            group = found.setdefault("Real-Spec" if real.specular else "Real-Diff", {})
            for name, one in _of_real(half, real, lift).items():
                light = find_dominant_light(np.asarray(one.lights, np.float32))
                group.setdefault(name, []).append(direction_error_deg(light.direction, real.lamp))
    return {
        group: {name: float(np.median(values)) for name, values in found[group].items()}
        for group in ("Real-Spec", "Real-Diff")
        if group in found
    }
