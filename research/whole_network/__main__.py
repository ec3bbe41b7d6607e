"""python -m research.whole_network CHECKPOINT --data DATA --kept FOLDER: scores on path-traced whole photos.

The estimator's whole way, its network in floats instead of the graph that ships, with light sources
- where they were before: two discs at the likeliest places (mode) or spread over all (expected);
- of their profiles (nets.source_head), from the object alone, and with its context;
- the same, and the camera's pitch as the context says.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer

from anyprobe.estimate.context import context_picture
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import crop_object, load_photo
from anyprobe.nets.light_net import LightPrediction
from anyprobe.train.export_onnx import LightGraph
from anyprobe.train.loop import load_nets
from research.world.whole_photos import WholePhoto, whole_photos
from research.world.whole_scores import score, summary

ROWS = ("mode", "expected", "sources", "expected, context", "sources, context", "sources, context, pitch")
SHOWN = (
    "ldr_rmse ldr_rmse_error gain_rmse ssim dominant_deg dominant_deg_error dominant_deg_harder "
    "dominant_deg_harder_error power_abs white vase vase_error hardness_correlation hardness_soft true_hardness_soft "
    "hardness_middle true_hardness_middle hardness_hard true_hardness_hard hardness_below_08"
)


class InTorch:
    """Stands in for the graph `light` of an estimator."""

    def __init__(self, nets: torch.nn.ModuleDict) -> None:
        self.nets, self.row, self.code = nets, ROWS[0], None
        self._posterior = LightGraph(nets["light"])

    def __call__(self, *values: np.ndarray) -> list[np.ndarray]:
        """Of the graph's inputs its outputs, the map of `row` in the place of that with light sources."""
        light = self.nets["light"]
        with torch.no_grad():
            guess = light(*(torch.from_numpy(one) for one in values), self.code if "context" in self.row else None)
            outputs = list(self._posterior.outputs(guess))
            outputs[1] = self._map(guess)
        return [one.numpy() for one in outputs]

    def _map(self, guess: LightPrediction) -> torch.Tensor:
        if self.row == "mode":
            shown = torch.exp(guess.ln_shown.clamp(max=0.0))
            return torch.log(shown + self.nets["light"].emitters.mode(guess.ln_power, guess.emitter_logit))
        return guess.ln_expected if self.row.startswith("expected") else guess.ln_radiance


def rows_of(estimator: Estimator, torched: InTorch, one: WholePhoto) -> tuple[dict[str, np.ndarray], float]:
    """Maps [64, 128, 3] in the photo's camera, and the pitch in degrees that the context says."""
    fov = one.long_fov_deg if one.fov_known else None
    photo = load_photo(one.picture, mask=one.mask, fov_deg=fov)
    crop = crop_object(photo)
    with torch.no_grad():
        picture = torch.from_numpy(context_picture(photo, crop).transpose(2, 0, 1)[None].copy())
        torched.code, posture = torched.nets["context"](picture, torch.full((1, 1), crop.tan_half))
    pitch, _, roll, _ = posture[0].tolist()
    up = crop.camera_from_crop @ [np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll), np.sin(pitch)]
    pitch_deg = float(np.degrees(np.arcsin(up[2])))
    maps = {}
    for row in ROWS:
        if one.cut_out and "context" in row:
            continue
        torched.row = row
        given = {"pitch_deg": float(np.clip(pitch_deg, -50, 85))} if "pitch" in row else {}
        maps[row] = estimator(one.picture, mask=one.mask, fov_deg=fov, **given).radiance
    return maps, pitch_deg


def tell(rows: dict[str, dict[str, list]], say: Callable[[str], None] = typer.echo) -> None:
    """A line for each kind of photo and row."""
    for kind, methods in rows.items():
        for name, scores in methods.items():
            pitch = [one.pop("pitch_error") for one in scores if "pitch_error" in one]
            if pitch:
                say(f"{kind}, {name}: pitch {np.median(pitch):.2f} degrees off in the median")
            found = summary(scores)
            say(
                f"{kind} ({len(scores)}), {name}: "
                + " ".join(f"{k}={found[k]:.3f}" for k in SHOWN.split() if k in found)
            )


def main(
    checkpoint: Annotated[Path, typer.Argument(help="Of a run of heads or whole.")],
    data: Annotated[Path, typer.Option(help="Folder with hdri and meshes.")],
    kept: Annotated[Path, typer.Option(help="Folder of the renders of research.world.whole.")],
    part: Annotated[str, typer.Option(help="left-out to choose by, test to report.")] = "left-out",
    count: Annotated[int, typer.Option(help="Photos.")] = 100,
) -> None:
    """Print scores on whole photos, cut-outs apart."""
    torched, estimator = InTorch(load_nets(checkpoint)), Estimator()
    estimator.models._run["light"] = torched
    rows: dict[str, dict[str, list]] = {"whole": defaultdict(list), "cut-out": defaultdict(list)}
    for number, one in enumerate(whole_photos(data, part, kept)):
        if number >= count:
            break
        maps, pitch_deg = rows_of(estimator, torched, one)
        for name, figures in score(one, maps).items():
            said = figures if one.cut_out else figures | {"pitch_error": abs(pitch_deg - one.pitch_deg)}
            rows["cut-out" if one.cut_out else "whole"][name].append(said)
    tell(rows)


if __name__ == "__main__":
    typer.run(main)
