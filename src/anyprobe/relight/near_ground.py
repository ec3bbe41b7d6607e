"""Objects drawn on the ground that they stand on: each point is lit by the ground as it is seen from there.

A ground map (relight.ground_map) is seen from the object's middle. A point near the foot sees mostly ground in the
object's own shadow, and is darker: without that a matte object seems to float. Light of the ground that arrives at a
point by diffuse reflection is therefore corrected, on a coarse picture, by

    1 / N  sum_i [ L_ground(p + t_i d_i) - L_map(d_i) ],   d_i cosine-distributed about the normal, below the horizon

with t_i d_i the way from the point p to the ground.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.frames import world_from_local
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.resample import resample
from anyprobe.core.sampling import hammersley, square_to_cosine_hemisphere
from anyprobe.estimate.photo import Photo
from anyprobe.relight.ground_map import GroundPicture, with_ground
from anyprobe.relight.ground_view import View
from anyprobe.relight.placement import Placement
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.picture import draw_mesh
from anyprobe.render.surface import Camera, see
from anyprobe.scatter.materials import Material

if TYPE_CHECKING:
    from jaxtyping import Float

COARSE, DIRECTIONS = 32, 96
"""Side [px] of the picture that is corrected, and directions from each of its points."""
LEAST_SINE = 1e-3
"""Smallest angle [rad] below the horizon of a direction that meets the ground."""


def draw_on_ground(
    photo: Photo,
    view: View,
    spot: Placement,
    radiance: Float[np.ndarray, "H 2*H 3"],
    shadow: GroundShadow,
    camera: Camera,
    material: Material,
    **finer: int,
) -> Float[np.ndarray, "S S 4"]:
    """Draw a placed object under a map in the photo's frame and over the photo's ground; see picture.draw_mesh.

    finer: arguments of draw_mesh.
    """
    ground = GroundPicture(photo, view, radiance)
    lit = with_ground(ground, spot, shadow)
    drawn = draw_mesh(spot.mesh, camera, lit, material, **finer)
    if np.any(material.albedo):
        missed = _missed(ground, spot, lit, shadow, camera)
        drawn[..., :3] = np.maximum(drawn[..., :3] + material.albedo * (1.0 - material.f0) * missed, 0.0)
        drawn[..., :3] *= drawn[..., 3:] > 0
    return drawn


def _missed(
    ground: GroundPicture, spot: Placement, lit: Float[np.ndarray, "H 2*H 3"], shadow: GroundShadow, camera: Camera
) -> Float[np.ndarray, "S S 3"]:
    """Return the diffuse light over pi that the map `lit` misses at each pixel, mostly less than nothing."""
    up, coarse = ground.view.up, replace(camera, size=min(camera.size, COARSE))
    surface = see(spot.mesh, coarse)
    turn = np.asarray(camera.world_from_camera).T
    rays = -surface.wo / surface.wo[:, 2:]
    points = camera.position + (rays * surface.depth[:, None]) @ turn
    n = surface.normals @ turn
    d = world_from_local(square_to_cosine_hemisphere(hammersley(DIRECTIONS))[None], n[:, None])  # [P, N, 3]
    sine = d @ up
    below = sine < -LEAST_SINE
    height = np.maximum((points - spot.foot) @ up, 0.0)
    way = height[:, None] / np.maximum(-sine, LEAST_SINE)
    landed = (points[:, None] + way[..., None] * d)[below]
    difference = np.zeros(d.shape)
    difference[below] = ground.at(landed) * shadow.at(landed) - bilinear(lit, direction_to_uv(d[below]))
    picture = np.zeros((coarse.size, coarse.size, 4), np.float32)
    picture[surface.mask, :3] = difference.mean(axis=1)
    picture[surface.mask, 3] = 1.0
    larger = resample(picture, (camera.size, camera.size), smooth=True)
    return larger[..., :3] / np.maximum(larger[..., 3:], 1e-6)
