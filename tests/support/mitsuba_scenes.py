"""Our meshes, cameras and maps in Mitsuba 3, in our frames.

mi = open_mitsuba()
scene = mitsuba_scene(mesh, camera, radiance, paper_bsdf(material))
picture = render(scene, spp=64)                      # Mitsuba's own camera and film
samples, hit = trace(scene, pixel_centres(size), spp=1024, seed=0)  # at points of the picture
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from functools import lru_cache
from glob import glob

import numpy as np

from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera
from anyprobe.scatter.materials import Material

LLVM = "/usr/lib/*/libLLVM-*.so"
OLDEST_LLVM = 17
"""Version 14 and 16 of Debian end the whole process on machines with AVX-512."""

TURN = np.diag([-1.0, 1.0, -1.0])
"""Half a turn about +Y: Mitsuba's map has +Z in its middle and its cameras look along +Z, ours -Z."""


class NoMitsuba(RuntimeError):
    """Why Mitsuba cannot be used here."""


@lru_cache(maxsize=1)
def open_mitsuba():
    """The module `mitsuba` with the variant llvm_ad_rgb and our plugins, or NoMitsuba.

    An LLVM that does not fit ends the process, so that another process tries it first.
    """
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        versions = {int(m[1]): p for p in glob(LLVM) if (m := re.search(r"libLLVM-(\d+)\.so$", p))}
        if versions and max(versions) < OLDEST_LLVM:
            raise NoMitsuba(f"LLVM {OLDEST_LLVM} or newer is needed (apt-get install libllvm19)")
        if versions:
            os.environ["DRJIT_LIBLLVM_PATH"] = versions[max(versions)]
    trial = (
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; "
        "assert dr.sum(mi.Float([1, 2, 3]))[0] == 6"
    )
    tried = subprocess.run([sys.executable, "-c", trial], capture_output=True, text=True, check=False)
    if tried.returncode:
        last = (tried.stderr.strip().splitlines() or ["the process was ended"])[-1]
        raise NoMitsuba(
            f"Mitsuba 3 with LLVM {OLDEST_LLVM} or newer is needed "
            f"(pip install mitsuba; apt-get install libllvm19): {last}"
        )
    import drjit
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    if drjit.thread_count() < 2:  # on a single core the load of an XML scene would never end
        drjit.set_thread_count(2)
    import support.mitsuba_plugins  # noqa: F401  registers them

    return mi


def paper_bsdf(material: Material, correlated: bool = True) -> dict:
    """Eq. 2 with our material; support.mitsuba_plugins has the formula."""
    albedo, f0 = ([float(x) for x in np.broadcast_to(c, 3)] for c in (material.albedo, material.f0))
    return {"type": "paper", "albedo": albedo, "f0": f0, "alpha": float(material.alpha), "correlated": correlated}


