"""Path-traced photos as the light network sees them: what its weights are chosen by, and a part of what it learns."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import torch

from anyprobe.estimate.ground import up_of
from anyprobe.estimate.light_graph import INPUTS, graph_inputs
from anyprobe.files.atomic import atomic_path
from anyprobe_train.light.given import Given
from anyprobe_train.light.light_views import LightViews
from anyprobe_train.world.batch import PHOTO_FAMILIES, LightBatch, sources_of
from anyprobe_train.world.maps import OUTDOORS
from research.scenes.camera import TakenPhoto, mirrored, take
from research.scenes.layouts import draw_family, draw_layout
from research.scenes.parts import store_of
from research.scenes.render import render_layout

SHOTS = 2
"""Photos of each scene: the second is another camera's, in a mirror."""
CUT_OUTS = 0.25
"""Share of the photos of which only the object is known."""
ASSUMED_DEG = 60.0
"""Field of view of the longer side where the file does not say it."""
IN_FILE = 16
"""Scenes in a file."""


def given_of(rgb: np.ndarray, mask: np.ndarray, long_fov_deg: float | None) -> Given:
    """Return what the graph is given of a photo: display RGB [H, W, 3] in [0, 1] and mask [H, W]."""
    known = long_fov_deg is not None
    named = graph_inputs(
        rgb.astype(np.float32), mask.astype(np.float32), long_fov_deg or ASSUMED_DEG, is_lens_known=known
    )
    return Given.of([torch.from_numpy(named[name]) for name in INPUTS])


def row_of(views: LightViews, photo: TakenPhoto, fov_deg: float, up: np.ndarray, family: str, outdoors: float) -> dict:
    """Return the arrays of one photo, as LightBatch has them without the first axis; normals and material unknown."""
    rgb = photo.picture / 255.0
    if family == "cut_out":
        rgb = rgb * photo.mask[..., None]
    given = given_of(rgb, photo.mask, photo.long_fov_deg)
    return row_of_inputs(views, given, photo.truth, fov_deg, up, family, outdoors)


def row_of_inputs(
    views: LightViews,
    given: Given,
    truth: np.ndarray,
    fov_deg: float,
    up: np.ndarray,
    family: str,
    outdoors: float,
    material: np.ndarray | None = None,
) -> dict:
    """Return those arrays of what the graph is given; truth: the light [64, 128, 3] in the camera's frame."""
    with torch.no_grad():
        inputs, _ = views(given)
    pictures = {
        name: np.round(255 * getattr(inputs, name)[0].permute(1, 2, 0).numpy()).astype(np.uint8)
        for name in ("context", "crop")
    }
    truth = np.minimum(truth, 6e4).astype(np.float16)
    sources, soft = sources_of(truth.astype(np.float32))
    return {
        **pictures,
        "lens": inputs.lens[0].numpy(),
        "fov": np.float32(fov_deg),
        "up": up.astype(np.float32),
        "normals": np.round(127 * inputs.normals[0].permute(1, 2, 0).numpy()).astype(np.int8),
        "material": np.full(4, np.nan, np.float32) if material is None else material.astype(np.float32),
        "truth": truth,
        "sources": sources,
        "soft": np.float32(soft),
        "outdoors": np.float32(outdoors),
        "family": np.uint8(PHOTO_FAMILIES.index(family)),
    }


def keep_rows(path: Path, rows: list[dict]) -> Path:
    """Write rows as a file of LightBatch's fields; its path."""
    arrays = {one.name: np.stack([row[one.name] for row in rows]) for one in fields(LightBatch)}
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        np.savez(stream, **arrays)
    return path


def make_light_pairs(data: Path, out: Path, scenes: int, part: str = "left-out", first: int = 0) -> Iterator[Path]:
    """Render scenes of a part from number `first` on, two photos each, into files of LightBatch's fields; yield each.

    Files that are there stay.
    """
    import drjit

    torch.set_num_threads(1)
    drjit.set_thread_count(1)
    store, views = store_of(data, part, out.parent / "world"), LightViews()
    known: dict[str, float] = {}
    for manifest in sorted((data / "hdri").rglob("manifest.csv")):
        with manifest.open(newline="", encoding="utf-8") as rows:
            known |= {row["slug"]: OUTDOORS.get(row["category"], np.nan) for row in csv.DictReader(rows)}
    for start in range(first, first + scenes, IN_FILE):
        path = out / f"{start:04d}.npz"
        if path.is_file():
            continue
        made = []
        for number in range(start, min(start + IN_FILE, first + scenes)):
            family = draw_family(part, number)
            layout = draw_layout(family, part, number, store)
            outdoors = known.get(layout.map_name, np.nan) if family == "ground" else np.nan
            render, phone = render_layout(layout), layout.phone
            rng = np.random.default_rng((number, 17))
            for shot in range(SHOTS):
                photo = take(mirrored(render) if shot else render, phone.long_fov_deg, rng)
                up = up_of(phone.pitch_deg, -phone.roll_deg if shot else phone.roll_deg)
                kind = "cut_out" if rng.random() < CUT_OUTS else family
                if photo.mask.any():
                    made.append(row_of(views, photo, phone.long_fov_deg, up, kind, outdoors))
        yield keep_rows(path, made)
