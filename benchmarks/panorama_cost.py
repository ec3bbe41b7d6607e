"""What the panorama adds to an estimate, in processor time: python benchmarks/panorama_cost.py [PHOTO ...] [--size 512]

Prints one JSON object: median seconds of processor time a photo for the estimate alone (photo, mask and light), and for
its panorama with both files, which other programs on the machine hardly change; and their ratio. PHOTO_mask.png beside
a photo is its mask; without photos the examples are taken.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from pathlib import Path

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", nargs="*", type=Path, default=[EXAMPLES / "table.png", EXAMPLES / "vase.png"])
    parser.add_argument("--size", type=int, default=512, help="rows of the panorama")
    given = parser.parse_args()
    estimator = Estimator(threads=1)
    alone, added = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number, path in enumerate([given.photos[0], *given.photos]):
            mask = path.with_name(f"{path.stem}_mask.png")
            start = time.process_time()
            light = estimator.from_photo(load_photo(path, mask=mask if mask.is_file() else None))
            middle = time.process_time()
            picture = light.panorama(given.size)
            picture.save(Path(folder) / "place.exr")
            picture.save_origin(Path(folder) / "origin.png")
            if number:  # the first opens networks
                alone.append(middle - start)
                added.append(time.process_time() - middle)
    estimate, panorama = statistics.median(alone), statistics.median(added)
    found = {"photos": len(added), "estimate_s": round(estimate, 2), "panorama_s": round(panorama, 2)}
    print(json.dumps(found | {"most_s": round(max(added), 2), "times_estimate": round(panorama / estimate, 2)}))


if __name__ == "__main__":
    main()
