"""Run by the Python that has bpy: import a .glb, and write the suns that Blender makes of its lights.

python blender_gltf_lights.py light.glb MODE answer.json

MODE: of the importer's Lighting Mode; the answer has the name that its menu shows.
"""

import json
import sys
from pathlib import Path

import bpy
from mathutils import Vector

path, mode, answer = sys.argv[1:4]
bpy.ops.wm.read_factory_settings(use_empty=True)
modes = bpy.ops.import_scene.gltf.get_rna_type().properties["export_import_convert_lighting_mode"].enum_items
bpy.ops.import_scene.gltf(filepath=path, export_import_convert_lighting_mode=mode)
suns = [
    {
        "towards": list(one.matrix_world.to_quaternion() @ Vector((0, 0, 1))),
        "energy": one.data.energy,
        "color": list(one.data.color),
    }
    for one in bpy.data.objects
    if one.type == "LIGHT"
]
Path(answer).write_text(json.dumps({"mode": modes[mode].name, "suns": suns}))
