# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sets, kept with the scene."""

import json
from math import radians
from pathlib import Path

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import process

INPUTS = json.loads((Path(__file__).parent / "inputs.json").read_text(encoding="utf-8"))
"""Text and bounds of each input of an estimate, as the library describes it."""

MATERIALS: list[str] = []
"""Names that the library knows, asked for once."""


def material_names(_settings, _context, typed):
    if not MATERIALS:
        try:
            MATERIALS.extend(process.ask({"do": "materials"})["materials"])
        except process.Failed:
            return []
    return [name for name in MATERIALS if typed.lower() in name.lower()]


def forget_marks(settings, _context):
    """The object's place is another photo's."""
    settings.marks.clear()
    settings.use_box = False
    settings.mask = None
    settings.said = ""


def only_pictures(_settings, image):
    return image.source in {"FILE", "SEQUENCE", "MOVIE", "GENERATED"} and image.type not in {
        "RENDER_RESULT",
        "COMPOSITING",
    }


class Mark(bpy.types.PropertyGroup):
    """A click in pixels of the photo from its top left."""

    at: FloatVectorProperty(size=2)
    beside: BoolProperty()


class LightFromPhotoSettings(bpy.types.PropertyGroup):
    image: PointerProperty(
        name="Photo",
        description="Photo or movie of an object of one material",
        type=bpy.types.Image,
        poll=only_pictures,
        update=forget_marks,
    )
    frame: IntProperty(name="Frame", description="Frame of the movie", default=1, min=1, update=forget_marks)
    marks: CollectionProperty(type=Mark)
    use_box: BoolProperty(name="Box")
    box: FloatVectorProperty(size=4)
    mask: PointerProperty(name="Mask", description=INPUTS["mask"]["help"], type=bpy.types.Image, poll=only_pictures)

    material: StringProperty(
        name="Material", description=INPUTS["material"]["help"], search=material_names, search_options={"SUGGESTION"}
    )
    use_albedo: BoolProperty(name="Albedo", description="The object's colour is known")
    albedo: FloatVectorProperty(
        name="Albedo",
        description=INPUTS["albedo"]["help"],
        subtype="COLOR",
        size=3,
        min=0,
        max=1,
        default=(0.5, 0.5, 0.5),
    )
    use_roughness: BoolProperty(name="Roughness", description="The object's roughness is known")
    roughness: FloatProperty(
        name="Roughness",
        description=INPUTS["roughness"]["help"],
        min=INPUTS["roughness"]["least"],
        max=INPUTS["roughness"]["most"],
        default=0.5,
    )
    is_sphere: BoolProperty(name="The object is a sphere", description="Its normals are then known")
    normals: PointerProperty(
        name="Normal map",
        description="The object's normals in the camera's frame, of the photo's size",
        type=bpy.types.Image,
        poll=only_pictures,
    )
    use_fov: BoolProperty(name="Field of view", description="Known, along the longer side; else from the file")
    fov: FloatProperty(name="Field of view", subtype="ANGLE", min=radians(2), max=radians(169), default=radians(60))
    use_pitch: BoolProperty(name="Pitch", description="How far the camera looked down is known; else it is estimated")
    pitch: FloatProperty(
        name="Pitch",
        description=INPUTS["pitch"]["help"],
        subtype="ANGLE",
        min=radians(INPUTS["pitch"]["least"]),
        max=radians(INPUTS["pitch"]["most"]),
        default=0,
    )
    use_background: BoolProperty(
        name="Use the photo's background",
        description="Also where it is one colour or the object is cut out; other photos' backgrounds are always used",
    )
    use_detail: BoolProperty(
        name="Panorama of the place",
        description="The photo without its object, and the estimate around it. Else the World is the smooth estimate",
    )

    library: StringProperty(
        name="My panoramas",
        description="Folder of .hdr and .exr maps: the one that lights most like the photo becomes the World",
        subtype="DIR_PATH",
    )
    lights: EnumProperty(
        name="Sources",
        items=(
            ("SUN", "Suns", "Each source becomes a Sun of its size, and leaves the World"),
            ("AREA", "Area lights", "Each source becomes a lamp at a distance, and leaves the World"),
            ("WORLD", "World only", "All light stays in the World"),
        ),
        default="SUN",
    )
    distance: FloatProperty(
        name="Distance", description="From the object to area lights", subtype="DISTANCE", min=0.01, default=3
    )
    use_catcher: BoolProperty(
        name="Shadow catcher", description="On the estimated ground, through the 3D cursor", default=True
    )
    use_camera: BoolProperty(
        name="Camera",
        description="A camera with the photo's field of view and pitch, and the photo as its background. Without it "
        "the light is turned with the scene's camera",
        default=True,
    )
    size: FloatProperty(
        name="Object's size",
        description="Longer side of the photo's object, which sets how far off and how high the camera stands. New "
        "meshes are 2 m",
        subtype="DISTANCE",
        min=0.001,
        default=2,
    )
    use_composite: BoolProperty(
        name="Composite over photo", description="Renders lie over the photo, by compositing nodes", default=True
    )
    chrome: PointerProperty(name="Chrome ball", type=bpy.types.Image)
    matte: PointerProperty(name="Matte ball", type=bpy.types.Image)
    """Under the last estimate, as the photo's camera sees them."""
    said: StringProperty()
    """What the last estimate said, lines."""


CLASSES = (Mark, LightFromPhotoSettings)
