"""How fast anyprobe renders beside Mitsuba 3 in the same run, at equal error.

    python benchmarks/render.py [--quick] [--data DIR] [--threads N]

benchmarks/README.md says how it is measured. Prints one JSON object a line, the summary last.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import warnings
from pathlib import Path
from typing import Any

import torch
from equal_error import Effort, compare
from measure import cpu_model
from sphere import ALPHAS, KINDS, SIZE

from anyprobe.errors import AnyprobeError, InputError


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a dry run of a few minutes; no figures to quote")
    parser.add_argument("--data", type=Path, help="folder with hdri/ and meshes/; without, assets of our own")
    parser.add_argument("--threads", type=int, default=2, help="of every renderer")
    parser.add_argument("--target", type=float, default=0.03, help="relative RMSE to reach")
    parser.add_argument("--alphas", type=float, nargs="+", default=list(ALPHAS), metavar="ALPHA")
    parser.add_argument("--kinds", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--size", type=int, default=SIZE, help="side of the sphere's picture")
    parser.add_argument("--eager", action="store_true", help="without torch.compile; no figures to quote")
    options = parser.parse_args(arguments)
    if options.threads < 1 or not 0 < options.target < 1:
        raise InputError(
            f"expected --threads of at least 1 and a --target between 0 and 1, "
            f"got {options.threads} and {options.target}"
        )
    return options


def summarise(cells: list[dict[str, Any]], options: argparse.Namespace) -> dict[str, Any]:
    """The last line; what was not measured is null."""
    speedups = [line["speedup"] for line in cells if line["speedup"] is not None]
    return {
        "part": "summary",
        "median_speedup": round(statistics.median(speedups), 2) if speedups else None,
        "min_speedup": min(speedups, default=None),
        "cells": len(cells),
        "cells_failed": len(cells) - len(speedups),
        "threads": options.threads,
        "cpu": cpu_model(),
        "quick": options.quick,
        "compiled": not options.eager,
    }


def main() -> None:
    """Print each cell as it comes, then the summary."""
    options = parse()
    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
    torch.set_num_threads(options.threads)
    cells = []
    for line in compare(
        options.data,
        kinds=options.kinds,
        alphas=options.alphas,
        target=options.target,
        size=options.size,
        threads=options.threads,
        compiled=not options.eager,
        effort=Effort.quick() if options.quick else Effort(),
    ):
        cells.append(line)
        print(json.dumps(line), flush=True)
    print(json.dumps(summarise(cells, options)), flush=True)


if __name__ == "__main__":
    try:
        main()
    except AnyprobeError as error:
        print(f"benchmarks/render.py: {error}", file=sys.stderr)
        sys.exit(2)
