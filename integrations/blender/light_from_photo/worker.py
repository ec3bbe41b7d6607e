# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs apart from Blender, started by process.Process: python worker.py FOLDER.

FOLDER/order.json says what to do, FOLDER/answer.json what came of it, FOLDER/progress.txt how far it is.
"""

import json
import math
import os
import sys
from pathlib import Path


def main(folder: Path) -> None:
    order = json.loads((folder / "order.json").read_text(encoding="utf-8"))
    sys.path += [path for path in order["python_path"] if path and path not in sys.path]
    try:
        from anyprobe import AnyprobeError
    except ImportError as error:
        answer(folder, {"error": f"The extension is not whole ({error}); install its zip again"})
        return
    try:
        found = {"estimate": estimate, "upright": upright, "materials": materials}[order["do"]](order, folder)
    except AnyprobeError as error:
        found = {"error": panel_words().line(error.notice)}
    except MemoryError:
        found = {"error": "Not enough memory for this photo; make it smaller"}
    answer(folder, found)


def answer(folder: Path, found: dict) -> None:
    (folder / "answer.json").write_text(json.dumps(found), encoding="utf-8")


def say(folder: Path, share: float, text: str) -> None:
    """Replaced as a whole, as Blender reads it at any time."""
    part = folder / "progress.part"
    part.write_text(f"{share:.2f} {text}", encoding="utf-8")
    os.replace(part, folder / "progress.txt")


def materials(_order: dict, _folder: Path) -> dict:
    from anyprobe.scatter.materials import MATERIALS

    return {"materials": sorted(MATERIALS)}


def upright(order: dict, folder: Path) -> dict:
    """A photo that its EXIF turns, as a file that Blender shows upright; {} where it stands so already."""
    from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

    from anyprobe import InvalidPhoto

    try:
        with Image.open(order["photo"]) as image:
            if image.getexif().get(ExifTags.Base.Orientation, 1) == 1:
                return {}
            turned = ImageOps.exif_transpose(image)
            path = folder / ("upright.png" if turned.has_transparency_data else "upright.jpg")
            turned.save(path, quality=95, exif=turned.getexif(), icc_profile=image.info.get("icc_profile"))
    except UnidentifiedImageError:
        return {}  # .exr and whatever else the library itself judges
    except (OSError, ValueError, SyntaxError) as error:
        raise InvalidPhoto(f"{Path(order['photo']).name}: expected a photo, got a damaged file ({error})") from error
    return {"upright": str(path)}


def estimate(order: dict, folder: Path) -> dict:
    """The light of a photo: maps in Blender's axes, sources, the camera over its ground, the object's outline.

    foot and object_size, the longer side of its outline, are in heights of the camera over the ground.
    """
    say(folder, 0.05, "Loading the library")
    import numpy as np

    from anyprobe import Estimator, Hints, session
    from anyprobe.estimate.ground import contact_of
    from anyprobe.estimate.sheet import draw_overlay
    from anyprobe.export.exported_light import origin_of
    from anyprobe.export.target_frames import BLENDER
    from anyprobe.export.targets import export
    from anyprobe.masks.check import object_box
    from anyprobe.pictures.images import write_png
    from anyprobe.relight.ground_view import view_of

    say(folder, 0.2, "Opening the networks")
    estimator = Estimator()
    say(folder, 0.4, "Finding the object")
    hints = Hints(
        mask=picture(order["mask"], as_data=True),
        click=order["click"],
        exclude=order["exclude"],
        box=order["box"],
        fov_deg=order["fov_deg"],
        pitch_deg=order["pitch_deg"],
        normals="sphere" if order["normals"] == "sphere" else vectors(order["normals"]),
        material=order["material"],
        albedo=order["albedo"],
        roughness=order["roughness"],
        surroundings="photo" if order["background"] else None,
    )
    photo = session.mark(session.Shot(source=picture(order["photo"]), name=order["name"], hints=hints))
    say(folder, 0.6, "Estimating the light")
    light = session.estimate(estimator, [photo])
    view, pitch_deg = view_of(photo, found=light.ground)
    radiance, warnings = light.radiance, list(light.warnings)
    if order["library"]:
        say(folder, 0.7, "Comparing your panoramas")
        radiance, lines = best_panorama(light, order["library"])
        warnings += lines
    elif order["detail"]:
        radiance = light.panorama(PLACE_ROWS, frame="camera", lit=True).radiance
    say(folder, 0.9, "Writing the maps")
    turn = np.array(order["turn"]) if order["turn"] else turned(order["heading_deg"], view.up)
    foot, (x0, y0, x1, y1) = view.on_ground(*contact_of(photo.mask)), object_box(photo.mask)
    error_deg = None if order["library"] else light.dominant_light().error_deg
    said_sources = light.said_sources if radiance is light.radiance else None
    level = None if order["turn"] else level_by(light.ground, photo, pitch_deg, view.up)
    paths = export(
        radiance,
        "blender",
        folder,
        "light",
        world_from_camera=np.array(BLENDER.axes).T @ turn,
        origin=origin_of(light.sidecar()) | ({"level": level} if level else {}),
        error_deg=error_deg,
        said_sources=said_sources,
    )
    write_png(folder / "object.png", draw_overlay(photo.rgb, photo.mask))
    write_balls(radiance, folder)
    side = json.loads(next(path for path in paths if path.suffix == ".json").read_text(encoding="utf-8"))
    return {
        "full": "light_blender.exr",
        "rest": "light_blender_ambient.exr",
        "sources": sources_of(side),
        "turn": turn.tolist(),
        "error_deg": error_deg,
        "soft_from": light.brightest_side() if light.is_soft and not order["library"] else None,
        "level": level,
        "long_fov_deg": view.long_fov_deg,
        "fov_source": light.origin.fov_source,
        "pitch_deg": pitch_deg,
        "foot": (turn @ foot).tolist(),
        "object_size": float(-foot[2] * max(x1 - x0, y1 - y0) / view.focal),
        "size": [view.width, view.height],
        "object": "object.png",
        "chrome": "chrome.png",
        "matte": "matte.png",
        "mask_source": photo.mask_source,
        "mask_confidence": photo.mask_confidence,
        "warnings": [panel_words().line(line) for line in warnings],
    }


PANEL = {
    "click": "a click",
    "exclude": "a Ctrl-click",
    "box": "a box",
    "mask": "a mask picture",
    "fov_deg": "the Field of view",
    "pitch_deg": "the Pitch",
    "normals": "a Normal map",
    "material": "the Material",
}
"""What the library's arguments are here, by their keywords."""
MARKED = ("click", "exclude", "box")
"""Arguments that Mark Object sets."""


