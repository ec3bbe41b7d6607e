"""Errors of a network on pairs that it has and has not seen; those of what needs no network are in Table 1."""

from collections.abc import Iterator

import numpy as np
import torch
from torch import nn

from anyprobe_train.paper.losses import picture_rmse
from anyprobe_train.paper.pairs import PaperPairs, Which, balanced, pairs_of
from anyprobe_train.paper.pieces import Piece, input_of, target_of
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
        unseen = balanced(test, count, 1)
        self._sets = {
            "unseen": (test, unseen, "sphere"),
            "seen": (seen, balanced(seen, count, 2), "sphere"),
            "box": (test, unseen, "box"),
        }

    @torch.no_grad()
    def __call__(self, piece: Piece, net: nn.Module, irradiance_net: nn.Module | None) -> dict[str, float]:
        """Return means over pairs of their RMSE, by "set rmse"."""
        found: dict[str, list[np.ndarray]] = {}
        for name, (tables, which, frame) in self._sets.items():
            if frame == "box" and piece.network == "hdr":
                continue
            for pairs in blocks(tables, which, frame):
                estimate = net(input_of(piece, pairs, irradiance_net)).float().clip(0.0, 1.0)
                errors = picture_rmse(estimate, target_of(piece, pairs))
                found.setdefault(f"{name} rmse", []).append(errors.cpu().numpy())
        return {key: round(float(np.concatenate(values).mean()), 5) for key, values in found.items()}
