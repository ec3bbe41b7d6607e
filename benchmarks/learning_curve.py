"""What more pairs taught the model that ships: every `lift` of the repository's history on pairs none learned from.

    python benchmarks/learning_curve.py --data DATA                                    # those of SHIPPED
    python benchmarks/learning_curve.py --data DATA 66acab8:1002240+659200 runs/new:1200000    # a revision, a folder

Prints one JSON object a line. A revision or folder is followed by the pairs that its weights learned from since the
first run, and by those that its normals alone had besides. A graph is given the inputs that it has, and told nothing.
The pairs are those of `left_out_pairs`, clean photos. Read with care: networks, losses, photos and shapes changed on
the way as well, and what was chosen from 17b4b13 on was chosen on pairs of the same assets.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnxruntime

from anyprobe.dataset.pair import Pair
from anyprobe.errors import AnyprobeError, InputError, ModelError
from anyprobe.evaluate.calibrate import left_out_pairs
from anyprobe.evaluate.metrics import rmse
from anyprobe.evaluate.protocol import Scores, score
from anyprobe.files.graphs import open_graph
from anyprobe.infer.runtime import lift_inputs
from anyprobe.light.reconstruct import LN_MAX

ROOT = Path(__file__).parents[1]
GRAPH = "src/anyprobe/weights/lift/light.onnx"
SHIPPED = (
    "d725dc2:204800",
    "eaabfb3:364800",
    "086d374:540800",
    "4a30337:636800",
    "6613474:707200+192000",
    "17b4b13:823040+448000",
    "66acab8:1002240+659200",
)
"""Each time other weights shipped. Pairs are those of the model card, which often came a commit later."""
SHOWN = (
    "ldr_rmse",
    "ldr_ssim",
    "ln_hdr_rmse",
    "angle_diffuse_deg",
    "main_light_deg",
    "main_light_median_deg",
    "flux_stops",
    "flux_median_stops",
)
"""Of the figures of anyprobe.evaluate.protocol; angle_diffuse_deg is the white ball's colour."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Learned:
    """A graph, by its folder or revision, and the pairs that it learned from: all of it, and its normals alone."""

    place: str
    pairs: int
    pairs_of_normals: int = 0


def read_learned(text: str) -> Learned:
    """PLACE:PAIRS or PLACE:PAIRS+PAIRS_OF_NORMALS."""
    place, _, counts = text.rpartition(":")
    pairs, _, normals = counts.partition("+")
    if not (place and pairs.isdecimal() and (normals.isdecimal() or "+" not in counts)):
        raise InputError(f"{text}: expected a folder or revision and its pairs, as in 66acab8:1002240+659200")
    return Learned(place=place, pairs=int(pairs), pairs_of_normals=int(normals or 0))


def find_graph(place: str, folder: Path, root: Path = ROOT) -> Path:
    """The graph of a folder, or of a revision of root's repository, written into `folder`; ModelError if none."""
    if (Path(place) / "light.onnx").is_file():
        return Path(place) / "light.onnx"
    told = subprocess.run(
        ["git", "-C", str(root), "show", "--end-of-options", f"{place}:{GRAPH}"], capture_output=True
    )
    if told.returncode:
        why = told.stderr.decode(errors="replace").strip()
        raise ModelError(f"{place}: expected a folder with light.onnx or a revision with {GRAPH}, got: {why}")
    path = folder / "light.onnx"
    path.write_bytes(told.stdout)
    return path


def answer(session: onnxruntime.InferenceSession, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Radiance [64, 128, 3] and irradiance [128, 128, 3] display of a graph that need not be of this version.

    Raises:
        ModelError: it asks for what nobody here knows, does not say these two, or fails.
    """
    given = lift_inputs(pair.crop, pair.tan_half)
    names = [one.name for one in session.get_inputs()]
    if unknown := [name for name in names if name not in given]:
        raise ModelError(f"expected inputs among {', '.join(given)}, got {', '.join(unknown)}")
    try:
        ln_radiance, irradiance = session.run(
            ["ln_radiance", "irradiance"], {name: given[name] for name in names}
        )
    except Exception as error:  # the runtime has no common base class for its errors
        raise ModelError(f"expected ln_radiance and irradiance, got: {error}") from error
    radiance = np.exp(np.minimum(ln_radiance[0], LN_MAX))
    return radiance.transpose(1, 2, 0), irradiance[0].transpose(1, 2, 0).clip(0.0, 1.0)


def measure(learned: Learned, pairs: list[Pair], root: Path = ROOT) -> dict:
    """One line: the graph, what it learned from, and its figures on pairs, or why there are none."""
    line = {"graph": learned.place, "pairs": learned.pairs, "pairs_of_normals": learned.pairs_of_normals}
    try:
        with TemporaryDirectory() as folder:
            session = open_graph(find_graph(learned.place, Path(folder), root))
        answers = [answer(session, pair) for pair in pairs]
    except AnyprobeError as error:
        return line | {"not_run": str(error)}
    rows = [score(radiance, pair.radiance) for (radiance, _), pair in zip(answers, pairs, strict=True)]
    means = Scores(rows={"lift": rows}, groups=[{"all"} for _ in rows]).table()["lift"]["all"]
    irradiance = [
        rmse(shown, pair.irradiance / 255.0) for (_, shown), pair in zip(answers, pairs, strict=True)
    ]
    return (
        line
        | {"scored_on": len(pairs)}
        | {name: means[name] for name in SHOWN}
        | {"irradiance_rmse": round(float(np.mean(irradiance)), 5)}
    )


def main() -> None:
    """Print a line for each graph."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("graphs", nargs="*", default=SHIPPED, help="PLACE:PAIRS[+PAIRS_OF_NORMALS]")
    arguments.add_argument("--data", type=Path, required=True, help="as docs/training.md has it")
    arguments.add_argument("--pairs", type=int, help="score on the first N only")
    options = arguments.parse_args()
    graphs = [read_learned(text) for text in options.graphs]
    pairs = list(islice(left_out_pairs(options.data), options.pairs))
    for learned in graphs:
        print(json.dumps(measure(learned, pairs)), flush=True)


if __name__ == "__main__":
    main()
