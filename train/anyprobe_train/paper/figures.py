"""The paper's Figs. 6, 7, 10, 11 and 12, drawn from a run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw

from anyprobe.core.color import luminance
from anyprobe.files.atomic import atomic_path
from anyprobe.paper.chain import estimate_light
from anyprobe.paper.equations import EPOCHS
from anyprobe_train.paper.materials import MATERIALS
from anyprobe_train.paper.pairs import PaperPairs, balanced, pairs_of
from anyprobe_train.paper.pieces import PIECES, input_of, map_of
from anyprobe_train.paper.schedule import filtered_target
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.tables import Tables
from anyprobe_train.paper.training import load_net

CELL_ROWS, GAP = 128, 4
"""Height of a picture in a sheet, and what is between two [pixels]."""
HEAT = np.array([[0, 0, 0], [40, 20, 130], [190, 40, 90], [250, 150, 30], [255, 255, 220]], np.float32) / 255
MOST = 10.0
"""Radiance at the end of heat maps, as in the paper's Fig. 11."""
SHOWN = 8
"""Pairs in a figure."""


def draw_figure(number: int, runs: Path, setting: Setting, seen: Tables, test: Tables) -> Path:
    """Draw one of FIGURES as runs/figure_NN.png; return its path."""
    path = runs / f"figure_{number:02d}.png"
    with atomic_path(path) as temporary, torch.no_grad():
        FIGURES[number](runs, setting, seen, test).save(temporary, "PNG")
    return path


def losses(runs: Path, setting: Setting, seen: Tables, test: Tables) -> Image.Image:
    """Draw Fig. 6: losses of `irradiance` (blue) and `ours` (orange) by step; grey: `ours` against sharp maps."""
    width, height = 800, 400
    picture = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(picture)
    curves = [(_log(runs, "irradiance"), "loss", "#3060c0"), (_log(runs, "ours"), "unfiltered", "#a0a0a0")]
    curves.append((curves[1][0], "loss", "#e08020"))
    most = max(line[key] for lines, key, _ in curves for line in lines)
    for lines, key, color in curves:
        points = [(width * line["step"] / line["steps"], height * (1 - line[key] / most)) for line in lines]
        pen.line(points, fill=color, width=2)
    return picture


def _log(runs: Path, name: str) -> list[dict[str, float]]:
    """Read a piece's log in order of steps, each once."""
    lines = [json.loads(line) for line in (runs / name / "log.jsonl").read_text(encoding="utf-8").splitlines()]
    return [line for _, line in sorted({line["step"]: line for line in lines}.items())]


def filtered_maps(runs: Path, setting: Setting, seen: Tables, test: Tables) -> Image.Image:
    """Draw Fig. 7: a map as the eleven epochs show it, and as it is."""
    ldr = pairs_of(test, balanced(test, 1, 1)).ldr
    maps = [_shown(filtered_target(ldr, epoch))[0] for epoch in range(1, EPOCHS + 1)] + [_shown(ldr)[0]]
    return picture_sheet([maps[first : first + 4] for first in range(0, len(maps), 4)])


def training_pairs(runs: Path, setting: Setting, seen: Tables, test: Tables) -> Image.Image:
    """Draw Fig. 10: of every material a photo, its I-Irradiance image and its map."""
    pairs = pairs_of(seen, balanced(seen, len(MATERIALS), 2))
    shown = (_shown(pairs.photo[:, :3]), _shown(pairs.irradiance[:, :3]), _shown(pairs.ldr))
    return picture_sheet([list(row) for row in zip(*shown, strict=True)])


def results(runs: Path, setting: Setting, seen: Tables, test: Tables) -> Image.Image:
    """Draw Fig. 11: photo; I-Irradiance, LDR map and radiance from 0 to 10, each estimated and true."""
    pairs = pairs_of(test, balanced(test, SHOWN, 1))
    first, second, third = (load_net(setting, runs, name) for name in ("irradiance_net", "ours", "hdr_net"))
    made = estimate_light(pairs.photo, first, second, third)
    shown = (
        *(pairs.photo[:, :3], made.irradiance, pairs.irradiance[:, :3], made.ldr, pairs.ldr),
        *(heat(made.radiance), heat(pairs.ln_radiance.exp())),
    )
    return picture_sheet([list(row) for row in zip(*map(_shown, shown), strict=True)])


def rivals(runs: Path, setting: Setting, seen: Tables, test: Tables) -> Image.Image:
    """Draw Fig. 12: photo, the maps of ours, Georgoulis et al. and Meka et al., and the truth."""
    pairs = pairs_of(test, balanced(test, SHOWN, 1))
    maps = [_map(name, runs, setting, pairs) for name in ("ours", "georgoulis", "meka")]
    shown = (pairs.photo[:, :3], *maps, pairs.ldr)
    return picture_sheet([list(row) for row in zip(*map(_shown, shown), strict=True)])


def _map(name: str, runs: Path, setting: Setting, pairs: PaperPairs) -> torch.Tensor:
    (piece,) = (one for one in PIECES if one.name == name)
    seen = input_of(piece, pairs, load_net(setting, runs, "irradiance_net"))
    return map_of(piece, load_net(setting, runs, name)(seen).clip(0.0, 1.0), pairs)


def heat(radiance: torch.Tensor) -> torch.Tensor:
    """Colour the luminance of maps [N, 3, R, 2 R] from 0 to MOST."""
    value = luminance(radiance.permute(0, 2, 3, 1).numpy()).clip(0, MOST) / MOST
    colors = [np.interp(value, np.linspace(0, 1, len(HEAT)), HEAT[:, channel]) for channel in range(3)]
    return torch.from_numpy(np.stack(colors, axis=1).astype(np.float32))


def _shown(pictures: torch.Tensor) -> np.ndarray:
    return (pictures.clip(0.0, 1.0).permute(0, 2, 3, 1).numpy() * 255 + 0.5).astype(np.uint8)


def picture_sheet(rows: list[list[np.ndarray]]) -> Image.Image:
    """Arrange pictures [H, W, 3] uint8, scaled to CELL_ROWS pixels high."""
    cells = [[Image.fromarray(np.ascontiguousarray(one)) for one in row] for row in rows]
    cells = [[one.resize((CELL_ROWS * one.width // one.height, CELL_ROWS)) for one in row] for row in cells]
    width = max(sum(one.width + GAP for one in row) for row in cells)
    whole = Image.new("RGB", (width, len(cells) * (CELL_ROWS + GAP)), "white")
    for top, row in enumerate(cells):
        left = 0
        for one in row:
            whole.paste(one, (left, top * (CELL_ROWS + GAP)))
            left += one.width + GAP
    return whole


FIGURES = {6: losses, 7: filtered_maps, 10: training_pairs, 11: results, 12: rivals}
"""Figures that can be drawn, by the paper's number."""
