"""How well the live page finds objects in still photos, beside the command line: IoU with true masks.

    PYTHONPATH=. python benchmarks/page_masks.py --data DATA --scenes 12 --photos PHOTOS [--photos MORE] [--live]

The scenes and photos are those of `python -m research.masks` with the same options. The page's code runs in Node
with its own runtime, one thread. Needs what that command needs, Node.js and the packages of web/
(cd web && npm ci).
Prints one JSON object a set and a telling:

page, command_line  mean and median IoU with the true mask, and how many are 0.8 at least, and under 0.5
agreement           mean IoU of the page's masks with the command line's
ms                  processor time of the page a photo, median and most

With --live only the page's, as in a camera's frame.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from anyprobe_train.dataset.asset_store import load_asset_store
from research.masks.cases import Case, iou, photo_cases
from research.masks.scenes import rendered_cases
from research.masks.scoring import PROMPTS, score

ROOT = Path(__file__).parents[1]


def compare(cases: list[Case], given: str, live: bool) -> dict:
    """The page and the command line without a prompt, by a click or by a box."""
    from support.page_masks import page_masks

    clicks = [[case.click] if given == "click" else [] for case in cases]
    boxes = [case.box if given == "box" else None for case in cases]
    with tempfile.TemporaryDirectory() as folder:
        answers = page_masks(Path(folder), [case.rgb for case in cases], clicks, boxes, live=live)
    pages = [answer.mask for answer in answers]
    found = {"page": scores(pages, cases), "ms": middle_and_most([answer.ms for answer in answers])}
    if live:
        return found
    ours = [score(case, given, "anyprobe", None).mask for case in cases]
    ours = [np.zeros_like(page) if mask is None else mask for mask, page in zip(ours, pages, strict=True)]
    return found | {
        "command_line": scores(ours, cases),
        "agreement": round(float(np.mean([iou(a, b) for a, b in zip(pages, ours, strict=True)])), 3),
    }


def scores(masks: list[np.ndarray], cases: list[Case]) -> dict:
    values = np.array([iou(mask, case.mask) for mask, case in zip(masks, cases, strict=True)])
    return {
        "mean": round(float(values.mean()), 3),
        "median": round(float(np.median(values)), 3),
        "at_least_0.8": f"{(values >= 0.8).sum()} of {len(values)}",
        "under_0.5": f"{(values < 0.5).sum()} of {len(values)}",
    }


def middle_and_most(values: list[float]) -> list[int]:
    return [round(float(np.median(values))), round(max(values))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder with hdri/test and meshes/test to render scenes of")
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument(
        "--photos", type=Path, action="append", help="folder of photos NAME.* with NAME_mask.png beside them"
    )
    parser.add_argument("--live", action="store_true", help="as in a camera's frame")
    parser.add_argument("--seed", type=int, default=2020)
    asked = parser.parse_args()
    if asked.data is None and asked.photos is None:
        parser.error("expected --data DIR, --photos DIR or both, got neither")
    sys.path.insert(0, str(ROOT / "tests"))
    sets = {}
    if asked.data is not None:
        store = load_asset_store(asked.data, "test", commercial_only=False)
        sets["scenes"] = list(rendered_cases(store, asked.scenes, asked.seed))
    if asked.photos is not None:
        sets["photos"] = [case for folder in asked.photos for case in photo_cases(folder)]
    for name, cases in sets.items():
        for given in PROMPTS:
            print(json.dumps({"set": name, "given": given, **compare(cases, given, asked.live)}), flush=True)


if __name__ == "__main__":
    main()
