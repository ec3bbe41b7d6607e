"""The pictures of a study, collected while it runs: the paper's Figs. 7, 11 to 14, and those of real photos."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.metrics import rmse
from anyprobe.evaluate.panel import BALL_SIZE, Estimate, mirror_ball, relit, virtual_object
from anyprobe.evaluate.real import RealPair
from anyprobe.evaluate.sheets import draw_sheet, heat, save_sheet
from anyprobe.light.filtering import blur_cosine_power

SHARPNESS = (1, 8, 64, 216, 512, 1331)
CHAIN = "ours"
EMPTY = np.ones((BALL_SIZE, BALL_SIZE, 3), np.float32)
"""Where a method had not what it must be told."""


class Figures:
    """Keeps what is to be drawn of every so many pairs, `count` in all."""

    def __init__(self, pairs: int, count: int = 8) -> None:
        self.every = max(1, pairs // count) | 1  # odd: even steps would show a few shapes only
        self.count, self.kept = count, []

    def add(self, index: int, pair: Pair, estimates: Mapping[str, Estimate]) -> None:
        """Watch of evaluate.study."""
        if index % self.every == 0 and len(self.kept) < self.count:
            self.kept.append((pair, dict(estimates)))

    def save(self, folder: Path) -> list[Path]:
        """Draw every figure that there is something for; returns the files."""
        drawn = {"fig7.jpg": self.gradual(), "fig12.jpg": self.maps(), "fig13.jpg": self.balls()}
        drawn |= {"fig14.jpg": self.relighting()}
        if any(CHAIN in estimates for _, estimates in self.kept):
            drawn["fig11.jpg"] = self.chain()
        for name, image in drawn.items():
            save_sheet(folder / name, image)
        return [folder / name for name in drawn]

    def gradual(self):
        """Fig. 7: an LDR map through the filter of Eq. 6."""
        ldr = response(self.kept[0][0].radiance)
        row = [blur_cosine_power(ldr, float(s)) for s in SHARPNESS]
        return draw_sheet([*(f"cos^{s}" for s in SHARPNESS), "the map"], [[*row, ldr]])

    def chain(self):
        """Fig. 11: the three networks' outputs beside their truths."""
        names = ["photo", "irradiance", "truth", "LDR map", "truth", "HDR, 0 to 10", "truth"]
        rows = []
        for pair, estimates in self.kept:
            one = estimates[CHAIN]
            rows.append([pair.crop[..., :3], one.irradiance, pair.irradiance / 255.0, one.ldr])
            rows[-1] += [response(pair.radiance), heat(one.radiance), heat(pair.radiance)]
        return draw_sheet(names, rows)

    def maps(self):
        """Fig. 12: LDR maps of every method."""
        methods = list(self.kept[0][1])
        rows = [
            [pair.crop[..., :3], response(pair.radiance), *(estimates[name].ldr for name in methods)]
            for pair, estimates in self.kept
        ]
        return draw_sheet(["photo", "truth", *methods], rows, height=48)

    def balls(self):
        """The same as mirror balls."""
        methods = list(self.kept[0][1])
        rows = []
        for pair, estimates in self.kept:
            maps = [response(pair.radiance), *(estimates[name].ldr for name in methods)]
            rows.append([pair.crop[..., :3], *(mirror_ball(one) for one in maps)])
        return draw_sheet(["photo", "truth", *methods], rows, height=80)

    def relighting(self):
        """Fig. 14: the virtual object under every map, with its RMSE."""
        methods = list(self.kept[0][1])
        mask = virtual_object()[0].mask
        rows, notes = [], []
        for pair, estimates in self.kept:
            truth, *others = relit([pair.radiance, *(estimates[name].lights for name in methods)])
            rows.append([pair.crop[..., :3], truth, *others])
            notes.append(["", "", *(f"{rmse(one[mask], truth[mask]):.3f}" for one in others)])
        return draw_sheet(["photo", "truth", *methods], _on_grey(rows), notes, height=96)


class RealBalls:
    """Real photos and every method's LDR map as a mirror ball, beside the measured one: Fig. 12 of a user's own."""

    MOST = 12

    def __init__(self) -> None:
        self.kept: list[tuple[RealPair, dict[str, Estimate]]] = []

    def add(self, pair: RealPair, estimates: Mapping[str, Estimate]) -> None:
        """Watch of evaluate.real.score_real."""
        if len(self.kept) < self.MOST:
            self.kept.append((pair, dict(estimates)))

    def save(self, folder: Path) -> list[Path]:
        """Write real.jpg, if there is anything to draw."""
        if not self.kept:
            return []
        methods = list(dict.fromkeys(name for _, estimates in self.kept for name in estimates))
        rows = [
            [
                pair.crop[..., :3],
                mirror_ball(response(pair.radiance)),
                *(mirror_ball(one[name].ldr) if name in one else EMPTY for name in methods),
            ]
            for pair, one in self.kept
        ]
        save_sheet(folder / "real.jpg", draw_sheet(["photo", "measured", *methods], rows, height=80))
        return [folder / "real.jpg"]


def _on_grey(rows: list[list[np.ndarray]]) -> list[list[np.ndarray]]:
    """Pictures over mid grey where they are black all through, so that outlines show."""
    return [[np.where(one.any(axis=-1, keepdims=True), one, 0.5) for one in row] for row in rows]
