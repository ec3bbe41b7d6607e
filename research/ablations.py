"""python -m research.ablations: short runs that each change one thing of `lift_trial`, and what each is worth.

All see 19,200 pairs; they are scored on pairs of training assets that no run learns from. Ablations that
ended, with their results, are in research/README.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from cyclopts import Parameter
from rich.progress import track

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.methods import Estimate, Method
from anyprobe_train.evaluate.scoring import score_pairs
from anyprobe_train.nets.light_net import LightNet
from anyprobe_train.train.config import LightConfig, RunConfig, lift, normals
from anyprobe_train.train.loop import load_nets, train
from research.compare.study import difference, means
from research.left_out import PAIRS, left_out_pairs
from research.results import commit, write_result

app = new_app(__doc__)


def lift_trial() -> RunConfig:
    """What the others are compared with: a short run of `lift`, plain objects, nothing told of what is around."""
    plain = replace(
        lift().pairs,
        world=0.0,
        given_material=0.0,
        surroundings=0.0,
        merged_surroundings=0.0,
        joined=0.0,
        shape_augment=0.0,
        textured=0.0,
        two_materials=0.0,
    )
    return replace(
        lift(),
        name="lift_trial",
        steps=600,
        learning_rate=1e-3,
        warmup=50,
        cooldown=0.5,
        lift=replace(lift().lift, level=0.0, color=0.0, material=0.0),
        pairs=replace(plain, seed=59),
        surfaces=replace(lift().surfaces, views=9, figures=400, parts=0, bend=0.0, relief=0.0, shadows=False, seed=4),
        light=replace(lift().light, seed=8),
    )


def lift_again() -> RunConfig:
    """The same from other first weights, on other pairs: what chance alone does."""
    return replace(lift_trial(), name="lift_again", seed=1, pairs=replace(lift_trial().pairs, seed=60))


def tasks_trial() -> RunConfig:
    """Without the side tasks: neither irradiance nor alpha is asked for, only normals and the map."""
    return _changed("tasks_trial", irradiance=0.0, alpha=0.0)


def pixels_trial() -> RunConfig:
    """Errors of single pixels alone: neither their means over larger ones, nor structure, nor what spheres see."""
    return _changed("pixels_trial", scales=0.0, structure=0.0, transport=0.0)


def light_train() -> RunConfig:
    """Real maps of hdri/train alone."""
    return _lit("light_train", LightConfig(extra=False, procedural=0))


def light_real() -> RunConfig:
    """Real maps, those of hdri/train_extra too."""
    return _lit("light_real", LightConfig(procedural=0))


def light_both() -> RunConfig:
    """Real maps and our own; `lift_trial` has light made of these too."""
    return _lit("light_both", LightConfig(procedural=200))


def clean_trial() -> RunConfig:
    """Photos as the paper's: no blur, noise or JPEG, masks exact."""
    return replace(lift_trial(), name="clean_trial", pairs=replace(lift_trial().pairs, conditions=0, cut_out=0.0))


def shapes_trial() -> RunConfig:
    """The normals of `lift` alone, from more and other shapes: machined parts, surfaces joined and reshaped."""
    return replace(
        normals(),
        name="shapes_trial",
        steps=2_500,
        pairs=replace(normals().pairs, seed=82, joined=0.3, shape_augment=0.7),
        surfaces=replace(normals().surfaces, parts=800),
    )


def _changed(name: str, **losses) -> RunConfig:
    return replace(lift_trial(), name=name, lift=replace(lift_trial().lift, **losses))


def _lit(name: str, light: LightConfig) -> RunConfig:
    return replace(lift_trial(), name=name, light=replace(light, seed=lift_trial().light.seed))


ABLATIONS = {
    run.__name__: run
    for run in (
        lift_trial,
        lift_again,
        tasks_trial,
        pixels_trial,
        light_train,
        light_real,
        light_both,
        clean_trial,
        shapes_trial,
    )
}
FIRST, OTHER_MODEL = "lift_trial", "shapes_trial"
FIGURES = ("ldr_rmse", "ldr_ssim", "ln_hdr_rmse", "angle_diffuse_deg", "dominant_light_deg", "total_power_stops")


@app.command(name="train")
def train_run(
    name: Annotated[str, Parameter(help="One of " + ", ".join(ABLATIONS))],
    /,
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri/train and meshes/train.")],
    runs: Annotated[Path, Parameter(help="Folder for checkpoints, logs and caches.")] = Path("runs"),
) -> None:
    """Train one, a quarter of an hour of a core; resumes."""
    if name not in ABLATIONS:
        raise InputError(f"expected one of {', '.join(ABLATIONS)}", source=f"run {name!r}")
    print(train(ABLATIONS[name](), data=data, runs=runs))


@app.command()
def score(
    *,
    data: Annotated[Path, Parameter(help="The data they learned from; scored on what its licences leave out.")],
    runs: Annotated[Path, Parameter(help="Folder of the trained runs.")] = Path("runs"),
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write.")] = Path("runs/ablations.json"),
) -> None:
    """Score every trained one, pair by pair against lift_trial."""
    methods = trained(runs)
    if FIRST not in methods:
        raise InputError(f"expected the run {FIRST} that others are compared with, found none", source=runs)
    pairs = left_out_pairs(data, runs / "cache" / "left_out")
    scores = score_pairs(track(pairs, "scoring", total=PAIRS), methods)
    rows: dict[str, Mapping[str, Any]] = {
        name: {
            "means": {figure: means(scores, name)[figure] for figure in FIGURES},
            "differences": {figure: difference(scores, name, FIRST, figure) for figure in FIGURES},
        }
        for name in methods
    }
    write_result(out, {"commit": commit(), "pairs": PAIRS, "rows": rows})
    for name, row in rows.items():
        print(f"{name}: " + ", ".join(f"{key} {value:.4g}" for key, value in row["means"].items()))
    print(out)


def trained(runs: Path) -> dict[str, Method]:
    """The runs of `lift` that a folder has, as methods."""
    found = {name: runs / name / "checkpoint.pt" for name in ABLATIONS if name != OTHER_MODEL}
    return {name: network_method(load_nets(path)["light"]) for name, path in found.items() if path.is_file()}


def network_method(net: LightNet) -> Method:
    """A network in torch, from the photo alone."""

    @torch.no_grad()
    def method(pair: Pair) -> Estimate:
        photo = torch.from_numpy(pair.crop).permute(2, 0, 1)[None]
        guess = net(photo, torch.tensor([[pair.tan_half]], dtype=torch.float32))
        radiance = np.exp(guess.ln_radiance[0].permute(1, 2, 0).numpy())
        return Estimate(ldr=response(radiance), radiance=radiance)

    return method


if __name__ == "__main__":
    run_command(app)
