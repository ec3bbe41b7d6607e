"""What `anyprobe relight` takes for a photo of 36 megapixels, beside reading and writing it, or another version.

    python benchmarks/large_photo.py
    python benchmarks/large_photo.py --other PATH/src      # of an older clone, by turns in the same run

Seconds of whole commands, the least of --times runs: of the processor (user and system), so that other programs hardly
tell, and on the clock.
The photo is examples/table.png enlarged, its mask given.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np
from PIL import Image

ROOT = Path(__file__).parent.parent
SIZE = (7360, 4912)
RELIGHT = "from anyprobe.cli.app import main; main()"
COPY = """
import sys
from anyprobe.pictures.images import read_image, write_png
write_png(sys.argv[2], read_image(sys.argv[1]).rgb)
"""


def make_photo(folder: Path) -> list[str]:
    """A large photo and its mask in a folder; the arguments that name them."""
    with Image.open(ROOT / "examples" / "table.png") as small:
        photo, mask = small.convert("RGB").resize(SIZE), Image.new("L", small.size)
        width, height = small.size
    # where the vase stands; the cost does not depend on its outline
    mask.paste(255, (int(0.38 * width), int(0.3 * height), int(0.52 * width), int(0.75 * height)))
    photo.save(folder / "photo.jpg", quality=92)
    mask.resize(SIZE).save(folder / "mask.png")
    return [str(folder / "photo.jpg"), "--mask", str(folder / "mask.png")]


def seconds(source: Path, code: str, arguments: list[str]) -> np.ndarray:
    """Of Python code of a source tree: processor time, and time on the clock."""
    before, start = getrusage(RUSAGE_CHILDREN), time.perf_counter()
    environment = {**os.environ, "PYTHONPATH": str(source)}
    subprocess.run([sys.executable, "-c", code, *arguments], env=environment, check=True, capture_output=True)
    after = getrusage(RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return np.array([processor, time.perf_counter() - start])


def main() -> None:
    """Time everything by turns; one JSON object of pairs: processor, clock."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--other", type=Path, help="src folder of another version")
    parser.add_argument("--renderer", default="own")
    parser.add_argument("--times", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        photo = make_photo(Path(name))
        out = str(Path(name) / "out.png")
        relight = ["relight", *photo, "-q", "--renderer", given.renderer, "-o", out]
        runs = {"read and write": (ROOT / "src", COPY, [photo[0], out]), "relight": (ROOT / "src", RELIGHT, relight)}
        if given.other:
            runs["relight, other"] = (given.other, RELIGHT, relight)
        found = {which: np.full(2, np.inf) for which in runs}
        for _ in range(given.times):
            for which, run in runs.items():
                found[which] = np.minimum(found[which], seconds(*run))
    ratios = {f"over {which}": found["relight"] / s for which, s in found.items() if which != "relight"}
    print(json.dumps({key: [round(float(one), 2) for one in both] for key, both in (found | ratios).items()}))


if __name__ == "__main__":
    main()
