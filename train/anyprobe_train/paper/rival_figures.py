"""Figs. 12 to 14: the paper's chain beside Georgoulis et al. and Meka et al., on test pairs and real photos.

All are compared as what a mirror sphere shows of their LDR map, since the others predict reflections (Sect. 4.2).
Real photos have no measured map: their lamp, in a dark room, is known instead.
"""

from collections import defaultdict

import numpy as np
import torch
from PIL import Image, ImageDraw
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response, response
from anyprobe.files.objects import draw_under
from anyprobe.light.light_sources import find_dominant_light
from anyprobe_train.evaluate.metrics import direction_error_deg, psnr, rmse, ssim
from anyprobe_train.paper.figure_run import METHODS, Run
from anyprobe_train.paper.materials import MATERIALS
from anyprobe_train.paper.pairs import balanced, pairs_of
from anyprobe_train.paper.pieces import Shown
from anyprobe_train.paper.real_photos import LampPhoto, cropped, lamp_photos
from anyprobe_train.paper.rivals import TO_EYE, spheres_of
from anyprobe_train.paper.scores import BLOCK, blocks
from anyprobe_train.paper.sheets import LINE, PICTURE_ROWS, as_bytes, as_pictures, columns_of, picture_sheet

LAMPS = ("real_lights", "real_figures")
"""Folders in the data with photos under one lamp."""
COMPARED = {"PSNR": psnr, "SSIM": ssim, "RMSE": rmse}
ANGLE = "angle to the lamp"
COLORS = ("#e08020", "#3060c0", "#60a060")
LAMP_DEG = 5.0
"""Radius of the lamp that lights the truth of Fig. 14: the photos' is not known, and hardly matters there."""
RELIT = (("vase", "plastic"), ("sphere", "matte"), ("solid", "marble"), ("pebble", "plastic"))
"""Virtual objects and their materials, one a scene; a metal would show nothing of a lone lamp but a spot."""


def lamps_of(run: Run) -> list[LampPhoto]:
    """Return all photos under one lamp."""
    return [photo for name in LAMPS for photo in lamp_photos(run.folder(name))]


def one_of_each(photos: list[LampPhoto]) -> list[LampPhoto]:
    """Return the first photo of each object."""
    return list({photo.object: photo for photo in reversed(photos)}.values())[::-1]


def compared_maps(run: Run) -> Image.Image:
    """Draw Fig. 12: photo, the light by each method on a mirror sphere, and the truth, which real photos lack."""
    which = balanced(run.test, 4, 1)
    pairs = pairs_of(run.test, which)
    real = cropped((one.load() for one in one_of_each(lamps_of(run))[:4]), run.setting.side)

    def spheres(shown: Shown) -> list[torch.Tensor]:
        return [spheres_of(run.map_by(method, shown)) for method in METHODS]

    rows = columns_of(pairs.photo[:, :3], *spheres(pairs), spheres_of(pairs.ldr))
    rows += columns_of(real.photo[:, :3], *spheres(real))
    return picture_sheet(rows, ("photo", *METHODS.values(), "GT"))


def compared_numbers(run: Run) -> Image.Image:
    """Draw Fig. 13: each method on specular and diffuse objects, test pairs and real photos."""
    found: dict[tuple[str, str, str], list[float]] = defaultdict(list)  # by panel, group and method
    which = balanced(run.test, run.setting.table_pairs, 1)
    kinds = ("Spec" if MATERIALS[number].alpha < 0.5 else "Diff" for number in which.material)  # the paper's border
    for pairs in blocks(run.test, which):
        truth = as_pictures(spheres_of(pairs.ldr))
        made = {method: as_pictures(spheres_of(run.map_by(method, pairs))) for method in METHODS}
        for k, true in enumerate(truth):
            group = f"Synth-{next(kinds)}"
            for method, pictures in made.items():
                for name, metric in COMPARED.items():
                    found[name, group, method].append(metric(pictures[k], true))
    lamps = lamps_of(run)
    for first in range(0, len(lamps), BLOCK):
        some = lamps[first : first + BLOCK]
        real = cropped((one.load() for one in some), run.setting.side)
        lights = {method: lights_of(run.map_by(method, real)) for method in METHODS}
        for k, photo in enumerate(some):
            for method, light in lights.items():
                direction = real.camera_from_crop[k] @ find_dominant_light(light[k]).direction
                group = f"Real-{'Spec' if photo.is_specular else 'Diff'}"
                found[ANGLE, group, method].append(direction_error_deg(direction, photo.lamp))
    means: dict[str, dict[str, dict[str, float]]] = defaultdict(lambda: defaultdict(dict))
    for (panel, group, method), values in found.items():
        means[panel][group][method] = float(np.mean(values))
    for panel, groups in means.items():
        for group, one in sorted(groups.items(), reverse=True):
            said = ", ".join(f"{METHODS[method]} {value:.4g}" for method, value in one.items())
            run.notes[f"{panel} {group}"] = f"{panel}, {group}: {said}"
    at_camera = [direction_error_deg(TO_EYE, photo.lamp) for photo in lamps]
    run.notes["baseline"] = f"{ANGLE}, all real photos, of a light at the camera: {np.mean(at_camera):.4g}"
    return bars(means)


