"""python -m research.whole_network CHECKPOINT --data DATA --kept FOLDER: scores on path-traced whole photos."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer

from anyprobe.estimate.context import context_picture
from anyprobe.estimate.photo import Crop, Photo, crop_object, load_photo
from anyprobe.estimate.runtime import lift_inputs
from anyprobe.light.environment import rotate
from anyprobe.train.loop import load_nets
from research.world.whole_photos import WholePhoto, whole_photos
from research.world.whole_scores import score, summary

SHOWN = (
    "ldr_rmse ldr_rmse_error ssim dominant_deg dominant_deg_error dominant_deg_harder white chrome vase vase_error "
    "hardness_correlation hardness_soft true_hardness_soft hardness_hard true_hardness_hard hardness_below_08 "
    "pitch_error pitch_error_error"
)


@torch.no_grad()
def maps_of(nets: torch.nn.ModuleDict, photo: Photo, crop: Crop, surroundings: bool) -> dict[str, np.ndarray]:
    """Maps [64, 128, 3] in the photo's camera: light sources at two places as before, spread, as sources from the
    object alone and with its context; and the pitch in degrees."""
    seen = crop.surroundings_map if surroundings else None
    given = lift_inputs(crop.image, crop.tan_half, crop.normals, seen)
    values = [torch.from_numpy(one) for one in list(given.values())[:5]]
    context = torch.from_numpy(context_picture(photo, crop).transpose(2, 0, 1)[None].copy())
    code, posture = nets["context"](context, values[1])
    light = nets["light"]
    none, whole = light(*values), light(*values, code)
    shown = torch.exp(none.ln_shown.clamp(max=0.0))
    before = torch.log(shown + light.emitters.mode(none.ln_power, none.emitter_logit))
    made = {
        "two places": before,
        "spread": none.ln_expected,
        "sources": none.ln_radiance,
        "spread, context": whole.ln_expected,
        "sources, context": whole.ln_radiance,
    }

    def turned(ln: torch.Tensor) -> np.ndarray:
        return np.maximum(rotate(np.exp(ln[0].numpy().transpose(1, 2, 0)), crop.camera_from_crop), 0.0)

    pitch, roll = float(posture[0, 0]), float(posture[0, 2])
    up = np.array([np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll), np.sin(pitch)])
    return {name: turned(ln) for name, ln in made.items()} | {
        "pitch": np.degrees(np.arcsin((crop.camera_from_crop @ up)[2]))
    }


def open_photo(one: WholePhoto, surroundings: bool) -> tuple[Photo, Crop]:
    """As the estimator cuts it, with its true mask."""
    fov = one.long_fov_deg if one.fov_known else None
    photo = load_photo(one.picture, mask=one.mask, fov_deg=fov, surroundings="photo" if surroundings else None)
    return photo, crop_object(photo)


def main(
    checkpoint: Annotated[Path, typer.Argument(help="Of a run of heads or whole.")],
    data: Annotated[Path, typer.Option(help="Folder with hdri and meshes.")],
    kept: Annotated[Path, typer.Option(help="Folder of the renders of research.world.whole.")],
    part: Annotated[str, typer.Option(help="left-out to choose by, test to report.")] = "left-out",
    surroundings: Annotated[bool, typer.Option(help="With what the photo shows beside the object.")] = False,
    count: Annotated[int, typer.Option(help="Photos.")] = 100,
) -> None:
    """Print a table of scores, cut-outs apart."""
    nets = load_nets(checkpoint)
    rows: dict[str, dict[str, list]] = {"whole": defaultdict(list), "cut-out": defaultdict(list)}
    for number, one in enumerate(whole_photos(data, part, kept)):
        if number >= count:
            break
        photo, crop = open_photo(one, surroundings and not one.cut_out)
        maps = maps_of(nets, photo, crop, surroundings)
        pitch = maps.pop("pitch")
        if one.cut_out:
            maps = {name: found for name, found in maps.items() if "context" not in name}
        for name, figures in score(one, maps).items():
            rows["cut-out" if one.cut_out else "whole"][name].append(
                figures | {"pitch_error": abs(pitch - one.pitch_deg)}
            )
    for kind, methods in rows.items():
        for name, scores in methods.items():
            found = summary(scores)
            said = " ".join(f"{key}={found[key]:.3f}" for key in SHOWN.split() if key in found)
            typer.echo(f"{kind} ({len(scores)}), {name}: {said}")


if __name__ == "__main__":
    typer.run(main)
