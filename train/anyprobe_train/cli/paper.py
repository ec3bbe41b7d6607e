"""anyprobe-train paper: the paper's networks from nothing, and its tables."""

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
    setting: Annotated[str, Parameter(help="Sizes: full, quarter, short (a 24th), small, tiny.")] = "full",
    only: Annotated[str, Parameter(help="One piece, by name; default: all in order.")] = "",
    stop: Annotated[int | None, Parameter(help="Leave each piece at this step, to test a machine."), bounded(1)] = None,
    table: Annotated[bool, Parameter(name="--table", help="Train nothing; write Table 1 of what is trained.")] = False,
    figure: Annotated[int | None, Parameter(help="Train nothing; draw this figure, at the step that is there.")] = None,
    graphs: Annotated[Path | None, Parameter(help="Train nothing; write the chain as ONNX here, and its card.")] = None,
    threads: Annotated[int, Parameter(help="Threads."), bounded(1)] = 2,
    device: Annotated[str, Parameter(help="cpu or cuda.")] = "cpu",
) -> None:
    """Train the paper's networks as it does, and write its Table 1. Resumes exactly; SIGTERM saves first."""
    need_torch("training")
    from anyprobe_train.paper.pieces import PIECES
    from anyprobe_train.paper.reproduce import reproduce
    from anyprobe_train.paper.settings import setting_named
    from anyprobe_train.paper.table_1 import write_table

    chosen, names = setting_named(setting), [piece.name for piece in PIECES]
    if only and only not in names:
        text = f"expected one of {', '.join(names)}, got {only!r}{did_you_mean(only, names)}"
        raise InputError(text, subject="only")
    if graphs is not None:
        from anyprobe_train.paper.graphs import export_chain

        for stage, difference in export_chain(runs, chosen, graphs).items():
            print(f"{graphs / stage}.onnx: within {difference:.2g} of torch")
    elif figure is not None:
        from anyprobe_train.paper.figure_run import Run
        from anyprobe_train.paper.figures import FIGURES, draw_figure

        if figure not in FIGURES:
            raise InputError(f"expected one of {', '.join(map(str, FIGURES))}, got {figure}", subject="figure")
        path, lines = draw_figure(figure, Run(runs=runs, setting=chosen, data=data))
        for line in (*lines, path):
            print(line)
    elif table:
        print(write_table(data, runs, chosen, threads=threads))
    elif not reproduce(data, runs, chosen, threads=threads, device=device, only=only, stop=stop):
        sys.exit(143)