def bars(means: dict[str, dict[str, dict[str, float]]]) -> Image.Image:
    """Draw a panel of bars for each figure, a group for each kind of photo, a bar for each method."""
    height, width = 150, 24
    group_width = width * (len(METHODS) + 1)
    widest = max(map(len, means.values())) * group_width
    whole = Image.new("RGB", (len(means) * (widest + width), height + 3 * LINE), "white")
    pen = ImageDraw.Draw(whole)
    for panel, (name, groups) in enumerate(means.items()):
        most = max(value for one in groups.values() for value in one.values())
        pen.text((panel * (widest + width), 0), name, fill="black")
        for number, (group, one) in enumerate(sorted(groups.items(), reverse=True)):
            left = panel * (widest + width) + number * group_width
            pen.text((left, height + 2 * LINE), group, fill="black")
            for place, (value, color) in enumerate(zip(one.values(), COLORS, strict=True)):
                x, top = left + place * width, 2 * LINE + height * (1 - max(value, 0.0) / most)
                pen.rectangle((x, top, x + width - 4, height + 2 * LINE), fill=color)
                pen.text((x, top - LINE), f"{value:.3g}", fill="black")
    return whole


def relit_objects(run: Run) -> Image.Image:
    """Draw Fig. 14: real object, and beside it a virtual one under its lamp and under each method's light.

    The lamp's power is not known, so each is brought to the truth by its best gain; the RMSE is of display values.
    """
    photos = one_of_each(lamps_of(run))[: len(RELIT)]
    real = cropped((one.load() for one in photos), run.setting.side)
    lights = {"ours": np.moveaxis(run.chain(real.photo).radiance.numpy(), 1, -1)}
    lights |= {method: lights_of(run.map_by(method, real)) for method in METHODS if method not in lights}
    objects = as_bytes(F.interpolate(real.photo[:, :3], (PICTURE_ROWS, PICTURE_ROWS), mode="bilinear"))
    rows = []
    for k, (photo, (shape, material)) in enumerate(zip(photos, RELIT, strict=False)):
        lamp = lamp_map(real.camera_from_crop[k].T @ photo.lamp, run.setting.rows)
        truth = draw_under(lamp, shape, material, size=PICTURE_ROWS)
        on = truth[..., 3] > 0.5
        truth[..., :3] /= max(float(np.quantile(truth[on, :3], 0.95)), 1e-9)
        cells = [beside(objects[k], response(truth[..., :3]), "")]
        for light in lights.values():
            drawn = draw_under(light[k], shape, material, size=PICTURE_ROWS)[..., :3]
            gain = (drawn[on] * truth[on, :3]).sum() / max(float(np.square(drawn[on]).sum()), 1e-9)
            shown = response(gain * drawn)
            cells.append(beside(objects[k], shown, f"{rmse(shown[on], response(truth[on, :3])):.3f}"))
        rows.append(cells)
    return picture_sheet(rows, ("GT: the lamp", *METHODS.values()))


def lamp_map(direction: np.ndarray, rows: int) -> np.ndarray:
    """Return a map [rows, 2 rows, 3] that is black but for a lamp of LAMP_DEG, at least a pixel."""
    cosine = pixel_directions(rows) @ direction.astype(np.float32)
    inside = cosine >= min(np.cos(np.radians(LAMP_DEG)), float(cosine.max()))
    return np.repeat(inside[..., None], 3, axis=-1).astype(np.float32)


def beside(left: np.ndarray, right: np.ndarray, label: str) -> np.ndarray:
    """Put a picture [S, S, 3] uint8 and display values [S, S, 3] side by side, with a label at the upper right."""
    both = Image.fromarray(np.concatenate([left, (right * 255 + 0.5).astype(np.uint8)], axis=1))
    ImageDraw.Draw(both).text((both.width - 36, 2), label, fill="white")
    return np.asarray(both)


def lights_of(ldr: torch.Tensor) -> np.ndarray:
    """Return radiance [N, R, 2 R, 3] of LDR maps [N, 3, R, 2 R]: white is all they know of lamps."""
    return inverse_response(as_pictures(ldr))
