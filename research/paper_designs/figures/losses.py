"""Figs. 6 and 7: losses without and with gradual targets, and what these targets are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from anyprobe.core.response import response
from anyprobe.light.environment import shrink
from anyprobe.light.filtering import blur_cosine_power
from anyprobe_train.dataset.catalog import load_maps
from research.paper_designs.figures.half_size import NOTE
from research.paper_designs.figures.sheet import FONT, LINE, Tile, save, sheet, wrapped, write_lines
from research.paper_designs.gradual import sharpness
from research.paper_designs.scale import EPOCHS

WIDTH, HEIGHT, LEFT, BOTTOM = 720, 320, 52, 42
CURVES = {
    "irradiance": ("Irradiance, targets as they are", (60, 100, 220)),
    "ours_sharp": ("Ours, gradual targets, against maps as they are", (190, 60, 60)),
    "ours": ("Ours, against its own targets", (240, 140, 20)),
}
"""By column of the log: title and colour."""
PRINTED = ("irradiance", "ours", "irradiance_2", "ours_2")
"""Columns of both seeds."""
GRADUAL_SHARE = 0.7
"""Share of the steps in which targets sharpen, in EPOCHS equal parts."""
TAIL = 0.1
"""Share of the steps, at the end, that the printed means are of: gradual targets are then as they are."""
SHOWN_MAP = "thatch_chapel"


def draw_losses(losses: dict[str, np.ndarray], out: Path) -> None:
    """Fig. 6: the logged losses, thin, and their mean over a twentieth of the run; prints the last tenth of each."""
    rows = len(losses["step"])
    top = float(np.quantile(np.stack([losses[name] for name in CURVES]), 0.995)) * 1.1
    lines = wrapped(NOTE, WIDTH - 4)
    page = Image.new("RGB", (WIDTH, HEIGHT + LINE * len(lines)), "white")
    pen = ImageDraw.Draw(page)
    plot_wide, plot_high = WIDTH - LEFT - 8, HEIGHT - BOTTOM - 8

    def place(row: np.ndarray, loss: np.ndarray) -> list[tuple[float, float]]:
        x = LEFT + plot_wide * row / rows
        y = 8 + plot_high * (1 - np.minimum(loss, top) / top)
        return list(zip(x.tolist(), y.tolist(), strict=True))

    window = max(rows // 20, 1)
    for name, (_, color) in CURVES.items():
        pen.line(place(np.arange(rows), losses[name]), fill=tuple((c + 2 * 255) // 3 for c in color))
    for number, (name, (title, color)) in enumerate(CURVES.items()):
        mean = np.convolve(losses[name], np.ones(window) / window, "valid")
        pen.line(place(np.arange(len(mean)) + window / 2, mean), fill=color, width=2)
        pen.text((WIDTH - 350, plot_high - 70 + LINE * number), title, color, FONT)
    for name in PRINTED:
        last = losses[name][-max(int(TAIL * rows), 2) :]
        print(f"{name}: last {TAIL:.0%} of steps: loss {last.mean():.4f}, standard deviation {last.std():.4f}")
    pen.line([(LEFT, 8), (LEFT, 8 + plot_high), (WIDTH - 8, 8 + plot_high)], fill="black")
    for tick in np.linspace(0, top, 5):
        pen.text((4, 2 + plot_high * (1 - tick / top)), f"{tick:.3f}", "black", FONT)
    for epoch in range(EPOCHS):
        x, step = LEFT + plot_wide * GRADUAL_SHARE * epoch / EPOCHS, plot_wide * GRADUAL_SHARE / EPOCHS
        pen.line([(x, 8 + plot_high), (x, 12 + plot_high)], fill="black")
        pen.text((x + step / 2 - 4, HEIGHT - 36), str(epoch + 1), "black", FONT)
    pen.text((LEFT + plot_wide * (1 + GRADUAL_SHARE) / 2 - 40, HEIGHT - 36), "as they are", "black", FONT)
    pen.text(
        (LEFT, HEIGHT - 20),
        "loss by epoch of the gradual targets (Eq. 6), each point a mean of 400 pairs",
        "black",
        FONT,
    )
    write_lines(pen, lines, HEIGHT)
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
