"""Shading by importance sampling: paper Eq. 1 as its Eq. 3-5, all terms from the same samples.

Schlick's Fresnel is linear in f0, so the reflected radiance of any material of one
alpha is a sum of three images that are independent of colour:

    Lo = f0 S1 + (1 - f0) Ss + albedo (1 - f0) Dd
    S1 = int D V     L (n.wi) dwi        (V = G / (4 (n.wo)(n.wi)))
    Ss = int D V s   L (n.wi) dwi        (s = (1 - wo.h)^5)
    Dd = int (1 - s) L (n.wi) dwi / pi

V holds the height-correlated Smith G (Heitz 2014, Eq. 99): paper.equations.smith_visibility. The functions run on NumPy
arrays and on torch tensors, compiled or not.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace, is_torch_array

from anyprobe.core.frames import dot, orthonormal_basis
from anyprobe.core.sampling import cosine_hemisphere_xyz, ggx_visible_normal_xyz
from anyprobe.light.octahedral import Pyramid, build_pyramid, lookup_rgb
from anyprobe.paper.equations import (
    diffuse_weight,
    ggx_distribution,
    importance_weighted_irradiance,
    outgoing_radiance,
    sample_density,
    schlick_weight,
    smith_visibility,
)
from anyprobe.scatter.materials import Material

NUM_EMITTERS = 16
"""Number of emitters in pyramids for shading, enough for a sun's disc.

Under a sun 64 samples err by 1-4 % with them and by 20-115 % without. They cost as much time as ten samples.
"""

PATCHES = ((0.3, 16, 128), (0.2, 32, 128), (0.1, 64, 128))
"""Smallest alpha at which emitters are patches, patches along the unfolded sphere, number of emitters, and the
pyramid's side: such a lobe hardly resolves patches from points.

