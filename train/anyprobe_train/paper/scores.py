"""Errors of a network on pairs that it has and has not seen, beside those of what needs no network."""

from collections.abc import Iterator

import numpy as np
import torch
from torch import nn

from anyprobe_train.paper.losses import best_gain, picture_rmse
from anyprobe_train.paper.pairs import PaperPairs, Which, balanced, pairs_of
from anyprobe_train.paper.pieces import Piece, input_of, map_of, target_of
from anyprobe_train.paper.tables import Tables

BLOCK = 20
"""Pairs that are scored in one go."""


def blocks(tables: Tables, which: Which, frame: str = "sphere") -> Iterator[PaperPairs]:
    """Yield the pairs, some at a time."""
    for first in range(0, len(which.map), BLOCK):
        yield pairs_of(tables, which.part(slice(first, first + BLOCK)), frame)


class Scorer:
    """Scores of the same pairs every time: of `test`, of `seen`, and of `test` cropped to its box."""

    def __init__(self, seen: Tables, test: Tables, count: int) -> None:
        self._mean_map = seen.mean_map().permute(2, 0, 1)[None]
        unseen = balanced(test, count, 1)
        self._sets = {
            "unseen": (test, unseen, "sphere"),
            "seen": (seen, balanced(seen, count, 2), "sphere"),
            "box": (test, unseen, "box"),
        }

    @torch.no_grad()
    def __call__(self, piece: Piece, net: nn.Module, irradiance_net: nn.Module | None) -> dict[str, float]:
        """Return means over pairs, by "set figure"."""
        found: dict[str, list[np.ndarray]] = {}
        for name, (tables, which, frame) in self._sets.items():
            if frame == "box" and piece.network == "hdr":
                continue
            for pairs in blocks(tables, which, frame):
                estimate = net(input_of(piece, pairs, irradiance_net)).float().clip(0.0, 1.0)
                for figure, values in self._figures(piece, estimate, pairs).items():
                    found.setdefault(f"{name} {figure}", []).append(values.cpu().numpy())
        return {key: round(float(np.concatenate(values).mean()), 5) for key, values in found.items()}

    def _figures(self, piece: Piece, estimate: torch.Tensor, pairs: PaperPairs) -> dict[str, torch.Tensor]:
        truth = target_of(piece, pairs)
        found = {"rmse": picture_rmse(estimate, truth)}
        if piece.network == "irradiance":
            flat = truth.sum(dim=(2, 3), keepdim=True) / pairs.mask.sum(dim=(2, 3), keepdim=True).clip(min=1)
            found |= {
                "object": picture_rmse(estimate, truth, pairs.mask),
                "gain": picture_rmse(best_gain(estimate, truth), truth),
                "photo": picture_rmse(pairs.photo[:, :3], truth),
                "flat": picture_rmse(flat * pairs.mask, truth),
            }
        if piece.network == "illumination":
            flat = truth.mean(dim=(2, 3), keepdim=True).expand_as(truth)
            mean_map = self._mean_map.to(truth.device).expand_as(truth)
            found |= {"flat": picture_rmse(flat, truth), "mean map": picture_rmse(mean_map, truth)}
        if piece.network in ("sphere", "mirror"):
            found |= {"ldr": picture_rmse(map_of(piece, estimate, pairs, pairs.ldr.shape[2]), pairs.ldr)}
        return found
