"""Fig. 15: virtual objects in photos, in the light that `paper` estimates of an object cut out by its depth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.files.objects import open_object
from anyprobe.masks.check import object_box
from anyprobe.masks.depth import mask_from_depth
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import Stage
from research.gallery import SCENES, photograph
from research.paper_designs.figures.real import real_photos
from research.paper_designs.figures.sheet import Tile, save, sheet

MARGIN = 0.05
"""Distance of the near plane from the object, in the scene's unit: objects are about 1.5 high."""
EDGE = 2
"""Width of an object's outermost pixels."""
SHOWN = 2
"""Scenes of the gallery."""
INSERTED, MATERIALS = "sphere", ("chrome", "matte")
"""What is put beside the real object."""
DIM = 0.25
"""What a cut photo shows of the rest."""
TEAPOT = Path(__file__).parents[3] / "examples" / "teapot.jpg"
BOX = 152, 218, 322, 336
"""Around the teapot, without its saucer, in pixels of TEAPOT."""
CREDIT = "Third row: a real photo, by oriento (Unsplash licence); its object by a box, its true light is not known."


def draw_scenes(out: Path) -> None:
    """Path-traced photos of the gallery, cut by depth: a sphere in the estimated and in the true light; a real one."""
    estimator, rows = Estimator("paper"), []
    for scene in SCENES[:SHOWN]:
        photo, truth, depth = photograph(scene)
        near, far = cut_planes(depth, photo.mask)
        cut = mask_from_depth(depth, depth.shape, near, far) * box_of(photo.mask)
        found = replace(photo, mask=cut)
        light, stage = _lit(estimator, found)
        iou = float(np.minimum(cut, photo.mask).sum() / np.maximum(cut, photo.mask).sum())
        rows.append(
            [
                Tile(picture=photo.rgb, caption=scene.name),
                Tile(picture=_cut(found), caption=f"near {near:.2f}, far {far:.2f}; IoU {iou:.2f}"),
                Tile(picture=stage.relit(light, scene.inserted, "own")),
                Tile(picture=stage.relit(truth, scene.inserted, "own")),
            ]
        )
    teapot = load_photo(TEAPOT, box=BOX, surroundings="none")
    light, stage = _lit(estimator, teapot)
    shown = [teapot.rgb, _cut(teapot), stage.relit(light, MATERIALS[0], "own")]
    rows.append([Tile(picture=picture) for picture in shown])
    page = sheet(["photo", "depth cut", "estimated light", "true light"], rows, CREDIT)
    save(page, out / "figure_15.jpg")


def cut_planes(depth: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    """Near and far plane that take in the object, as a user sets them.

    They leave out its outermost pixels, whose depth is a mean with what is behind.
    """
    inner = Image.fromarray(np.uint8(mask > 0.5)).filter(ImageFilter.MinFilter(2 * EDGE + 1))
    on = depth[(np.asarray(inner) > 0) & (depth > 0)]
    return float(on.min()) - MARGIN, float(on.max())


def box_of(mask: np.ndarray) -> np.ndarray:
    """1.0 in the box around an object [H, W], else 0.0: the paper crops, too, which leaves out most of the table."""
    x0, y0, x1, y1 = object_box(mask)
    box = np.zeros(mask.shape, np.float32)
    box[y0:y1, x0:x1] = 1.0
    return box


def draw_real(folders: Iterable[Path], out: Path) -> None:
    """Real photos, of which none has depth: the object by its mask, and two objects in the estimated light."""
    estimator, rows, shown = Estimator("paper"), [], {}
    for folder in folders:
        for real in real_photos(folder):
            thing = real.name.split("_")[0]
            shown[thing] = shown.get(thing, 0) + 1
            if shown[thing] > 1:
                continue
            light, stage = _lit(estimator, real.photo)
            drawn = [Tile(picture=stage.relit(light, material, "own")) for material in MATERIALS]
            rows.append([Tile(picture=real.photo.rgb, caption=real.name), Tile(picture=_cut(real.photo)), *drawn])
    save(sheet(["photo", "object by its mask", *MATERIALS], rows), out / "figure_15_real.jpg")


def _lit(estimator: Estimator, photo: Photo) -> tuple[np.ndarray, Stage]:
    """The estimate [64, 128, 3], at least as strong as the object's brightness needs, and the photo as a stage."""
    light = estimator.from_photo(photo).radiance
    return light * np.float32(least_scale(photo, light)), Stage(photo, open_object(INSERTED))


def _cut(photo: Photo) -> np.ndarray:
    return photo.rgb * (DIM + (1 - DIM) * photo.mask[..., None])
