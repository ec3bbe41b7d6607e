"""python -m research.timing: each network of a model, and the whole call (paper, Sect. 5)."""

from __future__ import annotations

import platform
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import stages_of, weights_folder
from anyprobe.files.graphs import CPU, open_graph
from anyprobe.inputs.settings import DEFAULT_MODEL

WARM = 3
"""Calls that do not count."""


def time_model(model: str, photo: Path, threads: int, repeats: int, providers: Sequence[str] = CPU) -> dict[str, Any]:
    """Seconds of each network on one input, and of Estimator on a photo's path.

    Returns:
        {"networks": {stage: times}, "whole": times} with times "median" and "fastest" by the clock on the
        wall, and "processor", the median of processor time: what counts with one thread on a machine
        that does other things too.
    """
    estimator = Estimator(model, threads=threads, providers=providers)
    folder = weights_folder(model)
    networks = {
        stage: _seconds(_network(folder / f"{stage}.onnx", threads, providers), repeats) for stage in stages_of(folder)
    }
    return {"networks": networks, "whole": _seconds(lambda: estimator(photo), repeats)}


def machine_name() -> str:
    """The processor's name where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.is_file() else []
    named = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


def _network(path: Path, threads: int, providers: Sequence[str]) -> Callable[[], Any]:
    """One run of a graph on zeros of its inputs' shapes, batch of one."""
    session = open_graph(path, threads, providers)
    values = {
        given.name: np.zeros([side if isinstance(side, int) else 1 for side in given.shape], np.float32)
        for given in session.get_inputs()
    }
    return lambda: session.run(None, values)


def _seconds(call: Callable[[], Any], repeats: int) -> dict[str, float]:
    for _ in range(WARM):
        call()
    wall, processor = [], []
    for _ in range(repeats):
        start, used = time.perf_counter(), time.process_time()
        call()
        wall.append(time.perf_counter() - start)
        processor.append(time.process_time() - used)
    return {
        "median": round(statistics.median(wall), 6),
        "fastest": round(min(wall), 6),
        "processor": round(statistics.median(processor), 6),
    }


def timing(
    *,
    model: Annotated[list[str] | None, Parameter(help="Bundled model or folder; repeat for more.")] = None,
    providers: Annotated[str, Parameter(help="Execution providers of ONNX Runtime, between commas.")] = CPU[0],
    threads: Annotated[int, Parameter(help="Threads of the runtime."), bounded(1)] = 1,
    repeats: Annotated[int, Parameter(help="Calls, of which the median counts."), bounded(3)] = 50,
    photo: Annotated[Path, Parameter(help="A photo with an alpha channel.")] = Path("examples/vase.png"),
) -> None:
    """Print milliseconds of each network and of the whole call."""
    print(machine_name())
    for name in model or [DEFAULT_MODEL]:
        made = time_model(name, photo, threads, repeats, providers.split(","))
        parts = {**made["networks"], "whole call": made["whole"]}
        figures = ", ".join(f"{part} {1e3 * times['median']:.1f}" for part, times in parts.items())
        print(f"{Path(name).name}: {figures} ms")


if __name__ == "__main__":
    run_command(timing)
