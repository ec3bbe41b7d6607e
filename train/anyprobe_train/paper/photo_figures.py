"""Figs. 15 and 16: virtual objects in real photos, and materials that the paper's model does not cover."""

import csv

import numpy as np
from PIL import Image, ImageDraw

from anyprobe.errors import InputError
from anyprobe.estimate.photo import load_photo
from anyprobe.files.objects import open_object
from anyprobe.light.environment import rotate
from anyprobe.masks.check import object_box
from anyprobe_train.paper.figure_run import Run
from anyprobe_train.paper.real_photos import cropped, masked_photos
from anyprobe_train.paper.sheets import columns_of, heat, picture_sheet

INSERTED = (("vase", "gold"), ("sphere", "chrome"))
"""Virtual objects and their materials, in turn."""
SHOWN = 4
"""Photos in Fig. 15, as in the paper."""
HETEROGENEOUS = "painted"
"""Word by which DATA/real_masks/manifest.csv names objects of several colours."""


def insertions(run: Run) -> Image.Image:
    """Draw Fig. 15: real photos, the observed object in a box; virtual objects beside it; the estimated light."""
    from anyprobe.relight.insert import Arrangement, Stage

    rows: list[list[np.ndarray]] = []
    for path, mask in masked_photos(run.folder("photos")):
        photo = load_photo(path, mask=mask)
        real = cropped([photo], run.setting.side)
        made = run.chain(real.photo)
        radiance = np.moveaxis(made.radiance.numpy()[0], 0, -1)
        radiance = np.maximum(rotate(radiance, real.camera_from_crop[0]), 0.0)
        shape, material = INSERTED[len(rows) % len(INSERTED)]
        try:
            after = Stage(photo, open_object(shape), Arrangement()).relit(radiance, material)
        except InputError:  # a photo without room for it
            continue
        before = Image.fromarray((photo.rgb * 255 + 0.5).astype(np.uint8))
        ImageDraw.Draw(before).rectangle(object_box(photo.mask), outline="#e08020", width=max(2, before.width // 200))
        rows.append([np.asarray(before), (after * 255 + 0.5).astype(np.uint8), *columns_of(made.ldr)[0]])
        if len(rows) == SHOWN:
            break
    return picture_sheet(rows)


def failures(run: Run) -> Image.Image:
    """Draw Fig. 16: objects of several colours: photo, I-Irradiance image, LDR map, radiance from 0 to 10."""
    folder = run.folder("real_masks")
    with (folder / "manifest.csv").open(newline="", encoding="utf-8-sig") as stream:
        chosen = {row["id"] for row in csv.DictReader(stream) if HETEROGENEOUS in row["kind"]}
    found = [(path, mask) for path, mask in masked_photos(folder) if path.stem in chosen]
    if not found:
        raise InputError(f"expected photos whose kind says {HETEROGENEOUS!r}, got none", source=folder / "manifest.csv")
    real = cropped((load_photo(path, mask=mask, surroundings="none") for path, mask in found), run.setting.side)
    made = run.chain(real.photo)
    titles = ("photo", "I-Irradiance, est.", "LDR illum., est.", "HDR illum., est.")
    return picture_sheet(columns_of(real.photo[:, :3], made.irradiance, made.ldr, heat(made.radiance)), titles)
