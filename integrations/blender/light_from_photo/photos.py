# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that Blender has, as files and pixels for the worker: still files keep their EXIF."""

from pathlib import Path

import bpy
import numpy as np

from . import process


def source_of(image, frame: int, folder: Path) -> dict:
    """A picture as {"file": path} or {"pixels": path, "linear": bool}; what is written goes into the folder."""
    path = Path(bpy.path.abspath(image.filepath, library=image.library)) if image.filepath else None
    if image.source == "MOVIE":
        return {"file": str(movie_frame(image, path, frame, folder))}
    if image.source == "SEQUENCE":
        found = Path(bpy.path.abspath(sequence_file(image, frame), library=image.library))
        if not found.is_file():
            raise process.Failed(f"{image.name}: no file of frame {frame}; choose another frame")
        return {"file": str(found)}
    if image.packed_file and not image.is_dirty:
        packed = unused(folder, "packed", path.suffix if path else ".png")
        packed.write_bytes(image.packed_file.data)
        return {"file": str(packed)}
    if path and path.is_file() and not image.is_dirty:
        return {"file": str(path)}
    if not image.has_data and (image.source != "GENERATED" or not image.size[0]):
        raise process.Failed(f"{image.name}: no such file as {path}; choose the photo again")
    width, height = image.size
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    kept = unused(folder, "pixels", ".npy")
    np.save(kept, values.reshape(height, width, image.channels)[::-1])
    return {"pixels": str(kept), "linear": image.is_float}


def unused(folder: Path, name: str, suffix: str) -> Path:
    """A file that is not there yet: photo, mask and normals come into one folder."""
    return folder / f"{name}_{len(list(folder.iterdir()))}{suffix}"


def sequence_file(image, frame: int) -> str:
    """The name of a frame's file: the digits before the suffix count."""
    path = Path(image.filepath)
    digits = len(path.stem) - len(path.stem.rstrip("0123456789"))
    if not digits:
        return image.filepath
    return image.filepath[: -len(path.suffix) - digits] + str(frame).zfill(digits) + path.suffix


def movie_frame(image, path: Path | None, frame: int, folder: Path) -> Path:
    """One frame of a movie as a .png, by a sequencer of a scene of its own, which is removed again."""
    if path is None or not path.is_file():
        raise process.Failed(f"{image.name}: no such file as {path}; choose the movie again")
    if not 1 <= frame <= image.frame_duration:
        raise process.Failed(f"{image.name}: expected a frame from 1 to {image.frame_duration}, got {frame}")
    scene, target = bpy.data.scenes.new("light_from_photo frame"), unused(folder, "frame", ".png")
    try:
        scene.render.resolution_x, scene.render.resolution_y = image.size
        scene.render.resolution_percentage = 100
        scene.view_settings.view_transform = "Standard"
        editor = scene.sequence_editor_create()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences  # Blender 4.4 renamed it
        strips.new_movie("movie", str(path), 1, 1).frame_start = 2 - frame
        scene.frame_start = scene.frame_end = 1
        scene.render.image_settings.file_format = "PNG"
        scene.render.filepath = str(target)
        bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
    return target


def stand_upright(settings) -> None:
    """Replaces a photo that its EXIF turns by an upright packed copy: Blender shows no such turn, the library does."""
    image = settings.image
    path = Path(bpy.path.abspath(image.filepath, library=image.library)) if image.filepath else None
    if image.source != "FILE" or image.packed_file or image.is_dirty or path is None or not path.is_file():
        return
    if path.suffix.lower() not in {".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".png"}:
        return
    worker = process.Process({"do": "upright", "photo": str(path)})
    try:
        found = worker.wait()
        if "upright" in found:
            turned = bpy.data.images.load(found["upright"])
            turned.name = f"{image.name} upright"
            turned.pack()
            turned.filepath_raw = f"//{path.stem}_upright{Path(found['upright']).suffix}"
            kept = settings.mask, settings.use_box, tuple(settings.box)
            marks = [(tuple(one.at), one.beside) for one in settings.marks]
            settings.image = turned  # which forgets what was marked on another photo
            settings.mask, settings.use_box, settings.box = kept
            for at, beside in marks:
                mark = settings.marks.add()
                mark.at, mark.beside = at, beside
    finally:
        worker.close()


def background_of(camera):
    """The first picture, movie or clip behind a camera, as an image; None where there is none."""
    for one in camera.data.background_images if camera else ():
        if one.source == "IMAGE" and one.image:
            return one.image
        if one.source == "MOVIE_CLIP" and one.clip:
            return bpy.data.images.load(bpy.path.abspath(one.clip.filepath), check_existing=True)
    return None
