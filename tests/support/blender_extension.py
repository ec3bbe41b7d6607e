"""Run by the Python that has bpy, in a folder of user resources of its own: the extension, from its zip to a render.

python blender_extension.py extension.zip order.json answer.json

order.json: {"photo", "turned": the same with EXIF orientation 6, "movie", "broken": paths, "scratch",
"library": folders, "normals": [[x, y, z], ...] in the camera's axes, of a white sphere}.
"""

import json
import math
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Vector

MODULE = "bl_ext.user_default.light_from_photo"
SIZE = 4


def install(path):
    bpy.ops.extensions.package_install_files(filepath=path, repo="user_default", enable_on_install=True, overwrite=True)


def names():
    """What a scene holds, and what its settings are, as far as the extension touches them."""
    scene = bpy.context.scene
    return {
        "objects": sorted(one.name for one in scene.objects),
        "world": scene.world.name,
        "worlds": sorted(one.name for one in bpy.data.worlds),
        "camera": scene.camera.name,
        "size": [scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage],
        "transparent": scene.render.film_transparent,
        "composited": scene.compositing_node_group is not None,
    }


def estimate(**settings):
    """One undo step of the operator."""
    for name, value in settings.items():
        setattr(bpy.context.scene.light_from_photo, name, value)
    try:
        return sorted(bpy.ops.light_from_photo.estimate("EXEC_DEFAULT", True))
    except RuntimeError as error:
        return str(error)


def picture(path):
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    values = np.array(image.pixels[:], np.float32).reshape(image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    return values[::-1]


def set_cycles(samples, size=SIZE):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", samples, False
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.film_transparent = False
    scene.compositing_node_group = None


def white_sphere(radius):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, radius=radius)
    sphere = bpy.context.object
    bpy.ops.object.shade_smooth()
    white = bpy.data.materials.new("white")
    nodes = white.node_tree.nodes
    nodes.clear()
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    white.node_tree.links.new(diffuse.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    sphere.data.materials.append(white)
    return sphere


def lit(normals, turn, scratch):
    """Radiance [N, 3] of a white sphere at the 3D cursor, seen along normals [N, 3] of the photo's camera."""
    scene = bpy.context.scene
    set_cycles(256)
    scene.cycles.max_bounces = 0
    for one in scene.objects:
        one.hide_render = one.name in {"Cube", "Light"}
    sphere = white_sphere(0.01)
    sphere.location = scene.cursor.location + Vector((0, 0, 0.5))  # over the ground, which must not change its light
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    eye.data.angle, eye.data.clip_start = math.radians(1), 0.001
    scene.collection.objects.link(eye)
    scene.camera = eye
    seen = []
    for n in np.asarray(normals) @ turn.T:
        eye.location = sphere.location + 0.05 * Vector(n)
        eye.rotation_euler = Vector(-n).to_track_quat("-Z", "Y").to_euler()
        seen.append(picture(scratch / "seen.exr")[..., :3].mean(axis=(0, 1)).tolist())
    bpy.data.objects.remove(sphere)
    bpy.data.objects.remove(eye)
    return seen


def shadow(scratch):
    """Alpha of renders of the catcher alone, and with a cube of the ground's on it: [H, W] each."""
    scene = bpy.context.scene
    camera = scene.camera
    set_cycles(64, 64)
    scene.camera, scene.render.film_transparent = camera, True
    bpy.data.objects["Cube"].hide_render = True
    alone = picture(scratch / "alone.exr")[..., 3]
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=scene.cursor.location + Vector((0, 0, 0.3)))
    bpy.context.object.visible_camera = False
    under = picture(scratch / "under.exr")[..., 3]
    bpy.data.objects.remove(bpy.context.object)
    return [float(alone.max()), float(under.max())]


def balls():
    """Size and mean colour, within the ball, of the pictures and the previews that the panel shows."""
    settings, found = bpy.context.scene.light_from_photo, {}
    for name in ("chrome", "matte"):
        image = getattr(settings, name)
        preview = image.preview_ensure()
        for kind, values in (("picture", image.pixels[:]), ("preview", preview.image_pixels_float[:])):
            pixels = np.array(values, np.float32).reshape(-1, 4)
            inside = pixels[pixels[:, 3] > 0.5]
            found[f"{name} {kind}"] = [len(pixels), len(inside), inside[:, :3].mean(axis=0).tolist()]
    return found


