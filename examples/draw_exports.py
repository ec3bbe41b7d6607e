"""Draw docs/export/*.png: the same light exported to every target that can be run here, and shown by it.

    python examples/draw_exports.py [TARGET...]

Three spheres (white, rough metal, mirror) before the map, seen along -Z. tests/README.md says what each
target needs. What cannot run is named and left as it is.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe import estimate
from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.export.targets import export
from anyprobe.maps.radiance import read_radiance
from anyprobe.render.spheres import sphere_images, sphere_normals

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs" / "export"
LIGHT = ROOT / "examples" / "vase_truth.exr"
SIZE = (480, 180)


def draw_mitsuba(radiance: np.ndarray, folder: Path) -> np.ndarray:
    """Display values [180, 480, 3] of the exported scene as it is."""
    from support.mitsuba_scenes import open_mitsuba

    mi = open_mitsuba()
    path = _exported(radiance, "mitsuba", folder, ".xml")
    return response(np.array(mi.render(mi.load_file(str(path)), spp=128)))


def draw_blender(radiance: np.ndarray, folder: Path) -> np.ndarray:
    """The exported script run in a scene of three spheres, by Cycles."""
    seen = folder / "seen.exr"
    _run_blender("blender_spheres.py", _exported(radiance, "blender", folder, ".py"), seen)
    return response(_read_picture(seen))


def draw_usd(radiance: np.ndarray, folder: Path) -> np.ndarray:
    """The exported stage, everything in its dome, imported by Blender."""
    seen, stage = folder / "seen.exr", _exported(radiance, "usd", folder, ".usda")
    stage.write_text(stage.read_text().replace('mainLight = "separate"', 'mainLight = "inTheDome"'))
    _run_blender("blender_spheres.py", stage, seen)
    return response(_read_picture(seen))


def draw_beside(_: np.ndarray, folder: Path) -> np.ndarray:
    """The example photo's estimate: our own spheres, and below them Blender's."""
    light = estimate(ROOT / "examples" / "vase.png")
    size = 128
    path = next(p for p in light.export("blender", folder, "vase") if p.suffix == ".py")
    _run_blender("blender_each_sphere.py", path, size, folder / "spheres.npy")
    mask = sphere_normals(size)[1][..., None]
    rows = [list(sphere_images(light.radiance, size).values()), list(np.load(folder / "spheres.npy"))]
    return np.vstack([np.hstack([np.where(mask, response(sphere), 1.0) for sphere in row]) for row in rows])


def draw_gltf(radiance: np.ndarray, folder: Path) -> np.ndarray:
    """Babylon.js with the exported .glb."""
    from support.browser import FOLDER, NODE_MODULES, run_steps, serve

    path = _exported(radiance, "gltf", folder, ".glb")
    modules = Path(os.environ.get("ANYPROBE_BABYLON", NODE_MODULES))
    with serve({"/": FOLDER, "/export/": folder, "/node_modules/": modules}) as url:
        rgb = run_steps("babylon_balls.mjs", url, {"file": path.name, "size": SIZE}, timeout_s=400)
    return response(np.reshape(np.array(rgb, np.float32), (SIZE[1], SIZE[0], 3)))


def draw_in_browser(target: str) -> Callable[[np.ndarray, Path], np.ndarray]:
    """three.js with the exported files; probe shows nine SH numbers and the sun."""

    def draw(radiance: np.ndarray, folder: Path) -> np.ndarray:
        from support.browser import FOLDER, NODE_MODULES, run_steps, serve

        export(radiance, {"probe": "three"}.get(target, target), folder, "vase")
        asked = {"target": target, "name": "vase", "size": SIZE}
        with serve({"/": FOLDER, "/export/": folder, "/node_modules/": NODE_MODULES}) as url:
            rgb = run_steps("three_balls.mjs", url, asked, timeout_s=400)
        return response(np.reshape(np.array(rgb, np.float32), (SIZE[1], SIZE[0], 3)))

    return draw


DRAW = {
    "mitsuba": draw_mitsuba,
    "blender": draw_blender,
    "blender_beside": draw_beside,
    "usd": draw_usd,
    "gltf": draw_gltf,
    **{target: draw_in_browser(target) for target in ("three", "probe", "cube", "ktx2")},
}


def _exported(radiance: np.ndarray, target: str, folder: Path, suffix: str) -> Path:
    return next(p for p in export(radiance, target, folder, "vase") if p.suffix == suffix)


def _run_blender(script: str, *arguments: object) -> None:
    python = os.environ.get("ANYPROBE_BPY", sys.executable)
    order = [python, str(ROOT / "tests" / "support" / script), *map(str, arguments)]
    subprocess.run(order, check=True, stdout=subprocess.DEVNULL)


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
                picture = DRAW[target](radiance, Path(name))
            except Exception as error:
                print(f"{target}: {str(error).splitlines()[-1]}", file=sys.stderr)
                continue
        image = Image.fromarray(to_bytes(picture))
        image = image.quantize(palette=image.quantize(256), dither=Image.Dither.FLOYDSTEINBERG)
        image.save(DOCS / f"{target}.png", optimize=True)
        print(json.dumps({"target": target, "bytes": (DOCS / f"{target}.png").stat().st_size}))


if __name__ == "__main__":
    main(sys.argv[1:] or list(DRAW))
