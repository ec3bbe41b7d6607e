"""What the best linear reading of a picture makes of the map, given shape and material.

Ridge regression (a Wiener filter where light is Gaussian) from display values of the picture's pixels to those of the
map. It is learned on training maps shown by the test pair's own shape in its own material, from cameras of nearly its
elevation: all that no design is given.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from research.paper_designs.judge import TEST_PAIRS, rmse, ssim
from research.paper_designs.pairs import balanced
from research.paper_designs.scale import MATERIALS, VIEWS
from research.paper_designs.tables import Tables

CAMERAS = 3
"""Cameras of the next elevations, below and above, whose lights are learned from too."""
PENALTIES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Penalties of the ridge, in mean eigenvalues of the pixels' products; chosen by material on maps kept back."""
KEPT_BACK = 5
"""One in so many training maps, with its mirrored twin."""
CHANNELS = {"photo": slice(0, 3), "irradiance": slice(3, 6)}


def ceilings(seen: Tables, test: Tables, path: Path, pairs: int = TEST_PAIRS) -> None:
    """Write "linear from photo/rmse" and the like, [pairs] each, for the pairs of Judge."""
    chosen = balanced(test, pairs, 1)
    columns = {}
    for name, channels in CHANNELS.items():
        reader = _Linear(seen, test, channels)
        maps = []
        those = zip(chosen.map, chosen.view, chosen.material, chosen.shape, strict=True)
        for place, pair in enumerate(those):
            maps.append(reader.estimate(*map(int, pair)))
            if place % 50 == 0:
                print(f"linear from {name}: {place} of {pairs}", flush=True)
        truth = test.ldr[chosen.map * VIEWS + chosen.view].float() / 255.0
        estimate = torch.stack(maps)
        columns[f"linear from {name}/rmse"] = rmse(estimate, truth).numpy()
        columns[f"linear from {name}/ssim"] = ssim(estimate, truth, wraps=True).numpy()
    mean = (seen.ldr.float().mean(dim=0) / 255.0).expand_as(truth)
    columns |= {"mean map/rmse": rmse(mean, truth).numpy(), "mean map/ssim": ssim(mean, truth, wraps=True).numpy()}
    np.savez_compressed(path, **columns)


class _Linear:
    """Reads maps from one kind of picture."""

    def __init__(self, seen: Tables, test: Tables, channels: slice) -> None:
        self._seen, self._test, self._channels = seen, test, channels
        self._penalty: dict[int, float] = {}

    def estimate(self, number: int, view: int, material: int, shape: int) -> torch.Tensor:
        """The map [3, rows, 2 rows] of one test pair."""
        light = torch.tensor([number * VIEWS + view])
        shown = self._pictures(self._test, light, view, material, shape)
        lights = self._lights(view)
        x, y = self._pictures(self._seen, lights, view, material, shape), self._maps(lights)
        if material not in self._penalty:
            self._penalty[material] = self._choose(x, y, lights)
        guess = ridge(x, y, shown, self._penalty[material])
        return guess.reshape(self._test.ldr.shape[1:]).clip(0, 1)

    def _lights(self, view: int) -> torch.Tensor:
        near = torch.arange(max(view - CAMERAS, 0), min(view + CAMERAS + 1, VIEWS))
        maps = torch.arange(len(self._seen.ldr) // VIEWS)
        return (maps[:, None] * VIEWS + near).flatten()

    def _pictures(self, tables: Tables, lights: torch.Tensor, view: int, material: int, shape: int) -> torch.Tensor:
        """Of a test shape under lights of either split, [len(lights), pixels * 3]."""
        pixels = self._test.surface[shape * VIEWS + view].long()
        pixels = pixels[pixels != len(self._test.normals) - 1]
        rows = tables.shades[lights * len(MATERIALS) + material][:, pixels].contiguous()
        values = rows.view(torch.uint8).reshape(len(lights), len(pixels), 8)[..., self._channels]
        return values.flatten(1).float() / 255.0

    def _maps(self, lights: torch.Tensor) -> torch.Tensor:
        return self._seen.ldr[lights].flatten(1).float() / 255.0

    def _choose(self, x: torch.Tensor, y: torch.Tensor, lights: torch.Tensor) -> float:
        back = (lights // VIEWS // 2) % KEPT_BACK == 0
        errors = [
            float((ridge(x[~back], y[~back], x[back], penalty).clip(0, 1) - y[back]).square().mean())
            for penalty in PENALTIES
        ]
        return PENALTIES[int(np.argmin(errors))]


def ridge(x: torch.Tensor, y: torch.Tensor, shown: torch.Tensor, penalty: float) -> torch.Tensor:
    """Values [K, M] for shown [K, P], by ridge regression from x [N, P] to y [N, M] with free means.

    penalty: in mean eigenvalues of x x^T.
    """
    middle, level = x.mean(dim=0), y.mean(dim=0)
    x = x - middle
    gram = x @ x.T
    gram.diagonal().add_(penalty * gram.diagonal().mean())
    weights = torch.linalg.solve(gram, x @ (shown - middle).T, left=True)
    return level + weights.T @ (y - level)