def suns():
    return [
        {
            "type": one.data.type,
            "towards": list(one.matrix_world.to_quaternion() @ Vector((0, 0, 1))),
            "irradiance": (np.array(one.data.color) * one.data.energy).tolist(),
            "angle_deg": math.degrees(one.data.angle) if one.data.type == "SUN" else 0,
        }
        for one in bpy.context.scene.objects
        if one.type == "LIGHT" and one.name != "Light"
    ]


def marked():
    """What clicks and a drag in an image editor leave behind, and what Esc takes back."""
    module = sys.modules[f"{MODULE}.marking"]
    view = SimpleNamespace(  # an image editor is not laid out without a window: the picture is 300 x 200 there
        region_to_view=lambda x, y: ((x - 50) / 300, (y - 20) / 200),
        view_to_region=lambda u, v, clip: (50 + 300 * u, 20 + 200 * v),
    )
    region = SimpleNamespace(type="WINDOW", x=30, y=40, width=400, height=240, view2d=view)
    sidebar = SimpleNamespace(type="UI", x=380, y=40, width=50, height=240)  # over the picture's editor
    area = SimpleNamespace(regions=[region, sidebar], tag_redraw=lambda: None)
    settings, operator = bpy.context.scene.light_from_photo, module.LIGHT_FROM_PHOTO_OT_mark
    size = settings.image.size
    fake = SimpleNamespace(start=None, before=([], False, (0, 0, 0, 0)))
    for name in ("put", "dragged", "on_another", "take_back", "end"):
        setattr(fake, name, getattr(operator, name).__get__(fake))
    context = SimpleNamespace(scene=bpy.context.scene, area=area, workspace=bpy.context.workspace)

    def event(kind, value, pixel, ctrl=False):
        x, y = module.region_at(region, size, *pixel)
        return operator.modal(
            fake,
            context,
            SimpleNamespace(type=kind, value=value, mouse_x=region.x + x, mouse_y=region.y + y, ctrl=ctrl),
        )

    for value in ("PRESS", "RELEASE"):
        event("LEFTMOUSE", value, (size[0] * 1.1, size[1] / 2))
    middle = size[0] / 2, size[1] / 2
    corner = size[0] * 0.8, size[1] * 0.9
    event("LEFTMOUSE", "PRESS", middle)
    event("LEFTMOUSE", "RELEASE", middle)
    event("LEFTMOUSE", "PRESS", corner, ctrl=True)
    event("LEFTMOUSE", "RELEASE", corner, ctrl=True)
    event("LEFTMOUSE", "PRESS", middle)
    event("MOUSEMOVE", "NOTHING", corner)
    event("LEFTMOUSE", "RELEASE", corner)
    found = {
        "size": list(size),
        "marks": [[*one.at, one.beside] for one in settings.marks],
        "box": list(settings.box) if settings.use_box else None,
    }
    event("ESC", "PRESS", middle)
    return {**found, "after_esc": [len(settings.marks), settings.use_box]}


archive, order, answer = sys.argv[1:4]
order = json.loads(Path(order).read_text())
scratch = Path(order["scratch"])
tempfile.tempdir = str(scratch)
bpy.ops.wm.read_factory_settings()
install(archive)
scene, found = bpy.context.scene, {"before": names()}

for key in ("broken", "missing"):
    settings = scene.light_from_photo
    settings.image = bpy.data.images.new("missing", 8, 8)
    settings.image.source, settings.image.filepath = "FILE", order[key]
    found[key] = estimate()
settings.image = None
found["after_failures"] = names()

bpy.ops.ed.undo_push(message="before")
settings.image = bpy.data.images.load(order["photo"])
bpy.ops.ed.undo_push(message="photo")
found["estimate"] = estimate()
scene = bpy.context.scene
found["made"] = names()
found["said"] = scene.light_from_photo.said
found["balls"] = balls()
found["old_world_kept"] = bpy.data.worlds[found["before"]["world"]].use_fake_user
turn = np.array(scene.camera.matrix_world.to_3x3())
found["turn"], found["place"] = turn.tolist(), list(scene.camera.location)
found["fov_deg"] = math.degrees(scene.camera.data.angle)
found["background"] = scene.camera.data.background_images[0].image.name
found["suns"] = suns()
bpy.ops.ed.undo()
found["undone"] = names()
bpy.ops.ed.redo()
found["redone"] = names()
found["again"] = estimate()
found["made_again"] = names()
bpy.ops.wm.save_as_mainfile(filepath=str(scratch / "kept.blend"))
found["left_behind"] = sorted(one.name for one in scratch.iterdir() if one.name.startswith("light_from_photo"))
bpy.ops.wm.open_mainfile(filepath=str(scratch / "kept.blend"))
found["reopened"] = names()
found["balls_reopened"] = balls()
found["shadow"] = shadow(scratch)
found["lit"] = {"SUN": lit(order["normals"], turn, scratch)}
for lights in ("AREA", "WORLD"):
    bpy.context.scene.camera = bpy.data.objects["Camera"]
    estimate(lights=lights, distance=100)
    found["lit"][lights] = lit(order["normals"], turn, scratch)

