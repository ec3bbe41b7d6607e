"""python -m research.world.cut_outs: a model on the world test set's cut-outs, by the figures of whole photos.

Those that a folder lacks are rendered, see research.world.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.progress import track

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.estimate.runtime import Models, model_id
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.methods import mean_map, run_with_hints
from research.results import commit, write_result
from research.world.judgement import CUT_OUTS, Judgement, print_groups
from research.world.pairs import COUNT, PARTS, world_pairs
from research.world.whole_rows import SHIPPED
from research.world.whole_scores import score


@dataclass(frozen=True, kw_only=True, slots=True)
class CutOut:
    """A pair as whole photos are judged: its truth, and how its camera stands; see whole_scores.Judged."""

    truth: np.ndarray
    pitch_deg: float
    roll_deg: float

    @classmethod
    def of(cls, pair: Pair) -> CutOut:
        """Return the pair's; its camera never rolls."""
        up = pair.map_from_camera.T @ [0.0, 1.0, 0.0]
        return cls(truth=pair.radiance, pitch_deg=float(np.degrees(np.arctan2(up[2], up[1]))), roll_deg=0.0)


def cut_outs(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri and meshes.")],
    kept: Annotated[Path, Parameter(help="Folder for the pairs.")],
    part: Annotated[str, Parameter(help=f"One of {', '.join(PARTS)}.")] = "test",
    model: Annotated[str, Parameter(help="Bundled model or folder.")] = DEFAULT_MODEL,
    count: Annotated[int, Parameter(help="The first so many pairs."), bounded(3)] = COUNT,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), help="File to write.")] = None,
) -> None:
    """Print the figures of the model and of the mean map, with standard errors by map."""
    models, judged = Models(model, threads=1), Judgement()
    for _, pair in zip(track(range(count), "scoring"), world_pairs(data, part, kept), strict=False):
        rows = {"mean map": mean_map()}
        rows[SHIPPED] = run_with_hints(models, pair).radiance
        judged.add([CUT_OUTS], pair.map_name, score(CutOut.of(pair), rows))
    groups = judged.table()
    print_groups(groups, part)
    content = {"commit": commit(), "model": model_id(model), "groups": groups}
    write_result(out or Path(f"runs/cut-outs-{part}.json"), content)


if __name__ == "__main__":
    run_command(cut_outs)
