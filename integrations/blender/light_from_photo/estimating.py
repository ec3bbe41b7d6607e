# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that estimates while Blender goes on working, and the small ones around it."""

import math
import re
from pathlib import Path

import bpy

from . import photos, process, scene

ESTIMATE = None
"""The process that runs, one at a time."""


def stem_of(image_name: str) -> str:
    """A photo's name without suffix, and without the number that Blender gives to one that is loaded again."""
    return Path(re.sub(r"\.\d{3,}$", "", image_name)).stem


def order_of(settings, camera, folder: Path) -> dict:
    """What the worker is asked for; Failed where a picture is missing."""
    if settings.image is None:
        raise process.Failed("Choose a photo first")

    def optional(image):
        return None if image is None else photos.source_of(image, settings.frame, folder)

    marks = {beside: [tuple(one.at) for one in settings.marks if one.beside == beside] for beside in (False, True)}
    turn = None
    if not settings.use_camera and camera is not None:
        turn = [list(row) for row in camera.matrix_world.to_3x3().normalized()]
    return {
        "do": "estimate",
        "photo": photos.source_of(settings.image, settings.frame, folder),
        "name": settings.image.name,
        "mask": optional(settings.mask),
        "click": marks[False] or None,
        "exclude": marks[True] or None,
        "box": tuple(settings.box) if settings.use_box else None,
        "material": settings.material.strip() or None,
        "albedo": tuple(settings.albedo) if settings.use_albedo else None,
        "roughness": settings.roughness if settings.use_roughness else None,
        "normals": "sphere" if settings.is_sphere else optional(settings.normals),
        "fov_deg": math.degrees(settings.fov) if settings.use_fov else None,
        "pitch_deg": math.degrees(settings.pitch) if settings.use_pitch else None,
        "background": settings.use_background,
        "detail": settings.use_detail,
        "library": bpy.path.abspath(settings.library) if settings.library else None,
        "heading_deg": scene.heading_deg(camera),
        "turn": turn,
    }


def said_of(found: dict) -> list[str]:
    """What the user should know of an estimate."""
    lines = list(found["warnings"])
    if found["fov_source"] in ("default", "estimated"):
        lines.append(f"Field of view unknown, taken as {found['long_fov_deg']:.0f} degrees; give it for a true camera")
    return lines


def error_of(found: dict) -> str:
    """How far off the strongest source is in two of three cases, or that none dominates; nothing of a panorama of the
    user's."""
    error_deg, side = found["error_deg"], found["soft_from"]
    if side is not None:
        return f", soft light, brightest from {side}"
    return "" if error_deg is None else f", the main light give or take {error_deg:.0f} degrees"


def notes_on(target) -> list[str]:
    """What in a scene with an estimate keeps renders from matching the photo."""
    lines, others = [], scene.foreign_lights(target)
    if others:
        lines.append(f"Other lights shine too: {', '.join(others[:3])}; hide them in renders")
    if target.render.engine != "CYCLES" and target.light_from_photo.use_catcher:
        lines.append("The shadow catcher needs Cycles: set it as the render engine")
    if target.view_settings.view_transform != "Standard":
        transform = target.view_settings.view_transform
        lines.append(f"View transform {transform} changes colours; Standard keeps the photo's")
    return lines


def stop() -> None:
    """Ends the running estimate; nothing of it stays."""
    global ESTIMATE
    if ESTIMATE is not None:
        ESTIMATE.close()
        ESTIMATE = None


