"""Figs. 6 and 7: losses without and with gradual targets, and what these targets are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from anyprobe.core.response import response
from anyprobe.learning.dataset.catalog import load_maps
from anyprobe.light.environment import shrink
from anyprobe.light.filtering import blur_cosine_power
from research.paper_designs.figures.sheet import Tile, save, sheet
from research.paper_designs.figures.trained import Trained
from research.paper_designs.gradual import sharpness
from research.paper_designs.scale import EPOCHS
from research.paper_designs.train import KEPT_LOSSES

WIDTH, HEIGHT, LEFT, BOTTOM = 640, 300, 52, 34
COLORS = {"irradiance": (60, 100, 220), "ours": (240, 140, 20)}
TITLES = {"irradiance": "Irradiance, targets as they are", "ours": "Ours, gradual targets"}
TAIL = 0.1
"""Share of the steps, at the end, that the printed means are of: gradual targets are then as they are."""
SHOWN_MAP = "thatch_chapel"


def draw_losses(one: Trained, out: Path) -> None:
    """Fig. 6: each step's loss, thin, and its mean over a fiftieth of the run; prints both designs' last tenth."""
    losses = one.losses
    top = float(np.quantile(losses, 0.999)) * 1.05
    page = Image.new("RGB", (WIDTH, HEIGHT), "white")
    pen = ImageDraw.Draw(page)
    plot_wide, plot_high = WIDTH - LEFT - 8, HEIGHT - BOTTOM - 8

    def place(step: np.ndarray, loss: np.ndarray) -> list[tuple[float, float]]:
        x = LEFT + plot_wide * step / len(losses)
        y = 8 + plot_high * (1 - np.minimum(loss, top) / top)
        return list(zip(x.tolist(), y.tolist(), strict=True))

    window = max(len(losses) // 50, 1)
    steps = np.arange(len(losses))
    for column, name in enumerate(KEPT_LOSSES):
        faint = tuple((c + 2 * 255) // 3 for c in COLORS[name])
        pen.line(place(steps, losses[:, column]), fill=faint)
    for column, name in enumerate(KEPT_LOSSES):
        mean = np.convolve(losses[:, column], np.ones(window) / window, "valid")
        pen.line(place(steps[: len(mean)] + window / 2, mean), fill=COLORS[name], width=2)
        pen.text((WIDTH - 230, 14 + 16 * column), TITLES[name], COLORS[name])
        last = losses[-max(int(TAIL * len(losses)), 2) :, column]
        print(f"{TITLES[name]}: last {TAIL:.0%} of steps: loss {last.mean():.5f}, standard deviation {last.std():.5f}")
    pen.line([(LEFT, 8), (LEFT, 8 + plot_high), (WIDTH - 8, 8 + plot_high)], fill="black")
    for tick in np.linspace(0, top, 5):
        pen.text((4, 2 + plot_high * (1 - tick / top)), f"{tick:.3f}", "black")
    for epoch in range(EPOCHS):
        x = LEFT + plot_wide * epoch / EPOCHS
        pen.line([(x, 8 + plot_high), (x, 12 + plot_high)], fill="black")
        pen.text((x + plot_wide / EPOCHS / 2 - 4, HEIGHT - 24), str(epoch + 1), "black")
    pen.text(
        (LEFT, HEIGHT - 12),
        f"step of the gradual targets (Eq. 6); {len(losses):,} steps of {one.run.batch} pairs",
        "black",
    )
    save(page, out / "figure_06.png")


def draw_targets(data: Path, out: Path) -> None:
    """Fig. 7: the LDR map of a test map in every epoch, with beta e."""
    radiance = next(one.radiance for one in load_maps(data / "hdri" / "test") if one.name == SHOWN_MAP)
    ldr = response(shrink(radiance, 64))
    tiles = []
    for epoch in range(1, EPOCHS + 1):
        power = sharpness(epoch)
        tiles.append(Tile(picture=blur_cosine_power(ldr, power), caption=f"epoch {epoch}, beta e {power:.0f}"))
    tiles.append(Tile(picture=ldr, caption="as it is"))
    save(sheet([""] * 4, [tiles[k : k + 4] for k in (0, 4, 8)]), out / "figure_07.jpg")
