"""Commands: train, ceilings, report; see README."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from research.paper_designs.ceilings import ceilings
from research.paper_designs.judge import TEST_PAIRS, Judge
from research.paper_designs.report import write_report
from research.paper_designs.scale import SCALES
from research.paper_designs.tables import Tables, build_tables, cached_tables, load_maps, load_shapes
from research.paper_designs.train import Run, train

PAIRS = (2_500, 25_000, 250_000, 2_500_000, 25_000_000)


def main() -> None:
    options = _options()
    torch.set_num_threads(options.threads)
    scale, limit, stop = SCALES[options.scale], None, None
    if options.dry_run:
        scale, limit, stop = replace(scale, batch=8, normals=256), 2, 3
    folder = options.runs / (options.scale + ("_dry" if options.dry_run else ""))

    def tables(split: str) -> Tables:
        def make() -> Tables:
            maps = load_maps(options.data / "hdri" / split, mirrored=split == "train", limit=limit)
            return build_tables(scale, maps, load_shapes(options.data / "meshes" / split, limit), options.device)

        return cached_tables(folder / f"tables_{split}.pt", make).to(options.device)

    if options.command == "report":
        return write_report(folder)
    seen, test = tables("train"), tables("test")
    print(f"{seen.count:,} training pairs", flush=True)
    pairs = 8 if options.dry_run else TEST_PAIRS
    if options.command == "ceilings":
        return ceilings(seen, test, folder / "ceilings.npz", pairs)
    judge = Judge(test, seen, pairs)
    for number in options.pairs:
        for seed in options.seeds:
            train(Run(pairs=number, seed=seed, scale=scale), seen, judge, folder, options.device, stop)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m research.paper_designs", description=__doc__)
    parser.add_argument("command", choices=("train", "ceilings", "report"))
    parser.add_argument("--data", type=Path, default=Path("data"), help="folder with hdri/ and meshes/")
    parser.add_argument("--runs", type=Path, default=Path("runs/paper_designs"))
    parser.add_argument("--scale", choices=tuple(SCALES), default="small")
    parser.add_argument("--pairs", type=int, nargs="+", default=PAIRS)
    parser.add_argument("--seeds", type=int, nargs="+", default=(0, 1))
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--dry-run", action="store_true", help="three steps, two maps, two shapes")
    return parser.parse_args()


if __name__ == "__main__":
    main()
