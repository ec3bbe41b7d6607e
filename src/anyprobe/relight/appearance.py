"""The real object's material, and a lower bound of the light's level, from its photo.

A sphere of each of several widths alpha is shaded under the estimate. As a dielectric (f0 0.045) its albedo,
as a metal its f0 is chosen so that the sphere has the object's mean colour: the shading is linear in either, so
this is one division a channel. The best sphere is the one whose luminances, sorted, are nearest to the object's
in display values: the shape is unknown, so where on the object they lie does not count. This cannot detect a
light's colour that was mistaken for the object's, or the reverse.
"""

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.response import inverse_response, response
from anyprobe.core.sampling import hammersley
from anyprobe.estimate.photo import Photo
from anyprobe.light.environment import reduced
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import NUM_EMITTERS, shade
from anyprobe.render.spheres import diffuse, mirror, sphere_normals
from anyprobe.scatter.materials import Material

ALPHAS = (0.05, 0.15, 0.35, 0.8)
"""GGX widths of the candidates."""
DIELECTRIC_F0 = 0.045
LEAST_METAL_F0 = 0.2
"""Smallest f0 in any channel of a metal that is a candidate."""
MOST_REFLECTED = 0.9
"""Largest share of the light that is reflected; roughly that of paper and silver."""

MOST_PIXELS = 1 << 22
"""Largest number of photo pixels from which the object's brightness and colour are computed."""

_SPHERE = 24
"""Side [px] of the shaded sphere."""
LEVELS = (np.arange(32) + 0.5) / 32
"""Quantiles that are compared."""


def material_from_photo(photo: Photo, radiance: np.ndarray) -> Material:
    """Return the candidate that fits the object's pixels best under a map [H, 2H, 3] in the camera's frame."""
    seen = _seen_of_object(photo)
    mean = inverse_response(seen).mean(axis=0)
    quantiles = np.quantile(luminance(seen), LEVELS)
    # a larger map would be read at points, and a sun between them lost
    pyramid, u = build_pyramid(reduced(radiance), side=64, emitters=NUM_EMITTERS), hammersley(64)
    n, _ = sphere_normals(_SPHERE)
    wo = np.broadcast_to(np.array([0, 0, 1], np.float32), n.shape)
    best, least = Material(albedo=0.0, f0=0.0, alpha=1.0), np.inf
    for alpha in ALPHAS:
        sphere = shade(pyramid, n, wo, alpha, u)
        for material in _candidates(sphere, mean, alpha):
            shown = luminance(response(sphere.radiance(material)))
            error = float(np.square(np.quantile(shown, LEVELS) - quantiles).mean())
            if error < least:
                best, least = material, error
    return best


def least_scale(photo: Photo, radiance: np.ndarray) -> float:
    """Return the gain, at least 1, that a map needs so that the object reflects no more than MOST_REFLECTED.

    Estimates tend to be too dim where the emitters are small and strong; the real object is then
    brighter than anything could be under them, and a virtual one beside it looks unlit. The object is treated
    as a sphere, of paper or a mirror, whichever shows more of the map [H, 2H, 3].
    """
    seen = _seen_of_object(photo)
    on = sphere_normals(_SPHERE)[1]
    white = max(float(luminance(sphere(radiance, _SPHERE)[on]).mean()) for sphere in (diffuse, mirror))
    return max(1.0, float(luminance(inverse_response(seen)).mean()) / (MOST_REFLECTED * max(white, 1e-6)))


def _seen_of_object(photo: Photo) -> np.ndarray:
    """Return display values [N, 3] of the object's pixels; of a large photo only every few rows and columns, if
    enough."""
    for step in (int(np.ceil(np.sqrt(photo.mask.size / MOST_PIXELS))), 1):
        rgb, mask = photo.rgb[::step, ::step], photo.mask[::step, ::step]
        for least in (0.9, 0.5):
            if len(seen := rgb[mask > least]):
                return seen
    return seen


def _candidates(sphere, mean: np.ndarray, alpha: float):
    """Yield a dielectric and, unless it would hardly reflect, a metal with the mean colour [3]."""
    parts = (sphere.specular, sphere.grazing, sphere.diffuse)
    specular, grazing, diffuse = (np.maximum(part.mean(axis=0), 1e-6) for part in parts)
    coat = DIELECTRIC_F0 * specular + (1 - DIELECTRIC_F0) * grazing
    albedo = (mean - coat) / ((1 - DIELECTRIC_F0) * diffuse)
    yield Material(albedo=np.clip(albedo, 0.01, 0.95), f0=np.full(3, DIELECTRIC_F0), alpha=alpha)
    f0 = (mean - grazing) / np.maximum(specular - grazing, 1e-6)
    if f0.max() > LEAST_METAL_F0:
        yield Material(albedo=np.zeros(3), f0=np.clip(f0, 0.05, 1.0), alpha=alpha)
