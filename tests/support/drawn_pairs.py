"""A stand-in for the renderer of datasets: noise instead of pictures, in a millisecond.

`python -m support.drawn_pairs data render ...` is the command line with it. Environment:
DRAWN_PAUSE_S: seconds a pair takes; DRAWN_STOP: from this pair on it takes an hour;
DRAWN_DEATH: "7 FILE": whoever draws pair 7 dies by SIGKILL as long as FILE holds a number,
which is counted down.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from anyprobe.learning.dataset.pair import MapPair, Pair
from anyprobe.learning.dataset.recipe import Plan, Recipe
from anyprobe.learning.dataset.samples import CONDITIONS, Sample, encode_map_pair, encode_pair
from anyprobe.scatter.materials import Material


class DrawnRenderer:
    """Recipes of a true plan, pictures drawn by lot; a folder of assets is a text file, one name a line."""

    def __init__(self, settings, data: Path | None, report=None) -> None:
        names = [f"own-{index}" for index in range(settings["procedural_maps"])]
        if data is not None:
            names += (data / "assets.txt").read_text().split()
        self.maps = [{"id": f"{index:08x}", "name": name, "licence": "own"} for index, name in enumerate(names)]
        self.shapes = [] if settings["kind"] == "map" else [{"id": "0a" * 4, "name": "sphere", "licence": "CC0"}]
        self.plan = Plan(
            kind=settings["kind"],
            map_ids=tuple(one["id"] for one in self.maps),
            shape_ids=tuple(one["id"] for one in self.shapes),
            conditions=CONDITIONS.index(settings["conditions"]),
            seed=settings["seed"],
        )
        self.count = self.plan.count
        self.numbers: dict[str, int] = {}

    def recipe(self, index: int) -> Recipe:
        recipe = self.plan.recipe(index)
        self.numbers[recipe.key] = index
        return recipe

    def sample(self, recipe: Recipe) -> Sample:
        time.sleep(float(os.environ.get("DRAWN_PAUSE_S", 0)))
        if self.numbers[recipe.key] >= int(os.environ.get("DRAWN_STOP", 2**62)):
            time.sleep(3600)
        _die(self.numbers[recipe.key])
        rng = recipe.rng()
        gain = rng.uniform(0.1, 3.0, 3).astype(np.float32)
        shown = {"map_from_camera": np.linalg.qr(rng.normal(size=(3, 3)))[0], "gain": gain, "map_name": "m"}
        shown |= {"recipe": recipe, "indoor": bool(int(recipe.map_id, 16) % 2)}
        if recipe.kind == "map":
            return encode_map_pair(
                MapPair(
                    ldr=_picture(rng, 64, 128, 3), ln_radiance=rng.normal(size=(64, 128, 3)).astype(np.float16), **shown
                )
            )
        return encode_pair(
            Pair(
                photo=_picture(rng, 128, 128, 4),
                irradiance=_picture(rng, 128, 128, 3),
                radiance=np.zeros((64, 128, 3), np.float32),
                tan_half=float(rng.uniform(0.1, 0.4)),
                normals=np.zeros((128, 128, 3), np.float32),
                material=Material(albedo=rng.random(3), f0=rng.random(3), alpha=float(rng.random())),
                shape_name="sphere",
                **shown,
            )
        )


def _picture(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """A few blocks: quick to pack, unlike any other."""
    blocks = rng.integers(0, 256, (2, 2, shape[2]), dtype=np.uint8)
    return blocks.repeat(shape[0] // 2, axis=0).repeat(shape[1] // 2, axis=1)


def _die(number: int) -> None:
    victim, _, left = os.environ.get("DRAWN_DEATH", "").partition(" ")
    if victim and int(victim) == number:
        count = int(Path(left).read_text())
        if count > 0:
            Path(left).write_text(str(count - 1))
            os.kill(os.getpid(), signal.SIGKILL)


def thread_settings(task: int, tell) -> tuple[str | None, str | None]:
    """What a worker's numeric libraries were told."""
    return os.environ.get("OMP_NUM_THREADS"), os.environ.get("OPENBLAS_NUM_THREADS")


def make() -> type[DrawnRenderer]:
    """In the place of the command's own."""
    return DrawnRenderer


def main() -> None:
    """The command line with drawn pairs."""
    from anyprobe.cli import data
    from anyprobe.cli.app import main as command

    data._make = make
    command()


if __name__ == "__main__":
    from support import drawn_pairs  # what workers are sent is found by this name, not by __main__

    sys.exit(drawn_pairs.main())
