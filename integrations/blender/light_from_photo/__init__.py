# SPDX-License-Identifier: GPL-3.0-or-later
"""Light from photo: the World, suns, ground and camera of one photo of an object."""

import bpy

from . import estimating, marking, panels, settings

CLASSES = (*settings.CLASSES, *marking.CLASSES, *estimating.CLASSES, *panels.CLASSES)


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.light_from_photo = bpy.props.PointerProperty(type=settings.LightFromPhotoSettings)


def unregister():
    estimating.stop()
    marking.stop()
    del bpy.types.Scene.light_from_photo
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