bpy.ops.wm.read_homefile(use_factory_startup=True)
install(archive)
scene = bpy.context.scene
settings = scene.light_from_photo
scene.camera.rotation_euler = (1.2, 0.3, -0.7)
settings.image = bpy.data.images.load(order["photo"])
found["with_camera"] = estimate(use_camera=False, pitch=0.1, use_pitch=True)
scene = bpy.context.scene
found["kept_camera"] = [scene.camera.name, np.array(scene.camera.matrix_world.to_3x3()).tolist()]
found["kept_camera_suns"] = suns()

settings = scene.light_from_photo
settings.image = bpy.data.images.load(order["turned"])
box = (200.0, 100.0, 460.0, 400.0)
settings.use_box, settings.box = True, box
found["turned"] = estimate()
settings = bpy.context.scene.light_from_photo
found["turned_box"] = [settings.use_box, list(settings.box) == list(box)]
settings.use_box = False
found["upright"] = [settings.image.name, list(settings.image.size)]
found["marks"] = marked()
settings.image = bpy.data.images.load(order["movie"])
found["movie"] = estimate(frame=40)
found["movie_beyond"] = estimate(frame=4000)

settings.image = bpy.data.images.load(order["photo"])
found["matched"] = {"result": estimate(library=order["library"], lights="WORLD", use_camera=True)}
world, camera = bpy.context.scene.world, bpy.context.scene.camera
(panorama,) = (one.image for one in world.node_tree.nodes if one.type == "TEX_ENVIRONMENT")
values = np.array(panorama.pixels[:], np.float32).reshape(panorama.size[1], panorama.size[0], -1)[::-1, :, :3]
blocks = values.reshape(16, values.shape[0] // 16, 32, values.shape[1] // 32, 3).mean(axis=(1, 3))
found["matched"] |= {
    "said": bpy.context.scene.light_from_photo.said,
    "map": blocks.tolist(),
    "turn": np.array(camera.matrix_world.to_3x3()).tolist(),
}
bpy.context.scene.light_from_photo.library = ""

again = estimate(use_camera=False, lights="WORLD", library="")
drawn = [
    one.name for one in bpy.data.images if one.name.partition(" of ")[0] in {"Object", "Chrome ball", "Matte ball"}
]
found["own_camera"] = [again, bpy.context.scene.camera is not None, drawn]
bpy.context.scene.light_from_photo.use_camera = True

source_of, paths = sys.modules[f"{MODULE}.photos"].source_of, []
for value in (0.2, 0.8):
    packed = bpy.data.images.new("packed", 8, 8)
    packed.pixels.foreach_set([value] * 4 * 64)
    packed.pack()
    paths.append(source_of(packed, 1, scratch)["file"])
found["packed"] = [len(set(paths)), len({Path(one).read_bytes() for one in paths})]

process = sys.modules[f"{MODULE}.process"]
running = process.Process({"do": "estimate"})
folder = running.folder
running.close()
found["cancelled"] = [running.running(), folder.exists()]

bpy.ops.preferences.addon_disable(module=MODULE)
found["disabled"] = [hasattr(bpy.types.Scene, "light_from_photo"), hasattr(bpy.types, "LIGHT_FROM_PHOTO_PT_world")]
bpy.ops.preferences.addon_enable(module=MODULE)
found["enabled"] = [hasattr(bpy.types.Scene, "light_from_photo"), hasattr(bpy.types, "LIGHT_FROM_PHOTO_PT_world")]
bpy.context.scene.light_from_photo.image = bpy.data.images.load(order["photo"])
found["after_reload"] = estimate()
Path(answer).write_text(json.dumps(found))
