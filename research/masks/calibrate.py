"""python -m research.masks.calibrate: how many bad and good masks a threshold of the expected IoU warns of.

Asked is without a prompt, by clicks and by boxes, right and wrong ones, in rendered scenes of training assets and in
cluttered ones, where the object of one is pasted into another. Without a prompt, and by a wrong one, any object of the
scene may be found: whoever marks the thing beside it, means that. The contract's mask quality is chosen by it; photos
only score (python -m research.masks).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.masks.check import MIN_OBJECT_PX
from anyprobe.masks.find import DOUBTFUL, expected_iou
from anyprobe.masks.networks import Network, SmallNetwork, U2NetP
from anyprobe.masks.parts import grow
from anyprobe.masks.search import Looks, Prompts, find_object
from research.masks.cases import Case, iou
from research.masks.clutter import cluttered
from research.masks.scoring import BAD, GOOD

GROUPS = 6
"""Groups of scenes; the two objects of a cluttered picture are of one."""

BESIDE = 0.1
"""Largest distance of a wrong click from the object, in its longer side."""

NARROW, SHIFT, WIDE = (0.3, 0.55), (0.3, 0.6), (0.4, 1.2)
"""Of wrong boxes, in the object's sizes: what is missing at one side, how far it lies beside, what is too much."""

THRESHOLDS = (0.5, 0.55, 0.6, DOUBTFUL, 0.65, 0.7, 0.75, 0.8)


def calibrate(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri/train and meshes/train.")],
    scenes: Annotated[int, Parameter(help="Scenes to render."), bounded(2 * GROUPS)] = 36,
    clutter: Annotated[int, Parameter(help="Cluttered pictures to make of them."), bounded(0)] = 18,
    seed: Annotated[int, Parameter(help="Of scenes and clutter.")] = 779,
    small: Annotated[bool, Parameter(help="Of the small network, not of U2-Net-p.")] = False,
    left_out: Annotated[bool, Parameter(help="Score on left-out assets, by which nothing is chosen.")] = False,
) -> None:
    """Print by threshold how many bad and good masks would be warned of, with standard errors."""
    network = SmallNetwork() if small else U2NetP()
    judged = [one for cases in photos_asked(data, scenes, clutter, seed, left_out) for one in ask(network, cases)]
    expected, true = np.array(judged).T
    for threshold in THRESHOLDS:
        bad, good = (_share(expected[chosen] < threshold) for chosen in (true < BAD, true > GOOD))
        print(f"below {threshold:.2f}: {bad} bad, {good} good")


def _share(warned: np.ndarray) -> str:
    """How many of [N] bool, and the share's standard error in hundredths."""
    count = len(warned)
    share = warned.sum() / max(count, 1)
    return f"{warned.sum()} of {count} ({share:.0%} +- {np.sqrt(share * (1 - share) / max(count, 1)):.0%})"


def photos_asked(data: Path, scenes: int, clutter: int, seed: int, left_out: bool) -> Iterator[list[Case]]:
    """The objects of one photo that are marked."""
    from anyprobe_train.world.batch import World
    from research.masks.scenes import rendered_cases

    part = "left-out" if left_out else "train"
    drawn = list(rendered_cases(World.open(data, Path("runs/world"), part), scenes, seed))
    for group in range(GROUPS):
        mine = drawn[group::GROUPS]
        yield from ([case] for case in mine)
        yield from ([both.first, both.second] for both in cluttered(mine, clutter // GROUPS, seed + group))


def ask(network: Network, cases: list[Case]) -> Iterator[tuple[float, float]]:
    """Expected and true IoU of the masks found in one photo: without a prompt, and by marks of each object."""
    height, width = cases[0].mask.shape
    looks = Looks(network, cases[0].rgb)
    there = [cases[0].mask, *cases[0].others]
    asked = [(Prompts(), there)]
    for case in cases:
        asked += [(prompts, [case.mask]) for prompts in marks(case)]
        asked += [(prompts, there) for prompts in wrong_marks(case)]
    for prompts, true in asked:
        found = find_object(looks, prompts)
        if found is not None:
            mask = found.mask(width, height)
            yield expected_iou(found), max(iou(mask, one) for one in true)


def marks(case: Case) -> Iterator[Prompts]:
    """Two clicks and a box."""
    yield Prompts(on=[case.click])
    rows, columns = np.nonzero(case.mask > 0.5)
    any_place = _rng_of(case).integers(len(rows))
    yield Prompts(on=[(columns[any_place] + 0.5, rows[any_place] + 0.5)])
    yield from _boxes(case, [case.box])


def wrong_marks(case: Case) -> Iterator[Prompts]:
    """A click beside the object, and boxes too narrow, beside it, and too wide."""
    rng = _rng_of(case)
    rows, columns = np.nonzero(case.mask > 0.5)
    beside = np.argwhere(grow(case.mask > 0.5, round(BESIDE * max(np.ptp(columns), np.ptp(rows)))) & (case.mask < 0.05))
    if len(beside):
        row, column = beside[rng.integers(len(beside))]
        yield Prompts(on=[(column + 0.5, row + 0.5)])
    box, size = np.array(case.box, float), np.array([np.ptp(columns) + 1, np.ptp(rows) + 1] * 2)
    narrow, side = box.copy(), rng.integers(4)
    narrow[side] += (1 if side < 2 else -1) * rng.uniform(*NARROW) * size[side]
    shift = np.tile(rng.uniform(*SHIFT, 2) * rng.choice([-1, 1], 2), 2)
    wide = box + size * rng.uniform(*WIDE, 4) * (-1, -1, 1, 1)
    yield from _boxes(case, [narrow, box + shift * size, wide])


def _rng_of(case: Case) -> np.random.Generator:
    return np.random.default_rng(int(case.mask.sum()))


def _boxes(case: Case, boxes: Iterable[Iterable[float]]) -> Iterator[Prompts]:
    """Yield boxes, cut at the photo's border, that are neither too small nor all of it."""
    height, width = case.mask.shape
    for given in boxes:
        x0, y0, x1, y1 = (float(one) for one in np.clip(given, 0, [width, height] * 2))
        if min(x1 - x0, y1 - y0) >= MIN_OBJECT_PX and (x1 - x0) * (y1 - y0) < width * height:
            yield Prompts(box=(x0, y0, x1, y1))


if __name__ == "__main__":
    run_command(calibrate)
