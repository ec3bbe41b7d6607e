"""The paper's Figs. 6, 7, 10 and 11 from a run, and the list of all that can be drawn."""

from pathlib import Path

import torch
from PIL import Image, ImageDraw

from anyprobe.files.atomic import atomic_path
from anyprobe.paper.equations import EPOCHS
from anyprobe_train.paper.figure_run import Run
from anyprobe_train.paper.materials import MATERIALS
from anyprobe_train.paper.pairs import balanced, pairs_of
from anyprobe_train.paper.photo_figures import failures, insertions
from anyprobe_train.paper.rival_figures import compared_maps, compared_numbers, relit_objects
from anyprobe_train.paper.schedule import filtered_target
from anyprobe_train.paper.sheets import as_bytes, columns_of, heat, picture_sheet, with_captions
from anyprobe_train.paper.training import log_of

SHOWN = 8
"""Pairs in a figure."""


def draw_figure(number: int, run: Run) -> tuple[Path, list[str]]:
    """Draw one of FIGURES as runs/figure_NN.png; return its path, and what it says: the steps of its networks."""
    path = run.runs / f"figure_{number:02d}.png"
    with torch.no_grad():
        picture = FIGURES[number](run)
    lines = list(run.notes.values())
    with atomic_path(path) as temporary:
        with_captions(picture, lines).save(temporary, "PNG")
    return path, lines


def losses(run: Run) -> Image.Image:
    """Draw Fig. 6: losses of `irradiance` (blue) and `ours` (orange) by step; grey: `ours` against sharp maps."""
    width, height = 800, 400
    picture = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(picture)
    gradual = log_of(run.runs, "ours")
    curves = [(log_of(run.runs, "irradiance"), "loss", "#3060c0")]
    curves += [(gradual, "unfiltered", "#a0a0a0"), (gradual, "loss", "#e08020")]
    most = max(line[key] for lines, key, _ in curves for line in lines)
    for lines, key, color in curves:
        points = [(width * line["step"] / line["steps"], height * (1 - line[key] / most)) for line in lines]
        pen.line(points, fill=color, width=2)
    return picture


def filtered_maps(run: Run) -> Image.Image:
    """Draw Fig. 7: a map as the eleven epochs show it, and as it is."""
    ldr = pairs_of(run.test, balanced(run.test, 1, 1)).ldr
    maps = [as_bytes(filtered_target(ldr, epoch))[0] for epoch in range(1, EPOCHS + 1)] + [as_bytes(ldr)[0]]
    return picture_sheet([maps[first : first + 4] for first in range(0, len(maps), 4)])


def training_pairs(run: Run) -> Image.Image:
    """Draw Fig. 10: of every material a photo, its I-Irradiance image and its map."""
    pairs = pairs_of(run.seen, balanced(run.seen, len(MATERIALS), 2))
    return picture_sheet(columns_of(pairs.photo[:, :3], pairs.irradiance[:, :3], pairs.ldr))


def results(run: Run) -> Image.Image:
    """Draw Fig. 11: photo; I-Irradiance, LDR map and radiance from 0 to 10, each estimated and true."""
    pairs = pairs_of(run.test, balanced(run.test, SHOWN, 1))
    made = run.chain(pairs.photo)
    shown = (
        *(pairs.photo[:, :3], made.irradiance, pairs.irradiance[:, :3], made.ldr, pairs.ldr),
        *(heat(made.radiance), heat(pairs.ln_radiance.exp())),
    )
    titles = ("photo", "I-Irradiance, est.", "GT", "LDR illum., est.", "GT", "HDR illum., est.", "GT")
    return picture_sheet(columns_of(*shown), titles)


FIGURES = {
    6: losses,
    7: filtered_maps,
    10: training_pairs,
    11: results,
    12: compared_maps,
    13: compared_numbers,
    14: relit_objects,
    15: insertions,
    16: failures,
}
"""Figures that can be drawn, by the paper's number."""
