"""Training by one process and by two together: pairs a second of each, and their ratio.

    python benchmarks/scaling_processes.py            # one JSON object a line, the ratio last
    python benchmarks/scaling_processes.py --quick    # a dry run; its figures are not for quoting

Each is `anyprobe-train run` on maps and shapes of our own, every process with one thread, so that one process has one
core and two have two. The speed is that of log.csv without its first row, in which kernels are compiled and the
first lit materials are made.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from measure import cpu_model

from anyprobe_train.train.config import RUNS
from anyprobe_train.train.logger import LOG_STEPS

ANYPROBE = Path(sys.executable).with_name("anyprobe-train")
TORCHRUN = (sys.executable, "-m", "torch.distributed.run", "--standalone")
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}


def main() -> None:
    """Print a line for each number of processes, and one for their ratio."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--run", default="normals", choices=RUNS)
    arguments.add_argument("--steps", type=int, default=8 * LOG_STEPS)
    arguments.add_argument("--processes", type=int, default=2)
    arguments.add_argument("--quick", action="store_true")
    options = arguments.parse_args()
    steps = 2 * LOG_STEPS if options.quick else options.steps
    if steps < 2 * LOG_STEPS:
        arguments.error(f"--steps {steps}: expected at least {2 * LOG_STEPS}, of which the last count")
    asked = [options.run, "--dry-run" if options.quick else "--steps", str(steps)]
    speeds = {}
    with TemporaryDirectory() as folder:
        for count in (1, options.processes):
            speeds[count] = measure(asked, Path(folder), count)
            print(json.dumps({"processes": count, "pairs_per_second": round(speeds[count], 2)}), flush=True)
    summary = {
        "run": " ".join(asked),
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "ratio": round(speeds[options.processes] / speeds[1], 3),
    }
    print(json.dumps(summary))


def measure(asked: list[str], folder: Path, count: int) -> float:
    """Pairs a second of so many processes that train together; what shapes look like is drawn once for all."""
    runs = folder / f"by_{count}"
    runs.mkdir()
    (folder / "cache").mkdir(exist_ok=True)
    (runs / "cache").symlink_to(folder / "cache")
    command = [str(ANYPROBE), "run", *asked, "--runs", str(runs)]
    if count > 1:
        command = [*TORCHRUN, "--nproc-per-node", str(count), "--no-python", "--", *command]
    subprocess.run(command, env={**os.environ, **ONE_THREAD}, stdout=subprocess.DEVNULL, check=True)
    (log,) = runs.glob("*/log.csv")
    return speed_of(log)


def speed_of(log: Path) -> float:
    """Pairs a second over all rows of a run's log but the first."""
    with log.open(newline="", encoding="utf-8") as stream:
        rows = [(int(row["pairs"]), float(row["pairs_per_second"])) for row in csv.DictReader(stream)]
    seen = [after - before for (before, _), (after, _) in zip(rows, rows[1:], strict=False)]
    return sum(seen) / sum(pairs / speed for pairs, (_, speed) in zip(seen, rows[1:], strict=True))


if __name__ == "__main__":
    main()