def perfect_metal(alpha: float) -> dict:
    """Mitsuba's roughconductor with F = 1; its G is the product of two G1, ours is height-correlated."""
    return {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": float(alpha)}


def sensor(camera: Camera, spp: int = 16) -> dict:
    """The perspective camera that takes our Camera's picture, a box the width of a pixel as filter."""
    mi = open_mitsuba()
    to_world = np.eye(4)
    to_world[:3, :3] = camera.world_from_camera @ TURN
    to_world[:3, 3] = camera.position
    return {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f(to_world),
        "fov": float(np.degrees(2.0 * np.arctan(camera.tan_half))),
        "fov_axis": "x",
        "near_clip": 0.01,
        "film": {
            "type": "hdrfilm",
            "width": camera.size,
            "height": camera.size,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent", "sample_count": spp},
    }


def environment(radiance: np.ndarray) -> dict:
    """Our latitude-longitude map [H, 2H, 3] around the world, exactly.

    Mitsuba's columns lie at (j + 0.5) / W as ours do, but its rows at i / (rows - 1), pole to
    pole. Our bilinear map has its corners at (i + 0.5) / H and is flat beyond the first and last
    row: 2H + 1 rows, read between ours, hold the same function.
    """
    mi = open_mitsuba()
    height = radiance.shape[0]
    rows = np.clip(np.arange(2 * height + 1) / 2.0 - 0.5, 0, height - 1)
    low, high = np.floor(rows).astype(int), np.ceil(rows).astype(int)
    bitmap = mi.Bitmap(np.ascontiguousarray((radiance[low] + radiance[high]) / 2.0, np.float32))
    to_world = np.eye(4)
    to_world[:3, :3] = TURN
    return {"type": "envmap", "bitmap": bitmap, "to_world": mi.ScalarTransform4f(to_world)}


def shape(mesh: Mesh, bsdf: dict):
    """Our triangles with the normals of their corners: every corner a vertex of its own."""
    mi = open_mitsuba()
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    count = len(mesh.faces)
    made = mi.Mesh("mesh", 3 * count, count, has_vertex_normals=True, props=properties)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = mesh.positions[mesh.faces].ravel()
    parameters["vertex_normals"] = mesh.normals.ravel()
    parameters["faces"] = np.arange(3 * count, dtype=np.uint32)
    parameters.update()
    return made


def mitsuba_scene(
    mesh: Mesh | None, camera: Camera, radiance: np.ndarray, bsdf: dict, spp: int = 16, integrator: dict | None = None
):
    """A scene of one object of one material, ready for render and trace.

    Args:
        mesh: None for Mitsuba's own unit sphere at the origin.
        radiance: [H, 2H, 3] in the world's frame.
        bsdf: paper_bsdf, perfect_metal or any dictionary of Mitsuba's.
        integrator: direct light without shadows unless given; the background stays black
            with `{"type": "direct", "hide_emitters": True}` and the like.
    """
    mi = open_mitsuba()
    sphere = {"type": "sphere", "bsdf": bsdf}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator or {"type": "unshadowed"},
            "sensor": sensor(camera, spp),
            "light": environment(radiance),
            "object": sphere if mesh is None else shape(mesh, bsdf),
        }
    )


def render(scene, spp: int, seed: int = 0) -> np.ndarray:
    """[S, S, 3] linear: every pixel the mean of spp samples spread over its area."""
    return np.asarray(open_mitsuba().render(scene, spp=spp, seed=seed))


def pixel_centres(size: int) -> np.ndarray:
    """Positions [S * S, 2] in [0, 1]^2 on the film, row by row."""
    at = (np.arange(size) + 0.5) / size
    return np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)


def camera_rays(scene, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions [P, 3] of the scene's own camera at positions [P, 2] on its film."""
    mi = open_mitsuba()
    position = mi.Point2f(*np.asarray(at, np.float32).T)
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, position, mi.Point2f(0.5))
    return np.array(ray.o).T, np.array(ray.d).T


def surface_at(scene, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether the camera sees the object at [P, 2], and its shading normal in the world [P, 3]."""
    mi = open_mitsuba()
    hit = scene.ray_intersect(_rays(mi, *camera_rays(scene, at)))
    return np.array(hit.is_valid()), np.array(hit.sh_frame.n).T


def trace(scene, at: np.ndarray, spp: int, seed: int, integrator: dict | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Samples of the radiance seen at exactly [P, 2]: ([P, spp, 3], which of them hit [P, spp]).

    spp a square: the samples of a pixel are multi-jittered, so that only different
    seeds are independent of each other.
    """
    mi = open_mitsuba()
    origin, direction = (np.repeat(v, spp, axis=0) for v in camera_rays(scene, at))
    sampler = mi.load_dict({"type": "multijitter", "sample_count": spp})
    sampler.set_samples_per_wavefront(spp)
    sampler.seed(seed, len(origin))
    tracer = scene.integrator() if integrator is None else mi.load_dict(integrator)
    radiance, hit, _ = tracer.sample(scene, sampler, _rays(mi, origin, direction))
    return np.array(radiance).T.reshape(-1, spp, 3), np.array(hit).reshape(-1, spp)


def _rays(mi, origin: np.ndarray, direction: np.ndarray):
    return mi.RayDifferential3f(mi.Point3f(*origin.T), mi.Vector3f(*direction.T))
