# SPDX-License-Identifier: GPL-3.0-or-later
"""An estimate in the scene: World, light sources, shadow catcher, camera. The user's own are kept."""

import math
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

OWN = "light_from_photo"
"""Custom property of what is made here; a second estimate replaces the first one's objects."""

DRAWN = "Object of ", "Chrome ball of ", "Matte ball of "
"""How the names of an estimate's pictures begin that are looked at alone."""

GROUND_HEIGHTS = 30
"""Half the side of the shadow catcher, in heights of the camera."""

MOST_PIXELS = 1920
"""Of the longer side of a render; a larger photo sets a percentage."""


def is_own(block) -> bool:
    return block is not None and OWN in block


def foreign_lights(scene) -> list[str]:
    """Names of lights that shine beside the estimate's."""
    return sorted(one.name for one in scene.objects if one.type == "LIGHT" and not is_own(one) and not one.hide_render)


def heading_deg(camera) -> float:
    """Of where a camera looks, degrees left of +Y seen from above; 0 without one, or where it looks straight down."""
    if camera is None:
        return 0.0
    forward = camera.matrix_world.to_3x3() @ Vector((0, 0, -1))
    if forward.xy.length < 1e-3:
        forward = camera.matrix_world.to_3x3() @ Vector((0, 1, 0))
    return math.degrees(math.atan2(-forward.x, forward.y))


def build(scene, settings, found: dict, folder: Path, name: str) -> None:
    """Everything that the settings ask for, of an answer of worker.estimate.

    The object of the photo stands at the 3D cursor, and the ground goes through it.
    """
    # the light was turned by the scene's camera, which may be an earlier estimate's
    remove_own(scene, keep=None if settings.use_camera else scene.camera)
    collection = bpy.data.collections.new(f"Light of {name}")
    collection[OWN] = True
    scene.collection.children.link(collection)
    foot, height = scene.cursor.location.copy(), settings.size / found["object_size"]
    make_world(scene, found, folder, name, separate=settings.lights != "WORLD")
    if settings.lights != "WORLD":
        for index, source in enumerate(found["sources"]):
            make_source(collection, source, f"{name} source {index + 1}", settings, foot)
    if settings.use_catcher:
        make_catcher(scene, collection, foot, height, name)
    if settings.use_camera:
        make_camera(scene, collection, found, settings.image, foot, height, name)
    if not (settings.use_camera and settings.use_composite and composite_over_photo(scene, settings.image)):
        stop_compositing(scene)
    settings.chrome = settings.matte = None
    for one in [image for image in bpy.data.images if is_own(image) and image.name.startswith(DRAWN)]:
        if one.users <= 1:  # its own fake one
            bpy.data.images.remove(one)
    outline = load(folder / found["object"], f"Object of {name}", "sRGB")
    outline.use_fake_user = True
    settings.chrome = load_ball(folder / found["chrome"], f"Chrome ball of {name}")
    settings.matte = load_ball(folder / found["matte"], f"Matte ball of {name}")


def remove_own(scene, keep=None) -> None:
    """An earlier estimate's objects, but for one; its lights would count twice."""
    for collection in [one for one in scene.collection.children_recursive if is_own(one)]:
        for one in list(collection.objects):
            if is_own(one) and one != keep:
                bpy.data.objects.remove(one)
        if not collection.objects and not collection.children:
            bpy.data.collections.remove(collection)


def load(path: Path, name: str, space: str):
    """A picture, packed, so that it stays when the folder goes."""
    image = bpy.data.images.load(str(path))
    image.name = name
    image.colorspace_settings.name = space
    image.pack()
    image.filepath_raw = f"//{name}{path.suffix}"
    image[OWN] = True
    return image


def load_ball(path: Path, name: str):
    """A ball's picture with itself as its preview, which the panel shows at once."""
    image = load(path, name, "sRGB")
    preview = image.preview_ensure()
    preview.image_size = image.size
    preview.image_pixels_float.foreach_set(image.pixels[:])
    return image


def make_world(scene, found: dict, folder: Path, name: str, separate: bool) -> None:
    """A World of the map. With separate sources the camera still sees all of it; the rest is lit by what they leave."""
    if scene.world is not None and not is_own(scene.world):
        scene.world.use_fake_user = True
    world = bpy.data.worlds.new(f"Light of {name}")
    world[OWN] = True
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputWorld")
    output.location = 900, 0
    maps = [("full", "Map of {}", 0)]
    if separate and found["sources"]:
        maps.append(("rest", "Map of {} without sources", -320))
    shaders = []
    for key, title, top in maps:
        picture = nodes.new("ShaderNodeTexEnvironment")
        picture.image = load(folder / found[key], title.format(name), "Linear Rec.709")
        picture.location = 0, top
        background = nodes.new("ShaderNodeBackground")
        background.location = 320, top
        links.new(picture.outputs["Color"], background.inputs["Color"])
        shaders.append(background.outputs[0])
    if len(shaders) == 1:
        links.new(shaders[0], output.inputs["Surface"])
    else:
        mix, rays = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeLightPath")
        mix.location, rays.location = (620, 0), (320, 420)
        links.new(rays.outputs["Is Camera Ray"], mix.inputs[0])
        links.new(shaders[1], mix.inputs[1])
        links.new(shaders[0], mix.inputs[2])
        links.new(mix.outputs[0], output.inputs["Surface"])
    scene.world = world


