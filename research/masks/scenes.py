"""Photos of the fast world, with their objects' true masks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count as numbers

import numpy as np

from anyprobe.masks.check import object_box
from anyprobe_train.mask_network.examples import inside_click, unasked_target
from anyprobe_train.mask_network.scenes import draw_scene, photograph
from anyprobe_train.world.batch import World
from research.masks.cases import Case, make_case

SIZE = 320
"""Longer side of the photos, as sharp as their objects are; the small network sees them at 160."""


def rendered_cases(world: World, count: int, seed: int) -> Iterator[Case]:
    """Photos of scenes of a world, each with one object that is meant without a prompt."""
    rng = np.random.default_rng((seed, 4))
    made = 0
    for number in numbers():
        if made == count:
            break
        scene = draw_scene(world, seed, number, SIZE)
        shot = photograph(rng, scene, scene.whole, SIZE)
        target = unasked_target(shot)
        if target is None:
            continue
        top, bottom, left, right = shot.bounds
        cover = shot.covers[target]
        x, y = inside_click(rng, cover)
        x0, y0, x1, y1 = object_box(cover)
        case = make_case(
            f"scene-{seed}-{made}",
            shot.photo[top:bottom, left:right],
            cover[top:bottom, left:right],
            (x - left, y - top),
            (x0 - left, y0 - top, x1 - left, y1 - top),
        )
        others = (one[top:bottom, left:right] for number, one in enumerate(shot.covers) if number != target)
        yield replace(case, others=tuple(others))
        made += 1
