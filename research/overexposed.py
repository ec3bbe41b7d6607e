"""python -m research.overexposed DATA --kept DIR: what clipping costs the direction of the dominant light.

Left-out pairs as they are and 1 to 4 stops brighter, by the share of the object that is clipped in all channels; it
sets contract.json's clipped_share.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import track

from anyprobe.cli.app import main as run_command
from anyprobe.core.contract import contract
from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.runtime import DEFAULT_MODEL, Models
from anyprobe.learning.dataset.pair import Pair
from anyprobe.learning.evaluate.methods import model_methods
from anyprobe.learning.evaluate.metrics import direction_error_deg
from anyprobe.learning.evaluate.standard_errors import clustered_error
from anyprobe.light.dominant_light import find_dominant_light
from research.left_out import left_out_pairs

STOPS = (0, 1, 2, 3, 4)
SHARES = (0.0, 0.02, 0.1, 0.2, 0.4, 0.6, 0.85, 1.01)
CLIPPED: float = contract("exposure")["doubt"]["clipped"]


def brighter(pair: Pair, stops: int) -> Pair:
    """The pair with its photo exposed longer, through the mean camera curve."""
    rgb = pair.photo[..., :3] / np.float32(255)
    shown = response(inverse_response(np.minimum(rgb, 0.995)) * np.float32(2.0**stops))
    return replace(pair, photo=np.concatenate([(255 * shown).round().astype(np.uint8), pair.photo[..., 3:]], axis=-1))


def main(data: Path, kept: Annotated[Path | None, typer.Option(help="Folder of rendered pairs.")] = None) -> None:
    """Print the table."""
    method = next(iter(model_methods(Models(DEFAULT_MODEL, threads=1), DEFAULT_MODEL).values()))
    pairs = list(left_out_pairs(data, kept))
    found = []
    for pair in track(pairs):
        true, usual = find_dominant_light(pair.radiance).direction, 0.0
        for stops in STOPS:
            one = brighter(pair, stops)
            share = float((one.photo[one.photo[..., 3] > 127][:, :3].min(axis=-1) >= 255 * CLIPPED).mean())
            error = direction_error_deg(find_dominant_light(method(one).radiance).direction, true)
            usual = usual if stops else error
            found.append((share, error, error - usual, pair.map_name, pair.shape_name))
    print("| clipped | photos | dominant light, degrees | more than as it was |\n|---|---|---|---|")
    for low, high in zip(SHARES[:-1], SHARES[1:], strict=True):
        rows = [row for row in found if low <= row[0] < high]
        maps, shapes = ([row[k] for row in rows] for k in (3, 4))
        cells = [
            f"{np.mean(values):.1f} +- {clustered_error(values, maps, shapes):.1f}"
            for values in ([row[k] for row in rows] for k in (1, 2))
        ]
        print(f"| {low:.0%} to {min(high, 1):.0%} | {len(rows)} | {' | '.join(cells)} |")


if __name__ == "__main__":
    run_command(lambda: typer.run(main))
