"""Run by the Python that has bpy: a matt, a silver and a mirror sphere, each alone under an export.

python blender_each_sphere.py script.py size answer.npy

The script is opened in the text editor and run there, as docs/how-to/export.md says. Every sphere fills the
picture of an orthographic camera that looks along +Y; answer.npy holds [3, size, size, 3], linear.
"""

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

script, size, answer = Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.device = "CPU"
scene.cycles.samples = 32
scene.cycles.use_denoising = False
scene.render.threads_mode, scene.render.threads = "FIXED", 1
scene.render.resolution_x = scene.render.resolution_y = size
scene.render.filter_size = 0.01
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
eye.location, eye.rotation_euler = (0, -5, 0), (np.pi / 2, 0, 0)
eye.data.type, eye.data.ortho_scale = "ORTHO", 2
scene.collection.objects.link(eye)
scene.camera = eye
bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64)
bpy.ops.object.shade_smooth()
sphere = bpy.context.object

text = bpy.data.texts.load(str(script))
where = str(Path(bpy.data.filepath) / text.name)  # what Run Script takes for the file
exec(compile(text.as_string(), where, "exec"), {"__name__": "__main__", "__file__": where})

pictures = []
for shader, color, alpha in (("Diffuse", 1.0, None), ("Glossy", 0.9, 0.3), ("Glossy", 1.0, 0.0)):
    material = bpy.data.materials.new(shader)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    bsdf = nodes.new(f"ShaderNodeBsdf{shader}")
    bsdf.inputs["Color"].default_value = (color, color, color, 1)
    if alpha is not None:
        bsdf.distribution = "GGX"
        bsdf.inputs["Roughness"].default_value = alpha**0.5
    output = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(bsdf.outputs[0], output.inputs[0])
    sphere.data.materials.clear()
    sphere.data.materials.append(material)
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "seen.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        rows = np.array(image.pixels[:], np.float32).reshape(size, size, -1)[::-1, :, :3]
        pictures.append(rows.copy())
        bpy.data.images.remove(image)
np.save(answer, np.stack(pictures))
