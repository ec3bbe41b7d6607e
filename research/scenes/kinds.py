"""How often rendered photos before real places are taken for indoors or outdoors, by photo and by estimate."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.frames import orthonormal_basis
from anyprobe.estimate.runtime import Models
from anyprobe.light.environment import rotate
from anyprobe.match.kind import is_lit_outdoors, shows_outdoors
from anyprobe.match.plate import Plate
from anyprobe_train.whole_network.families import FAMILIES
from research.scenes.estimates import estimates_of
from research.scenes.layouts import draw_layout
from research.scenes.pairs import store_of

PLACE = "ground"
"""The family whose photos show the place itself beside the object."""
OUTDOORS = {"outdoor": True, "indoor": False, "studio": False}
"""Whether maps of a category of the manifests are outdoors; synthetic and procedural ones are left out."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Judged:
    """A photo of a place: whether that is outdoors, whether the photo shows so, and whether its estimate does."""

    outdoors: bool
    shown: bool
    lit: bool


def judged_kinds(data: Path, part: str, files: Sequence[Path], models: Models) -> Iterator[Judged]:
    """Yield the judgements of a part's pairs before maps that are known to be of indoors or outdoors."""
    store = store_of(data, part)
    known = {}
    for manifest in sorted((data / "hdri").rglob("manifest.csv")):
        with manifest.open(newline="", encoding="utf-8") as rows:
            known |= {row["slug"]: OUTDOORS.get(row["category"]) for row in csv.DictReader(rows)}
    for path in files:
        with np.load(path) as stored:
            contexts, ups, scenes = (stored[name] for name in ("context", "up", "scene"))
        for context, up, scene, found in zip(contexts, ups, scenes, estimates_of([path], models), strict=True):
            if FAMILIES[found.family] != PLACE or found.is_cut_out:
                continue
            outdoors = known.get(draw_layout(PLACE, part, int(scene), store).map_name)
            if outdoors is None:
                continue
            side, across = orthonormal_basis(up)
            level = np.maximum(rotate(found.shipped(), np.stack([side, up, -across])), 0.0)
            yield Judged(outdoors=outdoors, shown=shows_outdoors(plate_of(context)), lit=is_lit_outdoors(level))


def plate_of(context: np.ndarray) -> Plate:
    """Return the part of a context picture [96, 96, 5] uint8 that the photo shows, without its object."""
    rows, columns = (np.flatnonzero(context[..., 4].max(axis=axis) > 127) for axis in (1, 0))
    seen = context[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    hidden = np.where((seen[..., 3] > 12) | (seen[..., 4] < 128), 255, 0).astype(np.uint8)
    return Plate(rgb=seen[..., :3], hidden=hidden, tan_half=(1.0, 1.0))


def kinds_table(judged: Sequence[Judged]) -> Iterator[str]:
    """Yield a line for each rule: how many places outdoors it finds, and how many rooms it takes for such."""
    outdoors = [one for one in judged if one.outdoors]
    rooms = [one for one in judged if not one.outdoors]
    for name, rule in (
        ("sky or plants", lambda one: one.shown),
        ("the estimate", lambda one: one.lit),
        ("either", lambda one: one.shown or one.lit),
    ):
        found, taken = (sum(map(rule, some)) for some in (outdoors, rooms))
        yield f"{name}: {found} of {len(outdoors)} outdoors, {taken} of {len(rooms)} rooms"