def make_source(collection, source: dict, name: str, settings, foot) -> None:
    """A Sun or a disc of the source's direction, irradiance at the object, and diameter as seen from there."""
    irradiance = max(source["irradiance"])
    towards, half = Vector(source["towards"]), math.radians(source["angle_deg"]) / 2
    if settings.lights == "SUN":
        light = bpy.data.lights.new(name, "SUN")
        light.angle = 2 * half
        light.energy = irradiance
        place = foot + towards * settings.distance
    else:
        light = bpy.data.lights.new(name, "AREA")
        light.shape = "DISK"
        radius = settings.distance * math.tan(min(half, math.radians(80)))
        light.size = 2 * radius
        light.energy = math.pi * irradiance * (radius**2 + settings.distance**2)  # E = pi L sin^2, P = pi A L
        place = foot + towards * settings.distance
    light.color = [value / irradiance for value in source["irradiance"]]
    lamp = add(collection, name, light)
    lamp.location = place
    lamp.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()  # it shines along its own -Z


def make_catcher(scene, collection, foot, height: float, name: str) -> None:
    """A plane that receives shadows alone: the map already holds the light that the ground sends up."""
    half = GROUND_HEIGHTS * height
    mesh = bpy.data.meshes.new(f"Ground of {name}")
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    plane = add(collection, f"Ground of {name}", mesh)
    plane.location = foot
    plane.display_type = "WIRE"  # the photo's own ground is seen through it
    plane.is_shadow_catcher = True
    plane.visible_diffuse = plane.visible_glossy = plane.visible_transmission = plane.visible_shadow = False
    scene.render.film_transparent = True


def make_camera(scene, collection, found: dict, image, foot, height: float, name: str) -> None:
    """The photo's camera so high over its ground, the object's foot at `foot`, and renders of the photo's shape."""
    camera = bpy.data.cameras.new(f"Camera of {name}")
    camera.sensor_fit = "AUTO"
    camera.angle = math.radians(found["long_fov_deg"])
    behind = camera.background_images.new()
    behind.image = image
    behind.alpha = 1.0
    if image.source in {"MOVIE", "SEQUENCE"}:
        behind.image_user.frame_start = 1
        behind.image_user.frame_duration = max(image.frame_duration, 1)
    camera.show_background_images = True
    camera.passepartout_alpha = 0.9
    seen = add(collection, f"Camera of {name}", camera)
    place = foot - Vector(found["foot"]) * height
    seen.matrix_world = Matrix.Translation(place) @ Matrix(found["turn"]).to_4x4()
    distance = (Vector(found["foot"]) * height).length
    camera.clip_start = min(camera.clip_start, distance / 100)
    camera.clip_end = max(camera.clip_end, distance * 20)
    scene.camera = seen
    scene.render.resolution_x, scene.render.resolution_y = found["size"]
    scene.render.resolution_percentage = min(100, max(1, round(100 * MOST_PIXELS / max(found["size"]))))
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1


def add(collection, name: str, data):
    one = bpy.data.objects.new(name, data)
    one[OWN] = True
    collection.objects.link(one)
    return one


def composited(scene) -> bool:
    """Whether the scene has compositing nodes of the user's, which stay as they are."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        return scene.compositing_node_group is not None and not is_own(scene.compositing_node_group)
    return scene.node_tree is not None and not is_own(scene.node_tree) and len(scene.node_tree.nodes) > 0


def stop_compositing(scene) -> None:
    """Nodes of an earlier estimate would put renders over its photo."""
    if hasattr(scene, "compositing_node_group"):
        if scene.compositing_node_group is not None and is_own(scene.compositing_node_group):
            scene.compositing_node_group = None
    elif scene.node_tree is not None and is_own(scene.node_tree):
        scene.use_nodes = False


def composite_over_photo(scene, image) -> bool:
    """Renders over the photo; False where the user composites already."""
    if composited(scene):
        return False
    if hasattr(scene, "compositing_node_group"):
        tree = bpy.data.node_groups.new("Over photo", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        end = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        end = tree.nodes.new("CompositorNodeComposite")
    tree[OWN] = True
    layers, photo = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeImage")
    scale, over = tree.nodes.new("CompositorNodeScale"), tree.nodes.new("CompositorNodeAlphaOver")
    photo.image = image
    if image.source in {"MOVIE", "SEQUENCE"}:
        photo.frame_duration = max(image.frame_duration, 1)
    layers.scene = scene
    if hasattr(scale, "space"):
        scale.space, scale.frame_method = "RENDER_SIZE", "STRETCH"
    else:
        scale.inputs["Type"].default_value, scale.inputs["Frame Type"].default_value = "Render Size", "Stretch"
    for index, node in enumerate((photo, scale, over, end)):
        node.location = 260 * index, 0
    layers.location = 260, -300
    behind, before = [one for one in over.inputs if one.type == "RGBA"]
    tree.links.new(photo.outputs["Image"], scale.inputs["Image"])
    tree.links.new(scale.outputs["Image"], behind)
    tree.links.new(layers.outputs["Image"], before)
    tree.links.new(over.outputs["Image"], end.inputs["Image"])
    scene.render.film_transparent = True  # else the World is drawn over the photo
    return True
