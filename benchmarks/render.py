"""How fast anyprobe renders: beside Mitsuba 3 in the same run, and how it makes training pairs.

    python benchmarks/render.py [--quick] [--json] [--only PART] [--data DIR] [--device cuda]

benchmarks/README.md says how it is measured. --json prints one object a line, the summary last.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import torch
from equal_error import Effort, compare
from measure import cpu_model, in_fresh_process
from pairs import Setup, measure_memory, measure_speed
from report import Report
from sphere import ALPHAS, KINDS, SIZE

from anyprobe.errors import AnyprobeError, InputError

PARTS = ("equal-error", "pairs", "memory")


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of tables")
    parser.add_argument("--quick", action="store_true", help="a dry run of a few minutes; no figures to quote")
    parser.add_argument("--only", choices=PARTS, action="append", help="this part only; may be repeated")
    parser.add_argument("--data", type=Path, help="folder with hdri/ and meshes/; without, assets of our own")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="for pairs and memory")
    parser.add_argument("--threads", type=int, default=2, help="of every renderer")
    parser.add_argument("--target", type=float, default=0.03, help="relative RMSE to reach")
    parser.add_argument("--alphas", type=float, nargs="+", default=list(ALPHAS), metavar="ALPHA")
    parser.add_argument("--kinds", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--size", type=int, default=SIZE, help="side of the sphere's picture")
    parser.add_argument("--pairs", type=int, help="pairs of the memory part (100000; quick 2000)")
    parser.add_argument("--cache", type=Path, default=Path("runs/cache"), help="rasterised shapes are kept here")
    parser.add_argument("--eager", action="store_true", help="without torch.compile; no figures to quote")
    options = parser.parse_args(arguments)
    if options.threads < 1 or not 0 < options.target < 1:
        raise InputError(
            f"expected --threads of at least 1 and a --target between 0 and 1, "
            f"got {options.threads} and {options.target}"
        )
    return options


def lines(options: argparse.Namespace, device: str) -> Iterator[dict[str, Any]]:
    """Every result in turn."""
    parts = options.only or PARTS
    setup = Setup(
        data=options.data,
        device=device,
        compiled=not options.eager,
        quick=options.quick,
        cache=options.cache,
        cores=options.threads,
    )
    if "equal-error" in parts:
        effort = Effort.quick() if options.quick else Effort()
        yield from compare(
            options.data,
            kinds=options.kinds,
            alphas=options.alphas,
            target=options.target,
            size=options.size,
            threads=options.threads,
            compiled=not options.eager,
            effort=effort,
        )
    if "pairs" in parts:
        yield in_fresh_process(measure_speed, setup, 10.0 if options.quick else 60.0)
    if "memory" in parts:
        yield in_fresh_process(measure_memory, setup, options.pairs or (2000 if options.quick else 100_000))


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(statistics.median(known), 2) if known else None


def summarise(results: list[dict[str, Any]], options: argparse.Namespace, device: str) -> dict[str, Any]:
    """The last line; what was not measured is null."""
    cells = [line for line in results if line["part"] == "equal-error"]
    speedups, over_independent = (
        [line[name] for line in cells if line[name] is not None] for name in ("speedup", "speedup_over_independent")
    )
    by_part = {line["part"]: line for line in results}
    return {
        "part": "summary",
        "median_speedup": _median(speedups),
        "min_speedup": min(speedups, default=None),
        "cells": len(cells),
        "cells_failed": len(cells) - len(speedups),
        "median_speedup_over_independent": _median(over_independent),
        "min_speedup_over_independent": min(over_independent, default=None),
        "pairs_per_second": by_part.get("pairs", {}).get("pairs_per_second"),
        "pairs_speedup": by_part.get("pairs", {}).get("speedup"),
        "peak_memory_mb": by_part.get("memory", {}).get("peak_mb"),
        "memory_growth_mb_per_10000_pairs": by_part.get("memory", {}).get("growth_mb_per_10000_pairs"),
        "device": device,
        "threads": options.threads,
        "cpu": cpu_model(),
        "quick": options.quick,
        "compiled": not options.eager,
    }


def main() -> None:
    """Run the parts asked for and print as they come."""
    options = parse()
    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
    torch.set_num_threads(options.threads)
    gpu = torch.cuda.is_available()
    device = options.device if gpu else "cpu"
    report = Report(as_json=options.json)
    if not gpu:
        report.note({"device": "cpu", "gpu": "not available here; run with --device cuda"})
    results = []
    for line in lines(options, device):
        results.append(line)
        report.add(line)
    report.finish(summarise(results, options, device))


if __name__ == "__main__":
    try:
        main()
    except AnyprobeError as error:
        print(f"benchmarks/render.py: {error}", file=sys.stderr)
        sys.exit(2)
