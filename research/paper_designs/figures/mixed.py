"""Fig. 15: virtual objects in photos, in the light that `paper` estimates of an object cut out by its depth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo
from anyprobe.files.objects import open_object
from anyprobe.masks.depth import mask_from_depth
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import Stage
from research.gallery import SCENES, photograph
from research.paper_designs.figures.real import real_photos
from research.paper_designs.figures.sheet import Tile, save, sheet

MARGIN = 0.05
"""How much nearer than the object the near plane lies, of its height."""
SHOWN = 2
"""Scenes of the gallery."""
INSERTED, MATERIALS = "sphere", ("chrome", "matte")
"""What is put beside the real object."""
DIM = 0.25
"""What a cut photo shows of the rest."""


def draw_scenes(out: Path) -> None:
    """The gallery's path-traced photos: depth, the cut, the object in the estimated and in the true light."""
    estimator, rows = Estimator("paper"), []
    for scene in SCENES[:SHOWN]:
        photo, truth, depth = photograph(scene)
        near, far = cut_planes(depth, photo.mask)
        cut = mask_from_depth(depth, depth.shape, near, far)
        found = replace(photo, mask=cut)
        light = estimator.from_photo(found).radiance
        light = light * np.float32(least_scale(found, light))
        stage = Stage(found, open_object(INSERTED))
        iou = float(np.minimum(cut, photo.mask).sum() / np.maximum(cut, photo.mask).sum())
        rows.append(
            [
                Tile(picture=photo.rgb, caption=scene.name),
                Tile(picture=_cut(found), caption=f"near {near:.2f}, far {far:.2f}; IoU {iou:.2f}"),
                Tile(picture=stage.relit(light, scene.inserted, "own")),
                Tile(picture=stage.relit(truth, scene.inserted, "own")),
            ]
        )
    save(sheet(["photo", "depth cut", "estimated light", "true light"], rows), out / "figure_15.jpg")


def cut_planes(depth: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    """Near and far plane that take in the object, as a user sets them; they take in the table at its foot, too."""
    on = depth[(mask > 0.99) & (depth > 0)]
    return float(on.min()) - MARGIN, float(on.max())


def draw_real(folders: Iterable[Path], out: Path) -> None:
    """Real photos, of which none has depth: the object by its mask, and two objects in the estimated light."""
    estimator, rows, shown = Estimator("paper"), [], {}
    for folder in folders:
        for real in real_photos(folder):
            thing = real.name.split("_")[0]
            shown[thing] = shown.get(thing, 0) + 1
            if shown[thing] > 1:
                continue
            light = estimator.from_photo(real.photo).radiance
            light = light * np.float32(least_scale(real.photo, light))
            stage = Stage(real.photo, open_object(INSERTED))
            drawn = [Tile(picture=stage.relit(light, material, "own")) for material in MATERIALS]
            rows.append([Tile(picture=real.photo.rgb, caption=real.name), Tile(picture=_cut(real.photo)), *drawn])
    save(sheet(["photo", "object by its mask", *MATERIALS], rows), out / "figure_15_real.jpg")


def _cut(photo: Photo) -> np.ndarray:
    return photo.rgb * (DIM + (1 - DIM) * photo.mask[..., None])
