"""How long the object of one photo takes to find without a prompt.

    taskset -c 0,1 python benchmarks/mask_seconds.py [--photos PHOTOS] [--times 5]

Photos are examples/vase.png and table.png without their alpha, or those of a folder. Prints one JSON object: cores, the
seconds of opening the network, and of each photo's best time the median and the most; and the median of processor
seconds, of all threads together, which other programs on the machine hardly change.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np

from anyprobe.masks.find import find_mask
from anyprobe.masks.networks import shared_network
from anyprobe.pictures.images import read_image

EXAMPLES = [Path(__file__).parent.parent / "examples" / f"{name}.png" for name in ("vase", "table")]


def seconds(rgb: np.ndarray) -> tuple[float, float]:
    """Of finding the object of a photo [H, W, 3] that is in memory: on the clock, and of the processor."""
    pixels = read_image(rgb)
    start, used = time.perf_counter(), time.process_time()
    find_mask(pixels)
    return time.perf_counter() - start, time.process_time() - used


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=Path, help="folder of photos")
    parser.add_argument("--times", type=int, default=5)
    asked = parser.parse_args()
    paths = EXAMPLES
    if asked.photos is not None:
        names = sorted(path for path in asked.photos.iterdir() if path.suffix in (".png", ".jpg"))
        paths = [path for path in names if not path.stem.endswith("_mask")]
    start = time.perf_counter()
    network = shared_network()
    opening = time.perf_counter() - start
    taken = [[seconds(read_image(path).rgb) for _ in range(asked.times)] for path in paths]
    best, used = np.min(taken, axis=1).T
    print(
        json.dumps(
            {
                "network": network.name,
                "cores": len(os.sched_getaffinity(0)),
                "open_s": round(opening, 2),
                "median_s": round(float(np.median(best)), 2),
                "most_s": round(float(best.max()), 2),
                "processor_s": round(float(np.median(used)), 2),
                "photos": len(best),
            }
        )
    )


if __name__ == "__main__":
    main()
