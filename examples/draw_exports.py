"""Draw docs/export/*.png: the same light exported to every target that can be run here, and shown by it.

    python examples/draw_exports.py [TARGET...]

Three balls (white, rough metal, mirror) before the map, seen along -Z. three, gltf and the cubes need
what tests/browser says, blender a python with bpy (ANYPROBE_BPY), mitsuba the extra `judge`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.export.targets import export
from anyprobe.files.radiance import read_radiance

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs" / "export"
LIGHT = ROOT / "examples" / "vase_truth.exr"
SIZE = (480, 180)


def draw_mitsuba(radiance: np.ndarray, folder: Path) -> np.ndarray:
    """Display values [180, 480, 3] of the exported scene as it is."""
    from support.mitsuba_scenes import open_mitsuba

    mi = open_mitsuba()
    path = next(p for p in export(radiance, "mitsuba", folder, "vase") if p.suffix == ".xml")
    return response(np.array(mi.render(mi.load_file(str(path)), spp=128)))


def draw_blender(radiance: np.ndarray, folder: Path) -> np.ndarray:
    """The exported script run in a scene of three balls, by Cycles."""
    path = next(p for p in export(radiance, "blender", folder, "vase") if p.suffix == ".py")
    seen = folder / "seen.exr"
    python = os.environ.get("ANYPROBE_BPY", sys.executable)
    script = ROOT / "tests" / "support" / "blender_balls.py"
    subprocess.run([python, str(script), str(path), str(seen)], check=True, stdout=subprocess.DEVNULL)
    return response(_read_picture(seen))


def draw_in_browser(target: str, radiance: np.ndarray, folder: Path) -> np.ndarray:
    """three.js with the exported files; probe shows nine SH numbers and the sun."""
    from support.browser import FOLDER, NODE_MODULES, run_steps, serve

    export(radiance, {"probe": "three"}.get(target, target), folder, "vase")
    with serve({"/": FOLDER, "/export/": folder, "/node_modules/": NODE_MODULES}) as url:
        pixels = run_steps(
            "three_balls.mjs", url, {"target": target, "name": "vase", "size": SIZE}, timeout_s=400
        )
    return response(np.reshape(np.array(pixels, np.float32), (SIZE[1], SIZE[0], 3)))


def _read_picture(path: Path) -> np.ndarray:
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        name = next(key for key in channels if key.startswith("RGB"))
        return channels[name].pixels[..., :3].astype(np.float32)


def main(targets: list[str]) -> None:
    """One picture a target; what cannot run is said and left out."""
    sys.path.insert(0, str(ROOT / "tests"))
    radiance = read_radiance(LIGHT)
    DOCS.mkdir(exist_ok=True)
    for target in targets:
        with tempfile.TemporaryDirectory() as name:
            try:
                draw = {"mitsuba": draw_mitsuba, "blender": draw_blender}.get(target)
                picture = (
                    draw(radiance, Path(name)) if draw else draw_in_browser(target, radiance, Path(name))
                )
            except Exception as error:
                print(f"{target}: {str(error).splitlines()[-1]}", file=sys.stderr)
                continue
        image = Image.fromarray(to_bytes(picture)).quantize(128, dither=Image.Dither.FLOYDSTEINBERG)
        image.save(DOCS / f"{target}.png", optimize=True)
        print(json.dumps({"target": target, "bytes": (DOCS / f"{target}.png").stat().st_size}))


if __name__ == "__main__":
    main(sys.argv[1:] or ["mitsuba", "three", "probe", "cube", "ktx2", "dds", "blender"])
