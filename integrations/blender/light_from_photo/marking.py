# SPDX-License-Identifier: GPL-3.0-or-later
"""Clicks and a box on the photo, in an image editor: the object to estimate from."""

import bpy

from . import photos, process

DRAG_PX = 6
"""Moved less than this a press is a click."""

ON, BESIDE = (0.1, 1.0, 0.4, 1.0), (1.0, 0.15, 0.1, 1.0)
HANDLE = None
"""Of the drawing over image editors, while an object is marked."""


def pixel_at(region, size, x: float, y: float) -> tuple[float, float]:
    """Pixel of a picture from its top left, of a place in its image editor's region."""
    u, v = region.view2d.region_to_view(x, y)
    return u * size[0], (1 - v) * size[1]


def region_at(region, size, x: float, y: float) -> tuple[float, float]:
    """The inverse of pixel_at; far outside the region for what it does not show."""
    return region.view2d.view_to_region(x / size[0], 1 - y / size[1], clip=False)


def inside(size, x: float, y: float) -> bool:
    return 0 <= x < size[0] and 0 <= y < size[1]


def box_of(size, start, end) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of two corners, cut at the picture's border."""
    (x0, x1), (y0, y1) = (
        sorted((max(0.0, min(a, n)), max(0.0, min(b, n)))) for a, b, n in zip(start, end, size, strict=False)
    )
    return x0, y0, x1, y1


def draw() -> None:
    """Marks over the photo, in the image editor that shows it."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    context = bpy.context
    settings = context.scene.light_from_photo
    image = settings.image
    if image is None or context.space_data.image != image or not image.size[0]:
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.bind()

    def lines(points, color):
        shader.uniform_float("color", color)
        batch_for_shader(shader, "LINES", {"pos": [(*point, 0.0) for point in points]}).draw(shader)

    for mark in settings.marks:
        x, y = region_at(context.region, image.size, *mark.at)
        lines([(x - 8, y), (x + 8, y), (x, y - 8), (x, y + 8)], BESIDE if mark.beside else ON)
    if settings.use_box:
        x0, y0, x1, y1 = settings.box
        a, b = (region_at(context.region, image.size, x, y) for x, y in ((x0, y0), (x1, y1)))
        corners = [a, (b[0], a[1]), b, (a[0], b[1])]
        lines([p for i in range(4) for p in (corners[i], corners[(i + 1) % 4])], ON)


def stop() -> None:
    global HANDLE
    if HANDLE is not None:
        bpy.types.SpaceImageEditor.draw_handler_remove(HANDLE, "WINDOW")
        HANDLE = None


def show(context, image) -> None:
    """The photo in an image editor: one that is open, else a new window."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR" and area.spaces.active.mode in {"VIEW", "MASK", "PAINT"}:
                area.spaces.active.image = image
                area.tag_redraw()
                return
    if context.window is None or bpy.app.background:
        return
    bpy.ops.wm.window_new()
    area = context.window_manager.windows[-1].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = image
    area.spaces.active.show_region_ui = True


class LIGHT_FROM_PHOTO_OT_show(bpy.types.Operator):
    """Show the photo upright in an image editor, to mark the object there"""

    bl_idname = "light_from_photo.show"
    bl_label = "Mark Object"

    @classmethod
    def poll(cls, context):
        return context.scene.light_from_photo.image is not None

    def execute(self, context):
        settings = context.scene.light_from_photo
        try:
            photos.stand_upright(settings)
        except process.Failed as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        show(context, settings.image)
        self.report({"INFO"}, "In the image editor: sidebar (N) > Light > Mark Object")
        return {"FINISHED"}


class LIGHT_FROM_PHOTO_OT_mark(bpy.types.Operator):
    """Click on the object, Ctrl-click beside it, or drag a box around it; Enter ends, Esc takes it back"""

    bl_idname = "light_from_photo.mark"
    bl_label = "Mark Object"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        space = context.space_data
        return context.scene.light_from_photo.image is not None and space is not None and space.type == "IMAGE_EDITOR"

    def invoke(self, context, _event):
        global HANDLE
        settings = context.scene.light_from_photo
        try:
            photos.stand_upright(settings)
        except process.Failed as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.space_data.image = settings.image
        self.before = [(tuple(one.at), one.beside) for one in settings.marks], settings.use_box, tuple(settings.box)
        self.start = None
        if HANDLE is None:
            HANDLE = bpy.types.SpaceImageEditor.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL")
        context.workspace.status_text_set(self.__doc__)
        context.window_manager.modal_handler_add(self)
        context.area.tag_redraw()
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        settings = context.scene.light_from_photo
        if settings.image is None or context.area is None or event.type == "ESC":
            self.take_back(settings)
            return self.end(context, {"CANCELLED"})
        if event.type in {"RET", "NUMPAD_ENTER"}:
            return self.end(context, {"FINISHED"})
        region = next(one for one in context.area.regions if one.type == "WINDOW")
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        over = 0 <= x < region.width and 0 <= y < region.height and not self.on_another(context, event)
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and over:
            self.start = x, y
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE" and self.start:
            self.put(settings, region, (x, y), beside=event.ctrl)
            self.start = None
        elif event.type == "MOUSEMOVE" and self.start and self.dragged((x, y)):
            self.put(settings, region, (x, y), beside=False)
        else:
            return {"PASS_THROUGH"}
        context.area.tag_redraw()
        return {"RUNNING_MODAL"}

    def on_another(self, context, event) -> bool:
        """Whether the pointer is on the sidebar or a header, which may lie over the picture."""
        return any(
            0 <= event.mouse_x - one.x < one.width and 0 <= event.mouse_y - one.y < one.height
            for one in context.area.regions
            if one.type != "WINDOW"
        )

    def dragged(self, end) -> bool:
        return max(abs(a - b) for a, b in zip(self.start, end, strict=True)) > DRAG_PX

    def put(self, settings, region, end, beside: bool) -> None:
        """A click or the box of a press at self.start and where the mouse is now."""
        size = settings.image.size
        first, last = (pixel_at(region, size, *point) for point in (self.start, end))
        if self.dragged(end):
            settings.use_box = True
            settings.box = box_of(size, first, last)
        elif inside(size, *first):
            mark = settings.marks.add()
            mark.at, mark.beside = first, beside

    def take_back(self, settings) -> None:
        marks, settings.use_box, settings.box = self.before
        settings.marks.clear()
        for at, beside in marks:
            mark = settings.marks.add()
            mark.at, mark.beside = at, beside

    def cancel(self, context):
        self.end(context, {"CANCELLED"})

    def end(self, context, result):
        stop()
        context.workspace.status_text_set(None)
        if context.area:
            context.area.tag_redraw()
        return result


class LIGHT_FROM_PHOTO_OT_clear(bpy.types.Operator):
    """Forget clicks and box; the object is found by itself"""

    bl_idname = "light_from_photo.clear"
    bl_label = "Clear Marks"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        settings = context.scene.light_from_photo
        settings.marks.clear()
        settings.use_box = False
        return {"FINISHED"}


CLASSES = (LIGHT_FROM_PHOTO_OT_show, LIGHT_FROM_PHOTO_OT_mark, LIGHT_FROM_PHOTO_OT_clear)
