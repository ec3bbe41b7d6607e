# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel, in the World properties and the 3D view's sidebar, and the one for marks in image editors."""

import textwrap

import bpy

from . import estimating, process, scene

LETTER_PX = 7
"""Width of a letter at a UI scale of 1."""


def draw_marks(layout, settings) -> None:
    on, beside = (sum(one.beside == which for one in settings.marks) for which in (False, True))
    parts = [f"{on} on" if on else "", f"{beside} beside" if beside else "", "box" if settings.use_box else ""]
    text = ", ".join(part for part in parts if part)
    row = layout.row(align=True)
    if settings.mask:
        row.label(text="Object by the mask", icon="MOD_MASK")
    else:
        row.label(text=f"Marks: {text}" if text else "Object found by itself", icon="RESTRICT_SELECT_OFF")
    if text:
        row.operator("light_from_photo.clear", text="", icon="X")


def draw_text(layout, context, line: str) -> None:
    """A sentence over as many lines as the region needs."""
    column = layout.column(align=True)
    width = context.region.width / (LETTER_PX * context.preferences.system.ui_scale)
    for index, part in enumerate(textwrap.wrap(line, max(int(width) - 9, 16))):
        column.label(text=part, icon="BLANK1" if index else "INFO")


BALL_SCALE = 5
"""Of a ball in the panel, in heights of a row."""


def draw_balls(layout, settings) -> None:
    """A chrome and a matte ball under the last estimate."""
    row = layout.row()
    for ball in (settings.chrome, settings.matte):
        if ball is not None:
            column = row.column(align=True)
            column.template_icon(icon_value=ball.preview_ensure().icon_id, scale=BALL_SCALE)
            text = column.row()
            text.alignment = "CENTER"
            text.label(text=ball.name.partition(" ")[0])


class Panel:
    bl_label = "Light from Photo"

    def draw(self, context):
        layout, settings = self.layout, context.scene.light_from_photo
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.template_ID(settings, "image", open="image.open")
        layout.operator("light_from_photo.from_camera", icon="CAMERA_DATA")
        if settings.image and settings.image.source in {"MOVIE", "SEQUENCE"}:
            layout.prop(settings, "frame")
        column = layout.column(align=True)
        draw_marks(column, settings)
        column.operator("light_from_photo.show", icon="IMAGE_DATA")
        if estimating.ESTIMATE is not None:
            share, text = estimating.ESTIMATE.progress()
            row = layout.row(align=True)
            if hasattr(row, "progress"):
                row.progress(factor=share, text=text)
            else:
                row.label(text=text)
            row.operator("light_from_photo.cancel", text="", icon="X")
        else:
            row = layout.row()
            row.scale_y = 1.4
            row.operator("light_from_photo.estimate", icon="LIGHT_SUN")
        if scene.is_own(context.scene.world):
            draw_balls(layout, settings)
            for line in (*settings.said.splitlines(), *estimating.notes_on(context.scene)):
                draw_text(layout, context, line)
            if context.scene.view_settings.view_transform != "Standard":
                layout.operator("light_from_photo.standard", icon="COLOR")


class Given:
    bl_label = "What is Known"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = self.layout, context.scene.light_from_photo
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "mask")
        layout.prop(settings, "material")
        for name in ("albedo", "roughness", "fov", "pitch"):
            row = layout.row(heading=settings.bl_rna.properties[name].name)
            row.prop(settings, f"use_{name}", text="")
            part = row.row()
            part.active = getattr(settings, f"use_{name}")
            part.prop(settings, name, text="")
        layout.prop(settings, "is_sphere")
        part = layout.column()
        part.active = not settings.is_sphere
        part.prop(settings, "normals")
        layout.prop(settings, "use_background")


class Made:
    bl_label = "What is Made"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = self.layout, context.scene.light_from_photo
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "lights")
        if settings.lights == "AREA":
            layout.prop(settings, "distance")
        if process.CAN_MATCH:
            layout.prop(settings, "library")
        part = layout.row()
        part.active = not settings.library
        part.prop(settings, "use_detail")
        layout.prop(settings, "size")
        layout.prop(settings, "use_catcher")
        layout.prop(settings, "use_camera")
        part = layout.column()
        part.active = settings.use_camera
        part.prop(settings, "use_composite")
        if settings.use_camera and settings.use_composite and scene.composited(context.scene):
            part.label(text="The scene's own compositing nodes stay", icon="INFO")


def placed(base, place: str, space: str, region: str, parent: str = "", **more):
    """A panel class of a base in one place of Blender."""
    fields = {"bl_space_type": space, "bl_region_type": region, "bl_idname": f"LIGHT_FROM_PHOTO_PT_{place}", **more}
    if parent:
        fields["bl_parent_id"] = f"LIGHT_FROM_PHOTO_PT_{parent}"
    return type(fields["bl_idname"], (base, bpy.types.Panel), fields)


class Marks:
    bl_label = "Light from Photo"

    @classmethod
    def poll(cls, context):
        return context.scene.light_from_photo.image is not None

    def draw(self, context):
        layout, settings = self.layout, context.scene.light_from_photo
        draw_marks(layout, settings)
        layout.operator("light_from_photo.mark", icon="RESTRICT_SELECT_OFF")
        for line in ("Click: on the object", "Ctrl-click: beside it", "Drag: a box", "Enter: done, Esc: take back"):
            layout.label(text=line)


WORLD = {"space": "PROPERTIES", "region": "WINDOW", "bl_context": "world"}
SIDEBAR = {"space": "VIEW_3D", "region": "UI", "bl_category": "Light"}
CLASSES = (
    placed(Panel, "world", **WORLD),
    placed(Given, "world_given", parent="world", **WORLD),
    placed(Made, "world_made", parent="world", **WORLD),
    placed(Panel, "view", **SIDEBAR),
    placed(Given, "view_given", parent="view", **SIDEBAR),
    placed(Made, "view_made", parent="view", **SIDEBAR),
    placed(Marks, "image", space="IMAGE_EDITOR", region="UI", bl_category="Light"),
)
