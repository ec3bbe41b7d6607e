"""python -m research.masks.curve: how well checkpoints of the mask network find objects, as training goes on.

Scored is the network's own answer, before it is cut out along the photo's edges: that is what training changes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.dataset.asset_store import load_asset_store
from anyprobe.masks.propose import MaskNetwork, resize
from research.mask_network.export import export_mask
from research.masks.cases import Case, iou, photo_cases
from research.masks.scenes import rendered_cases
from research.masks.scoring import PROMPTS


def curve(
    checkpoints: Annotated[list[Path], typer.Argument(help="Checkpoints of a run, in order.")],
    data: Annotated[Path | None, typer.Option(help="Folder with hdri/test and meshes/test.")] = None,
    photos: Annotated[list[Path] | None, typer.Option(help="Folder of photos and masks; repeatable.")] = None,
    scenes: Annotated[int, typer.Option(min=1, help="Scenes to render.")] = 60,
    seed: Annotated[int, typer.Option(help="Of the scenes.")] = 7,
) -> None:
    """Print mean and median IoU by prompt, a line for each checkpoint, on rendered scenes and on photos."""
    sets = {}
    if data is not None:
        store = load_asset_store(data, "test", commercial_only=False)
        sets["scenes"] = list(rendered_cases(store, scenes, seed))
    if photos:
        sets["photos"] = [case for folder in photos for case in photo_cases(folder)]
    for name, network in _networks(checkpoints):
        for group, cases in sets.items():
            typer.echo(f"{name} {group}: " + "; ".join(_figures(network, cases, prompt) for prompt in PROMPTS))


def _networks(checkpoints: list[Path]) -> Iterator[tuple[str, MaskNetwork]]:
    yield "shipped", MaskNetwork()
    for path in checkpoints:
        with tempfile.TemporaryDirectory() as folder:
            export_mask(path, Path(folder))
            yield path.stem, MaskNetwork(Path(folder) / "mask.onnx")


def _figures(network: MaskNetwork, cases: list[Case], prompt: str) -> str:
    """Over objects: the photos of one are averaged first."""
    found: dict[str, list[float]] = {}
    for case in cases:
        found.setdefault(case.group, []).append(_score(network, case, prompt))
    values = np.array([np.mean(one) for one in found.values()])
    return f"{prompt} mean {values.mean():.3f} median {np.median(values):.3f} under .5 {(values < 0.5).mean():.0%}"


def _score(network: MaskNetwork, case: Case, prompt: str) -> float:
    on = [case.click] if prompt == "click" else []
    box = case.box if prompt == "box" and not case.box_is_whole else None
    cover = network.propose(case.rgb, on, [], box).cover
    height, width = case.mask.shape
    return iou(resize(cover, width, height), case.mask)


if __name__ == "__main__":
    typer.run(curve)