class LIGHT_FROM_PHOTO_OT_estimate(bpy.types.Operator):
    """Estimate the light of the photo and build it as a new World, with sources, ground and camera"""

    bl_idname = "light_from_photo.estimate"
    bl_label = "Light from Photo"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return ESTIMATE is None and context.scene.light_from_photo.image is not None

    def execute(self, context):
        """At once, for scripts."""
        if not self.start(context):
            return {"CANCELLED"}
        try:
            found = ESTIMATE.wait(600)
        except process.Failed as error:
            return self.fail(str(error))
        return self.finish(found)

    def invoke(self, context, _event):
        if not self.start(context):
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.window_manager.progress_begin(0, 100)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if ESTIMATE is None or event.type == "ESC":
            self.end(context)
            stop()
            self.report({"INFO"}, "Estimate cancelled; nothing was changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if ESTIMATE.running():
            share, text = ESTIMATE.progress()
            context.window_manager.progress_update(100 * share)
            context.workspace.status_text_set(f"Light from photo: {text} ({100 * share:.0f} %). Esc cancels")
            redraw(context)
            return {"PASS_THROUGH"}
        self.end(context)
        try:
            found = ESTIMATE.answer()
        except process.Failed as error:
            return self.fail(str(error))
        return self.finish(found)

    def cancel(self, context):
        """Another file was opened, or Blender ends."""
        self.end(context)
        stop()

    def start(self, context) -> bool:
        global ESTIMATE
        settings, folder = context.scene.light_from_photo, process.scratch()
        self.scene_name, self.image_name = context.scene.name, settings.image.name if settings.image else ""
        try:
            photos.stand_upright(settings)
            ESTIMATE = process.Process(order_of(settings, context.scene.camera, folder), folder)
        except process.Failed as error:
            process.remove(folder)
            self.report({"ERROR"}, str(error))
            return False
        except BaseException:
            process.remove(folder)
            raise
        return True

    def finish(self, found: dict):
        """Into the scene that it was asked for, though another may be shown by now."""
        target = bpy.data.scenes.get(self.scene_name)
        if target is None or target.light_from_photo.image is None:
            return self.fail("The scene or its photo is gone; nothing was changed")
        settings = target.light_from_photo
        try:
            scene.build(target, settings, found, ESTIMATE.folder, stem_of(settings.image.name))
        finally:
            stop()
        lines = said_of(found)
        settings.said = "\n".join(lines)
        for line in reversed([*lines, *notes_on(target)]):
            self.report({"WARNING"}, line)
        sure = found["mask_confidence"]
        where = f"object by {found['mask_source']}" + ("" if sure is None else f", {100 * sure:.0f} % sure")
        self.report(
            {"INFO"},
            f"Light of {self.image_name}: {where}; view {found['long_fov_deg']:.0f} degrees, "
            f"{found['pitch_deg']:.0f} down; {len(found['sources'])} source(s){error_of(found)}",
        )
        return {"FINISHED"}

    def fail(self, line: str):
        stop()
        self.report({"ERROR"}, line)
        return {"CANCELLED"}

    def end(self, context) -> None:
        """Timer and progress away."""
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        redraw(context)


def redraw(context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES", "IMAGE_EDITOR"}:
                area.tag_redraw()


class LIGHT_FROM_PHOTO_OT_cancel(bpy.types.Operator):
    """Stop the estimate that runs"""

    bl_idname = "light_from_photo.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context):
        return ESTIMATE is not None

    def execute(self, context):
        stop()  # the running operator sees it at its next timer
        return {"FINISHED"}


class LIGHT_FROM_PHOTO_OT_from_camera(bpy.types.Operator):
    """Take the background image of the scene's camera as the photo"""

    bl_idname = "light_from_photo.from_camera"
    bl_label = "Camera's Background"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.scene.camera is not None and context.scene.camera.type == "CAMERA"

    def execute(self, context):
        found = photos.background_of(context.scene.camera)
        if found is None:
            self.report({"ERROR"}, "The scene's camera has no background image; add one, or open a photo")
            return {"CANCELLED"}
        context.scene.light_from_photo.image = found
        if found.source in {"MOVIE", "SEQUENCE"}:
            context.scene.light_from_photo.frame = max(context.scene.frame_current, 1)
        return {"FINISHED"}


class LIGHT_FROM_PHOTO_OT_standard(bpy.types.Operator):
    """Set the view transform to Standard, under which the photo and the light keep their colours"""

    bl_idname = "light_from_photo.standard"
    bl_label = "Set Standard"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        context.scene.view_settings.view_transform = "Standard"
        context.scene.view_settings.look = "None"
        return {"FINISHED"}


CLASSES = (
    LIGHT_FROM_PHOTO_OT_estimate,
    LIGHT_FROM_PHOTO_OT_cancel,
    LIGHT_FROM_PHOTO_OT_from_camera,
    LIGHT_FROM_PHOTO_OT_standard,
)
