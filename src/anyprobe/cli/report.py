"""anyprobe report and anyprobe timing: the results page, and how long each network takes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from anyprobe.cli.results import RESULTS, commit, write_result
from anyprobe.infer.engines import DEFAULT_ENGINE, ENGINES
from anyprobe.infer.runtime import DEFAULT_MODEL

PAGE = Path("docs/results.md")


def report(
    results: Annotated[Path, typer.Option(help="Folder of the result files.")] = RESULTS,
    out: Annotated[Path, typer.Option("-o", "--out", help="The page to write.")] = PAGE,
) -> None:
    """Write docs/results.md and its charts from the files that compare, timing and evaluate --real left."""
    from anyprobe.evaluate.report import write_report

    typer.echo(write_report(results, out))


def timing(
    model: Annotated[
        list[str] | None, typer.Option(help="Bundled model or folder of graphs; repeat for more.")
    ] = None,
    engine: Annotated[
        list[str] | None, typer.Option(help=f"One of {', '.join(ENGINES)}; repeat for more.")
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the runtime.")] = 1,
    repeats: Annotated[int, typer.Option(min=3, help="Calls, of which the median counts.")] = 50,
    photo: Annotated[Path, typer.Option(help="A photo that says where its object is.")] = Path(
        "examples/vase.png"
    ),
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for timing.json.")] = RESULTS,
) -> None:
    """Time each network, their sum and the whole call, as in the paper's Sect. 5, into timing.json."""
    from anyprobe.evaluate.methods import origin
    from anyprobe.evaluate.timing import machine_name, time_model

    models, engines = model or [DEFAULT_MODEL], engine or [DEFAULT_ENGINE]
    made = {
        Path(name).name + ("" if one == DEFAULT_ENGINE else f", {one}"): time_model(
            name, photo, threads, repeats, one
        )
        for name in models
        for one in engines
    }
    content = {
        "command": " ".join(
            [
                "anyprobe timing",
                *(f"--model {Path(name).name}" for name in models),
                *(f"--engine {one}" for one in engine or []),
                f"--threads {threads}",
            ]
        ),
        "commit": commit(),
        "machine": machine_name(),
        **{Path(name).name: origin(name) for name in models},
        "threads": threads,
        "repeats": repeats,
        "models": made,
    }
    write_result(out / "timing.json", content)
    for name, one in made.items():
        parts = {**one["networks"], "whole call": one["whole"]}
        text = ", ".join(f"{part} {times['median'] * 1e3:.1f}" for part, times in parts.items())
        typer.echo(f"{name}: {text} ms")
