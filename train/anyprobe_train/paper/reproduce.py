"""The whole reproduction in order: tables, then every piece."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import torch

from anyprobe_train.paper.open_tables import open_tables
from anyprobe_train.paper.pieces import PIECES
from anyprobe_train.paper.scores import Scorer
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.table_1 import write_table
from anyprobe_train.paper.training import Stopped, Terminated, is_trained, train


def reproduce(
    data: Path | None,
    runs: Path,
    setting: Setting,
    *,
    threads: int = 1,
    device: str = "cpu",
    only: str = "",
    stop: int | None = None,
    say: Callable[[str], None] = print,
) -> bool:
    """Train every piece that is not yet trained, or only one; return False if SIGTERM ended it.

    data: folder with hdri/ and meshes/; without it maps and shapes are procedural.
    stop: the step at which each piece is left, to test a machine.
    """
    torch.set_num_threads(threads)
    wanted = [piece for piece in PIECES if only in ("", piece.name)]
    test, scorers = open_tables(data, runs, setting, "test", say).to(device), {}
    for piece in wanted:
        if is_trained(piece, setting, runs):
            continue
        if piece.maps not in scorers:
            seen = open_tables(data, runs, setting, piece.maps, say).to(device)
            scorers = {piece.maps: (seen, Scorer(seen, test, setting.scored))}
        seen, scorer = scorers[piece.maps]
        try:
            with Terminated() as terminated:
                train(piece, setting, seen, scorer, runs, terminated=terminated, say=say, stop=stop)
        except Stopped:
            say(f"{piece.name}: stopped; the same command goes on")
            return False
    return True


def write_table_1(
    data: Path | None, runs: Path, setting: Setting, *, threads: int = 1, say: Callable[[str], None] = print
) -> str:
    """Score the designs that are trained; return runs/table_1.md."""
    torch.set_num_threads(threads)
    seen, test = (open_tables(data, runs, setting, split, say) for split in ("train", "test"))
    return write_table(runs, setting, seen, test, count=setting.table_pairs)
