"""Path tracing by Mitsuba 3, the judge of our renderer: a mesh shadows and mirrors itself."""

import os
import re
import subprocess
import sys
from functools import lru_cache
from glob import glob
from typing import Any

import numpy as np

from anyprobe.errors import MissingExtra
from anyprobe.export.scene_files import pole_to_pole
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera
from anyprobe.scatter.materials import Material

NAME = "anyprobe_material"


def register_material(mi) -> None:
    """Register NAME with the module `mitsuba`; its variant must be set, its base classes belong to it."""
    import drjit as dr

    class MaterialBSDF(mi.BSDF):
        """(1 - F) albedo / pi + D F G / (4 (n.wi)(n.wo)): GGX, Schlick, height-correlated Smith.

        Half of the samples come from the cosine, half from the visible normals; from the normals
        alone where there is no albedo.
        """

        def __init__(self, props):
            super().__init__(props)
            self.albedo = props["albedo"]  # a colour, or a texture
            self.textured = isinstance(self.albedo, mi.Texture)
            self.f0 = mi.Color3f(props["f0"])
            self.alpha = mi.Float(props["alpha"])
            self.cosine_share = mi.Float(0.5 if self.textured or max(self.albedo) > 0 else 0.0)
            if not self.textured:
                self.albedo = mi.Color3f(self.albedo)
                dr.make_opaque(self.albedo)
            dr.make_opaque(self.f0, self.alpha, self.cosine_share)  # else each material compiles its own kernel
            kind = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [kind]
            self.m_flags = kind

        def _normals(self):
            return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, sample_visible=True)

        def sample(self, ctx, si, sample1, sample2, active=True):
            h, _ = self._normals().sample(si.wi, sample2)
            by_cosine = sample1 < self.cosine_share
            drawn = mi.BSDFSample3f()
            drawn.wo = dr.select(by_cosine, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(si.wi, h))
            drawn.eta = 1.0
            drawn.sampled_component = 0
            drawn.sampled_type = +mi.BSDFFlags.GlossyReflection
            value, drawn.pdf = self.eval_pdf(ctx, si, drawn.wo, active)
            return drawn, dr.select(active & (drawn.pdf > 0), value / drawn.pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx, si, wo, active=True):
            n_dot_wi, n_dot_wo = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (n_dot_wi > 0) & (n_dot_wo > 0)
            h = dr.normalize(si.wi + wo)
            wi_dot_h = dr.dot(si.wi, h)
            normals = self._normals()
            g1_wi, g1_wo = normals.smith_g1(si.wi, h), normals.smith_g1(wo, h)
            g = dr.rcp(dr.rcp(g1_wi) + dr.rcp(g1_wo) - 1)
            fresnel = self.f0 + (1 - self.f0) * (1 - wi_dot_h) ** 5
            coat = fresnel * normals.eval(h) * g / (4 * n_dot_wi)
            albedo = self.albedo.eval(si, active) if self.textured else self.albedo
            base = (1 - fresnel) * albedo * dr.inv_pi * n_dot_wo
            pdf = self.cosine_share * mi.warp.square_to_cosine_hemisphere_pdf(wo)
            pdf += (1 - self.cosine_share) * normals.pdf(si.wi, h) / (4 * wi_dot_h)
            return dr.select(active, coat + base, 0), dr.select(active, pdf, 0)

    mi.register_bsdf(NAME, MaterialBSDF)


LLVM = "/usr/lib/*/libLLVM-*.so"
OLDEST_LLVM = 17
"""Oldest supported LLVM: older ones end the whole process on machines with AVX-512."""

TO_OURS = np.diag([-1.0, 1.0, -1.0])
"""Rotation by 180 degrees about +Y: Mitsuba's map has +Z in its middle and its camera looks along it, ours -Z."""

NUM_PATHS = 256
"""Number of paths per pixel."""
PATHS_AT_ONCE = 1 << 20
MAX_DEPTH = 6
ALBEDO = "vertex_albedo"
"""Mitsuba's name for albedos at the corners of the faces."""


@lru_cache(maxsize=1)
def open_mitsuba():
    """Import the module `mitsuba` and set its variant llvm_ad_rgb.

    Raises:
        MissingExtra: Mitsuba or a suitable LLVM is not installed.
    """
    if not mitsuba_runs():
        raise MissingExtra(f"mitsuba (and LLVM {OLDEST_LLVM} or newer, libllvm19)", "judge", "path tracing")
    import mitsuba as mi

    if mi.variant() != "llvm_ad_rgb":
        mi.set_variant("llvm_ad_rgb")
    register_material(mi)
    return mi


