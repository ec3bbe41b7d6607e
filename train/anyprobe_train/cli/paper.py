"""anyprobe-train paper: the paper's networks from nothing, and its tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.options import bounded
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe_train.cli.run import Data, need_torch


def paper(
    *,
    data: Data = None,
    runs: Annotated[Path, Parameter(help="Folder of tables, checkpoints and logs.")] = Path("runs/paper"),
    setting: Annotated[str, Parameter(help="Sizes: full, quarter (of the steps), small or tiny.")] = "full",
    only: Annotated[str, Parameter(help="One piece, by name; default: all in order.")] = "",
    stop: Annotated[int | None, Parameter(help="Leave each piece at this step, to test a machine."), bounded(1)] = None,
    table: Annotated[bool, Parameter(name="--table", help="Train nothing; write Table 1 of what is trained.")] = False,
    figure: Annotated[int | None, Parameter(help="Train nothing; draw this figure of the paper's.")] = None,
    graphs: Annotated[Path | None, Parameter(help="Train nothing; write the trained chain here as ONNX.")] = None,
    threads: Annotated[int, Parameter(help="Threads."), bounded(1)] = 2,
    device: Annotated[str, Parameter(help="cpu or cuda.")] = "cpu",
) -> None:
    """Train the paper's networks as it does. Resumes exactly where it stopped; SIGTERM saves first."""
    need_torch("training")
    from anyprobe_train.paper.open_tables import open_tables
    from anyprobe_train.paper.pieces import PIECES
    from anyprobe_train.paper.reproduce import reproduce, write_table_1
    from anyprobe_train.paper.settings import SETTINGS

    names = [piece.name for piece in PIECES]
    for subject, given, known in (("setting", setting, list(SETTINGS)), ("only", only or names[0], names)):
        if given not in known:
            text = f"expected one of {', '.join(known)}, got {given!r}{did_you_mean(given, known)}"
            raise InputError(text, subject=subject)
    if graphs is not None:
        from anyprobe_train.paper.graphs import export_chain

        for stage, difference in export_chain(runs, SETTINGS[setting], graphs).items():
            _say(f"{graphs / stage}.onnx: within {difference:.2g} of torch")
        return
    if figure is not None:
        from anyprobe_train.paper.figures import FIGURES, draw_figure

        if figure not in FIGURES:
            raise InputError(f"expected one of {', '.join(map(str, FIGURES))}, got {figure}", subject="figure")
        tables = (open_tables(data, runs, SETTINGS[setting], split, _say) for split in ("train", "test"))
        _say(str(draw_figure(figure, runs, SETTINGS[setting], *tables)))
        return
    if table:
        _say(write_table_1(data, runs, SETTINGS[setting], threads=threads, say=_say))
        return
    ended = reproduce(data, runs, SETTINGS[setting], threads=threads, device=device, only=only, stop=stop, say=_say)
    if not ended:
        sys.exit(143)


def _say(line: str) -> None:
    print(line, flush=True)