def panel_words():
    """Return the words in which the panel says a notice of the library: its own inputs."""
    from anyprobe.notices import Notice, Words

    class PanelWords(Words):
        verb = "give"

        def name(self, argument: str) -> str:
            return PANEL.get(argument, argument)

        def giving(self, argument: str, value: str) -> str:
            return f"{self.name(argument)} {value}".strip()

        def action(self, name: str) -> str:
            return "look at Object of this photo among the images"

        def line(self, notice: str) -> str:
            line = super().line(notice)
            marked = isinstance(notice, Notice) and any(
                one.do == "give" and one.name in MARKED for one in notice.remedy
            )
            return f"{line} (by Mark Object)" if marked else line

    return PanelWords()


BALL_PX = 128
"""Side of a ball's picture."""


def write_balls(radiance, folder: Path) -> None:
    """Write chrome.png and matte.png: balls under a map [H, 2H, 3] as the photo's camera sees them, clear around.

    They share an exposure, 0 EV at most, at which the matte one does not clip.
    """
    import numpy as np

    from anyprobe.core.response import response
    from anyprobe.pictures.images import write_png
    from anyprobe.render.spheres import diffuse, mirror, sphere_normals

    matte, chrome = diffuse(radiance, BALL_PX), mirror(radiance, BALL_PX)
    gain = min(1.0, 1.0 / max(float(matte.max()), 1e-6))
    coverage = sphere_normals(BALL_PX)[1].astype(np.float32)
    for name, ball in (("chrome", chrome), ("matte", matte)):
        write_png(folder / f"{name}.png", np.dstack([response(ball * gain), coverage]))


PLACE_ROWS = 512
"""Of the panorama of the place in the World."""
PANORAMA_ROWS = 1024
"""Of the user's panorama in the World."""


def best_panorama(light, library: str):
    """The panorama of a folder that lights most like the photo, [H, 2H, 3] in the camera's frame; and lines on it and
    on files that could not be read."""
    best = light.match(library, best=1)[0]
    line = f"Panorama {best.name}, {best.exposure_ev:+z.1f} EV, stands for the estimate"
    return best.radiance(PANORAMA_ROWS), [line, *best.library.warnings]


def level_by(ground, photo, pitch_deg: float, up) -> str:
    """How the map was levelled, in a line: by the ground of a view that up [3] belongs to, guessed where None is
    estimated."""
    from dataclasses import replace

    from anyprobe.estimate.ground import estimate_ground

    ground, roll_deg = ground or estimate_ground(photo), math.degrees(math.atan2(up[0], up[1]))
    return replace(ground, pitch_deg=pitch_deg, roll_deg=roll_deg).said_level()


def turned(heading_deg: float, up):
    """Blender's [3, 3] rotation of a camera headed so, left of +Y, in whose frame up [3] is Blender's +Z."""
    import numpy as np

    forward = np.array([0.0, 0.0, -1.0]) - up * -up[2]
    if np.linalg.norm(forward) < 1e-6:  # it looks straight down or up: the picture's top is headed so
        forward = np.array([0.0, 1.0, 0.0])
    forward = forward / np.linalg.norm(forward)
    heading = math.radians(heading_deg)
    ahead, above = np.array([-math.sin(heading), math.cos(heading), 0.0]), np.array([0.0, 0.0, 1.0])
    seen = np.stack([np.cross(forward, up), forward, up])
    return np.stack([np.cross(ahead, above), ahead, above], axis=1) @ seen


def sources_of(side: dict) -> list[dict]:
    """Light sources that "rest" lacks: direction towards each in Blender's axes, irradiance of a plane that faces it,
    its diameter."""
    return [
        {"towards": one["direction_in_target"], "irradiance": one["irradiance"], "angle_deg": one["angle_deg"]}
        for one in side["lights"]
    ]


def vectors(source: dict | None):
    """A normal map's path, or of the pixels that Blender keeps, colours or vectors, [H, W, 3] vectors."""
    if source is None or "file" in source:
        return source and source["file"]
    import numpy as np

    values = np.load(source["pixels"])[..., :3]
    if source["linear"] and values.min() < 0:
        return values
    return np.where(values.any(axis=-1, keepdims=True), 2 * values - 1, np.float32(0))


def picture(source: dict | None, as_data: bool = False):
    """A file's path, or the pixels that Blender keeps: [H, W, 4] display values, or linear ones.

    as_data: they are no colours, and stay as they are.
    """
    if source is None:
        return None
    if "file" in source:
        return source["file"]
    import numpy as np

    from anyprobe.core.response import response

    values = np.load(source["pixels"])
    if source["linear"] and not as_data:
        values[..., :3] = response(np.nan_to_num(np.maximum(values[..., :3], 0)))
    return np.clip(values, 0, 1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