In a room with a square emitter 14 degrees wide (benchmarks/sphere.py), 64 samples of a conductor err by 12, 13 and
10 % at alpha 0.1, 0.3 and 1 with emitters of a pixel, by 1.4, 0.6 and 0.7 % with patches; 512 samples by 3.3, 3.8
and 4.3 %, and by 1.3, 0.2 and 0.3 %.
"""


def shading_pyramid(radiance, alpha: float = 1.0) -> Pyramid:
    """Build the pyramid of a map [H, 2H, 3] for lobes of alpha; alpha 1 serves the diffuse term."""
    for least, patches, side in PATCHES:
        if alpha >= least:
            return build_pyramid(radiance, side=side, emitters=patches, patches=patches)
    return build_pyramid(radiance, emitters=NUM_EMITTERS)


@dataclass(frozen=True, kw_only=True, slots=True)
class Shading:
    """Radiance that points [..., 3] send to the eye, and the irradiance in it.

    irradiance: the first factor of Eq. 5, radiance units.
    specular, grazing: S1 and Ss.   diffuse: Dd.
    """

    irradiance: Any
    specular: Any
    grazing: Any
    diffuse: Any

    def radiance(self, material: Material):
        """Evaluate Lo of Eq. 3 for a material whose alpha is the one shaded with."""
        return outgoing_radiance(material.albedo, material.f0, self.specular, self.grazing, self.diffuse)


def lobe_lod(pdf, num_samples: int, pyramid: Pyramid):
    """Return the level whose texel covers the solid angle 1 / (N pdf) of a sample.

    Half a level up or down errs no less (benchmarks/reference.py).
    """
    xp = array_namespace(pdf)
    texel = 4.0 * np.pi / pyramid.side**2
    return 0.5 * xp.log2(1.0 / (num_samples * xp.clip(pdf, 1e-9, None) * texel))


def _carry(local: tuple, t, b, n) -> list:
    """Rotate local components [P, S] or [1, S] by the frames t, b, n [P, 3] into the world, [P, S] each."""
    return [local[0] * t[:, k, None] + local[1] * b[:, k, None] + local[2] * n[:, k, None] for k in range(3)]


def _against(v: list, a):
    """Return scalar products [P, S] of components v with one vector a point, [P, 3]."""
    return v[0] * a[:, 0, None] + v[1] * a[:, 1, None] + v[2] * a[:, 2, None]


def lobe_samples(n, wo, alpha, u) -> tuple:
    """Draw directions wi from lobes, by the normals that the eye sees; arguments as in shade_specular.

    Returns:
        wi: components [P, S] each. pdf, and the weights of light in S1, in Ss and in Eq. 5's mean: [P, S].
    """
    xp = array_namespace(n, wo, u)
    n_dot_wo = xp.clip(dot(n, wo), 1e-4, None)  # grazing view: no 0/0
    t, b = orthonormal_basis(n)
    local = ggx_visible_normal_xyz(u[None], dot(t, wo), dot(b, wo), n_dot_wo, alpha)
    n_dot_h = xp.clip(local[2], 1e-6, None)
    h = _carry(local, t, b, n)
    wo_dot_h = xp.clip(_against(h, wo), 1e-6, None)
    wi = [2.0 * wo_dot_h * h[k] - wo[:, k, None] for k in range(3)]
    n_dot_wi = _against(wi, n)
    kept = xp.astype(n_dot_wi > 0, n.dtype)
    a2 = alpha * alpha
    shadow = n_dot_wo + xp.sqrt(a2 + (1.0 - a2) * n_dot_wo**2)  # 2 (n.wo) / G1
    pdf = ggx_distribution(n_dot_h, alpha) / (2.0 * shadow)
    # D V (n.wi) / pdf, the Fresnel term left out: G / G1
    above = xp.clip(n_dot_wi, 0.0, None)
    weight = 2.0 * shadow * smith_visibility(n_dot_wo, xp.clip(n_dot_wi, 1e-6, None), alpha) * above
    return wi, pdf, weight, weight * schlick_weight(wo_dot_h), 0.5 * n_dot_h * shadow / wo_dot_h * kept


def shade_specular(pyramid: Pyramid, n, wo, alpha, u):
    """Compute importance-weighted irradiance (Eq. 5), S1 and Ss.

    The paper draws h with density D (n.h). Here h follows the normals that the eye sees, pdf(wi) =
    D G1 / (4 n.wo), which needs half to a quarter of the samples on rough metal. Eq. 5's mean is over the
    paper's samples; each of ours counts by the quotient of the densities,

        D (n.h) / (4 wo.h)  /  (D G1 / (4 n.wo))  =  (n.h) (n.wo) / (G1 (wo.h)).

    Samples below the horizon (n.wi <= 0) weigh zero in Eq. 4 and are left out of Eq. 5's mean. All vectors are kept in
    components [P, S]: compiled, one loop over samples without memory between its parts.

    Args:
        n, wo: [P, 3].
        alpha: scalar or [P, 1].
        u: [S, 2].
    Returns:
        irradiance, S1, Ss: [P, 3] each.
    """
    xp = array_namespace(n, wo, u)
    wi, pdf, weight, grazing, share = lobe_samples(n, wo, alpha, u)
    light = lookup_rgb(pyramid, wi[0], wi[1], wi[2], lobe_lod(pdf, u.shape[0], pyramid))
    total = xp.clip(xp.sum(share, axis=1), 1e-6, None)
    irradiance = xp.stack([importance_weighted_irradiance(channel, share, total, axis=1) for channel in light], axis=-1)
    specular = xp.stack([xp.mean(channel * weight, axis=1) for channel in light], axis=-1)
    weak = xp.stack([xp.mean(channel * grazing, axis=1) for channel in light], axis=-1)
    if pyramid.emitters is None:
        return irradiance, specular, weak
    lit = emitters_specular(pyramid, n, wo, alpha)
    return irradiance + lit[0] * (u.shape[0] / total[:, None]), specular + lit[1], weak + lit[2]


def _emitter_cosines(pyramid: Pyramid, n, wo):
    """Return n.wi, wo.h and n.h [P, K] of every emitter; |wo + wi| = 2 wo.h."""
    xp = array_namespace(n)
    emitters = [pyramid.emitters[None, :, k] for k in range(3)]
    n_dot_wi = _against(emitters, n)
    wo_dot_h = xp.sqrt(xp.clip(0.5 + 0.5 * _against(emitters, wo), 1e-8, None))
    n_dot_h = (n_dot_wi + dot(n, wo)) / (2.0 * wo_dot_h)
    return n_dot_wi, wo_dot_h, xp.clip(n_dot_h, 1e-6, 1.0)


def _gather(weight, power) -> Any:
    """Sum over emitters: [P, K] times power [K, 3] to [P, 3]."""
    if is_torch_array(weight):
        return weight @ power  # compiled, a third of the time of nine sums
    # a matrix product of NumPy's differs in the last bit from processor to processor
    return np.stack([np.sum(weight * power[None, :, k], axis=1) for k in range(3)], axis=-1)


def emitters_specular(pyramid: Pyramid, n, wo, alpha, share=1.0):
    """Return the emitters' part of shade_specular's three integrals, with Eq. 5's before division by the kept share.

    An emitter is not a point: D is widened by its size between half vectors.

    Args:
        share: of each emitter's light that counts at each point, [P, K].
    """
    xp = array_namespace(n)
    n_dot_wi, wo_dot_h, n_dot_h = _emitter_cosines(pyramid, n, wo)
    n_dot_wo = xp.clip(dot(n, wo), 1e-4, None)
    above = xp.astype(n_dot_wi > 0, n.dtype)
    d = ggx_distribution(n_dot_h, (alpha * alpha + pyramid.emitter_spread) ** 0.5) * above
    density = sample_density(d, n_dot_h, wo_dot_h)
    weight = share * d * smith_visibility(n_dot_wo, xp.clip(n_dot_wi, 1e-6, None), alpha) * n_dot_wi
    power = pyramid.emitter_power
    return (_gather(density, power), _gather(weight, power), _gather(weight * schlick_weight(wo_dot_h), power))


def shade_diffuse(pyramid: Pyramid, n, wo, u):
    """Compute Dd [P, 3] by cosine sampling: the mean of (1 - s) L."""
    xp = array_namespace(n, wo, u)
    local = cosine_hemisphere_xyz(u[None])
    t, b = orthonormal_basis(n)
    wi = _carry(local, t, b, n)
    pdf = local[2] / np.pi + xp.zeros_like(wi[0])
    wo_dot_h = xp.sqrt(xp.clip(0.5 + 0.5 * _against(wi, wo), 0.0, None))  # half of the angle between them
    rest = 1.0 - schlick_weight(wo_dot_h)
    light = lookup_rgb(pyramid, wi[0], wi[1], wi[2], lobe_lod(pdf, u.shape[0], pyramid))
    diffuse = xp.stack([xp.mean(channel * rest, axis=1) for channel in light], axis=-1)
    if pyramid.emitters is None:
        return diffuse
    n_dot_wi, wo_dot_h, _ = _emitter_cosines(pyramid, n, wo)
    return diffuse + _gather(diffuse_weight(xp.clip(n_dot_wi, 0.0, None), wo_dot_h), pyramid.emitter_power)


def shade(pyramid: Pyramid, n, wo, alpha, u, u_diffuse=None, wide: Pyramid | None = None) -> Shading:
    """Compute all terms of Eq. 3-5 at points with normal n, seen from wo. Shapes as above.

    wide: the same map's pyramid for the diffuse term.
    """
    irradiance, specular, grazing = shade_specular(pyramid, n, wo, alpha, u)
    diffuse = shade_diffuse(wide or pyramid, n, wo, u if u_diffuse is None else u_diffuse)
    return Shading(irradiance=irradiance, specular=specular, grazing=grazing, diffuse=diffuse)
