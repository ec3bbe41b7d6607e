"""The weights of `paper` that ship: the mean of a run and what it began from, as bright as the left-out pairs are.

    python -m research.export_weights.paper FOLDER --data DATA --start START --share .2
    anyprobe-train export GRAPHS paper_on --runs FOLDER

The HDR net's answer for white is raised by the ln radiance with which the power of the maps of pairs that no weights
learn from is nearest to the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import luminance
from anyprobe.light.environment import integral
from anyprobe.paper.equations import blend_weight, reconstruct
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.train.checkpoint import read_checkpoint
from anyprobe_train.train.config import paper_on
from anyprobe_train.train.logger import run_folder
from anyprobe_train.train.loop import load_nets
from research.export_weights.checkpoints import mean_checkpoint
from research.left_out import left_out_pairs

STEPS = np.arange(0.0, 1.0, 0.05)
"""ln radiance."""


def power_off(nets: torch.nn.ModuleDict, pairs: Sequence[Pair]) -> np.ndarray:
    """Mean distance of the maps' power from the truth [stops], for each of STEPS."""
    rows = []
    for pair in pairs:
        shown = torch.from_numpy(pair.photo.astype(np.float32) / 255)
        image = torch.cat([shown[..., :3] * shown[..., 3:], shown[..., 3:]], dim=-1).permute(2, 0, 1)[None]
        tan_half = torch.full((1, 1), float(pair.tan_half))
        with torch.no_grad():
            seen = nets["irradiance"](image, tan_half).clip(0, 1)
            ldr = nets["illumination"](torch.cat([seen, image[:, 3:]], dim=1), tan_half)
            ldr, ln = (one[0].permute(1, 2, 0).numpy() for one in (ldr, nets["hdr"](ldr)))
        weight = blend_weight(ldr) ** 2  # as HdrNet weights what its layers say
        maps = [reconstruct(ldr, ln + step * weight) for step in STEPS]
        power, *found = (float(luminance(integral(one.astype(np.float64)))) for one in (pair.radiance, *maps))
        rows.append(np.abs(np.log2(np.array(found) / power)))
    return np.mean(rows, axis=0)


def main(
    to: Annotated[Path, typer.Argument(metavar="FOLDER", help="Another folder of runs.")],
    data: Annotated[Path, typer.Option(help="Folder with assets that no weights learn from.")],
    start: Annotated[Path, typer.Option(help="Kept weights that the run began from.")],
    share: Annotated[float, typer.Option(min=0, max=1, help="Of these in the mean.")] = 0.5,
    runs: Annotated[Path, typer.Option(help="Folder of the trained runs.")] = Path("runs"),
    kept: Annotated[Path | None, typer.Option(help="Folder of rendered pairs.")] = None,
) -> None:
    """Write FOLDER/paper_on/checkpoint.pt."""
    name = paper_on().name
    path = run_folder(to, name) / "checkpoint.pt"
    mean_checkpoint(runs / name / "checkpoint.pt", start, path, share)
    off = power_off(load_nets(path), list(left_out_pairs(data, kept)))
    best, stored = int(off.argmin()), read_checkpoint(path)
    stored["nets"]["hdr.head.bias"] += float(STEPS[best])
    torch.save(stored, path)
    typer.echo(f"{path}: ln {STEPS[best]:.2f} brighter where white, power {off[best]:.3f} stops off ({off[0]:.3f})")


if __name__ == "__main__":
    run_command(lambda: typer.run(main))
