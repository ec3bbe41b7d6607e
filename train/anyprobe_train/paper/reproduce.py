"""The whole reproduction in order: tables, then every piece."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import torch

from anyprobe_train.paper.open_tables import open_tables
from anyprobe_train.paper.pieces import PIECES
from anyprobe_train.paper.scores import Scorer
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.table_1 import write_table
from anyprobe_train.paper.training import is_trained, train
from anyprobe_train.train.loop import asked_to_stop

print_now = partial(print, flush=True)


def reproduce(
    data: Path | None,
    runs: Path,
    setting: Setting,
    *,
    threads: int = 1,
    device: str = "cpu",
    only: str = "",
    stop: int | None = None,
    say: Callable[[str], None] = print_now,
) -> bool:
    """Train every piece that is not yet trained and write Table 1, or train only one; return False if asked to stop.

    data: folder with hdri/ and meshes/; without it maps and shapes are procedural.
    stop: the step at which each piece is left, to test a machine.
    """
    torch.set_num_threads(threads)
    seen, test = (open_tables(data, runs, setting, split, say).to(device) for split in ("train", "test"))
    scorer = Scorer(seen, test, setting.scored)
    for piece in PIECES:
        if only not in ("", piece.name) or is_trained(piece, setting, runs):
            continue
        with asked_to_stop() as asked:
            if not train(piece, setting, seen, scorer, runs, asked_to_stop=asked, say=say, stop=stop):
                say(f"{piece.name}: stopped; the same command goes on")
                return False
    if not only and stop is None:
        say(write_table(data, runs, setting, threads=threads, say=say))
    return True