@lru_cache(maxsize=1)
def mitsuba_runs() -> bool:
    """Return whether Mitsuba and a suitable LLVM are installed; tried once.

    An unsuitable LLVM ends the process; therefore another process tries it.
    """
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        versions = {int(m[1]): p for p in glob(LLVM) if (m := re.search(r"libLLVM-(\d+)\.so$", p))}
        if versions and max(versions) < OLDEST_LLVM:
            return False  # the trial below would pass and the first scene would abort
        if versions:
            os.environ["DRJIT_LIBLLVM_PATH"] = versions[max(versions)]
    trial = (
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; "
        "assert dr.sum(mi.Float([1, 2, 3]))[0] == 6"
    )
    return not subprocess.run([sys.executable, "-P", "-c", trial], capture_output=True, check=False).returncode


def trace_mesh(
    mesh: Mesh, camera: Camera, radiance: np.ndarray, material: Material, num_paths: int = NUM_PATHS
) -> np.ndarray:
    """Draw a mesh as render.picture.draw_mesh does, by path tracing: same arguments and same [S, S, 4].

    Args:
        material: its albedo may also be [F, 3, 3], at the corners of the mesh's faces.
        num_paths: per pixel, rounded up to a power of two.
    """
    mi = open_mitsuba()
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = camera.world_from_camera @ TO_OURS, camera.position
    paths = 1 << (num_paths - 1).bit_length()
    most = min(paths, max(1, PATHS_AT_ONCE // camera.size**2))
    each = 1 << ((most.bit_length() - 1) // 2 * 2)  # a power of four: the sampler rounds others up to one
    film = {"type": "hdrfilm", "width": camera.size, "height": camera.size, "pixel_format": "rgba"}
    sensor = {
        "type": "perspective",
        "fov": 2 * float(np.degrees(np.arctan(camera.tan_half))),
        "near_clip": 1e-3,
        "to_world": mi.ScalarTransform4f(to_world),
        "film": film | {"component_format": "float32", "rfilter": {"type": "box"}},
        "sampler": {"type": "multijitter", "sample_count": each},
    }
    tracer = {"type": "path", "max_depth": MAX_DEPTH, "hide_emitters": True}
    lit = {"type": "scene", "mesh": _shape(mi, mesh, material), "light": _environment(mi, radiance)}
    scene = mi.load_dict({**lit, "sensor": sensor, "integrator": tracer})
    passes = [np.array(mi.render(scene, spp=each, seed=number)) for number in range(paths // each)]
    picture = np.nan_to_num(np.mean(passes, axis=0))
    picture[..., :3] /= np.maximum(picture[..., 3:], 1e-6)  # radiance is of paths that meet the mesh
    return picture


def _bsdf(material: Material) -> dict:
    f0 = [float(c) for c in np.broadcast_to(material.f0, 3)]
    if np.ndim(material.albedo) == 3:
        albedo: Any = {"type": "mesh_attribute", "name": ALBEDO}
    else:
        albedo = [float(c) for c in np.broadcast_to(material.albedo, 3)]
    return {"type": NAME, "albedo": albedo, "f0": f0, "alpha": float(material.alpha)}


def _shape(mi, mesh: Mesh, material: Material):
    """Convert our triangles with normals at their corners: every corner becomes its own vertex."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(material))
    count = len(mesh.faces)
    converted = mi.Mesh("mesh", 3 * count, count, has_vertex_normals=True, props=properties)
    if np.ndim(material.albedo) == 3:
        converted.add_attribute(ALBEDO, 3, np.ascontiguousarray(material.albedo, np.float32).ravel())
    parameters = mi.traverse(converted)
    parameters["vertex_positions"] = mesh.positions[mesh.faces].astype(np.float32).ravel()
    parameters["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    parameters["faces"] = np.arange(3 * count, dtype=np.uint32)
    parameters.update()
    return converted


def _environment(mi, radiance: np.ndarray) -> dict:
    """Convert a map [H, 2H, 3], exactly."""
    bitmap = mi.Bitmap(np.ascontiguousarray(pole_to_pole(radiance), np.float32))
    to_world = np.eye(4)
    to_world[:3, :3] = TO_OURS
    return {"type": "envmap", "bitmap": bitmap, "to_world": mi.ScalarTransform4f(to_world)}
