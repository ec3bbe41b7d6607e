"""Objects drawn where they stand: they and the real object beside hide light from them, and are seen in them.

render.picture draws a mesh under a distant map. Here the picture is corrected by what arrives at its points in place
of that map, on a coarser picture, as shares and differences, which need few samples:

    diffuse     the share of the map's irradiance that no body hides, by parallel light from the emitters and from
                DIRECTIONS of the rest; in place of what is hidden a body's mean radiance arrives
    coat        the share of it that is not hidden, of emitters and of rays of the lobe; and what these meet instead
    near ground 1 / N sum_i [ L_ground(p + t_i d_i) - L_map(d_i) ], d_i cosine-distributed about the normal, below the
                horizon, t_i d_i the way from p to the ground: the map is the ground's as seen from the object's middle

A point near the foot sees mostly ground in the object's own shadow; without that a matte object seems to float.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.frames import normalize, reflect, world_from_local
from anyprobe.core.latlong import bilinear, direction_to_uv, uv_to_direction
from anyprobe.core.resample import resample
from anyprobe.core.sampling import hammersley, square_to_cosine_hemisphere
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.light.filtering import irradiance_map
from anyprobe.light.octahedral import Pyramid, lookup_rgb
from anyprobe.paper.equations import ggx_distribution, schlick_weight
from anyprobe.relight.ground_map import GroundPicture, radiance_at, with_ground
from anyprobe.relight.placement import Placement
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.integrate import emitters_specular, lobe_lod, lobe_samples, shading_pyramid
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import LIGHT_ROWS, draw_mesh
from anyprobe.render.surface import Camera, see
from anyprobe.render.voxels import first_faces, open_shares, voxelize
from anyprobe.scatter.materials import Material

if TYPE_CHECKING:
    from jaxtyping import Float

COARSE, COARSER = 128, 32
"""Sides [px] of the pictures in which light is hidden, and in which the ground is near."""
DIRECTIONS, LOBE_RAYS, GROUND_RAYS = 192, 8, 96
"""Numbers of directions of parallel light, of rays of a lobe, and of rays to the ground, from each of their points."""
OFF_SURFACE = 1.5
"""Distance from the surface, in the longest sides of cells, from which points look."""
LEAST_SINE = 1e-3
"""Smallest angle [rad] below the horizon of a direction that meets the ground."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Points:
    """Points of an object that a camera sees.

    mask: [S, S] bool; at, n, wo: [P, 3], place, normal and direction to the eye in the photo's frame.
    """

    mask: np.ndarray
    at: np.ndarray
    n: np.ndarray
    wo: np.ndarray

    @classmethod
    def seen(cls, mesh: Mesh, camera: Camera, size: int) -> Points:
        """See a mesh in a picture of at most this size."""
        surface = see(mesh, replace(camera, size=min(camera.size, size)))
        turn = np.asarray(camera.world_from_camera).T
        rays = -surface.wo / surface.wo[:, 2:]
        at = camera.position + (rays * surface.depth[:, None]) @ turn
        n, wo = ((v @ turn).astype(np.float32) for v in (surface.normals, surface.wo))
        return cls(mask=surface.mask, at=at, n=n, wo=wo)

    def picture(self, values: np.ndarray, size: int) -> Float[np.ndarray, "S S C"]:
        """Return values [P, C] as a picture [size, size, C], smooth between the points."""
        coarse = np.zeros((*self.mask.shape, values.shape[1] + 1), np.float32)
        coarse[self.mask] = np.concatenate([values, np.ones((len(values), 1))], axis=1)
        larger = resample(coarse, (size, size), smooth=True)
        return larger[..., :-1] / np.maximum(larger[..., -1:], 1e-6)


class Surroundings:
    """Light that reaches an object where it stands: the map's, the shadowed ground's, and that of what is beside it."""

    def __init__(self, ground: GroundPicture, spot: Placement, shadow: GroundShadow, beside: Mesh | None) -> None:
        """Keep all of them; beside: the real object, in the photo's frame."""
        self.ground, self.spot, self.shadow = ground, spot, shadow
        self.lit = with_ground(ground, spot, shadow)
        self.light = reduced(np.asarray(self.lit, np.float32), LIGHT_ROWS)
        self.own = voxelize(spot.mesh)
        self.real = None if beside is None else voxelize(beside)
        self.real_colors = np.zeros((1, 3)) if beside is None else self._colors(beside)

    def _colors(self, beside: Mesh) -> Float[np.ndarray, "F 3"]:
        """Return the radiance that the photo shows of each face, a back's as its front's; else their mean."""
        photo, view = self.ground.photo, self.ground.view
        pixels = view.pixels(beside.positions[beside.faces].mean(axis=1))
        column, row = np.clip(pixels, 0, [view.width - 1, view.height - 1]).astype(int).T
        shown, own = radiance_at(photo, row, column), photo.mask[row, column] > 0.5
        return np.where(own[:, None], shown, shown[own].mean(axis=0) if own.any() else 0.0)

    def open_shares(self, at: np.ndarray, directions: np.ndarray) -> list[Float[np.ndarray, "P D"]]:
        """Return how much light passes the object itself to its points, and how much the real one."""
        shares = [open_shares(body, at, directions).T for body in (self.own, self.real) if body is not None]
        return shares if len(shares) == 2 else [*shares, np.ones_like(shares[0])]

    def nearer_ground(self, points: Points) -> Float[np.ndarray, "P 3"]:
        """Return the diffuse light over pi that the map misses at each point, mostly less than nothing."""
        d = world_from_local(square_to_cosine_hemisphere(hammersley(GROUND_RAYS))[None], points.n[:, None])  # [P, N, 3]
        below, seen = self._ground_along(np.repeat(points.at, GROUND_RAYS, axis=0), d.reshape(-1, 3))
        difference = np.zeros((below.size, 3))
        difference[below] = seen - bilinear(self.lit, direction_to_uv(d.reshape(-1, 3)[below]))
        return difference.reshape(d.shape).mean(axis=1)

    def _ground_along(self, starts: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which rays [N, 3] meet the ground, and what it sends along those."""
        up = self.ground.view.up
        sine = rays @ up
        below = sine < -LEAST_SINE
        height = np.maximum((starts[below] - self.spot.foot) @ up, 0.0)
        landed = starts[below] + (height / -sine[below])[:, None] * rays[below]
        return below, self.ground.at(landed) * self.shadow.at(landed)

    def remaining(
        self, points: Points, at: np.ndarray
    ) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 1"], Float[np.ndarray, "P 3"]]:
        """Return the share of the light's irradiance that reaches points, the share of an even one that the object
        hides itself, and the light over pi of the real object."""
        pyramid, u = shading_pyramid(self.light), hammersley(DIRECTIONS)
        around = uv_to_direction(np.stack([u[:, 0], np.arccos(1.0 - 2.0 * u[:, 1]) / np.pi], axis=-1))
        each, even = 4 * np.pi / DIRECTIONS, np.full(DIRECTIONS, 0.25 / np.pi)
        rest = _looked_up(pyramid, around, lobe_lod(even, DIRECTIONS, pyramid))
        directions = np.concatenate([around, pyramid.emitters])
        power = np.concatenate([rest * each, pyramid.emitter_power])
        cosine = np.maximum(points.n @ directions.T.astype(np.float32), 0.0)
        own, real = self.open_shares(at, directions)
        share = (cosine * own * real @ power) / np.maximum(cosine @ power, 1e-9)
        by_own, by_real = (
            (cosine * hidden)[:, :DIRECTIONS].sum(axis=1, keepdims=True) * each / np.pi
            for hidden in (1.0 - own, own * (1.0 - real))
        )
        return share, by_own, by_real * self.real_colors.mean(axis=0)

    def coat(
        self, points: Points, at: np.ndarray, material: Material, open_share: np.ndarray
    ) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"]]:
        """Return the share of what the coat reflects that no body hides, and what it reflects of both and of the near
        ground, more than of the map."""
        pyramid = shading_pyramid(self.light, material.alpha)
        n, wo, alpha = points.n, points.wo, material.alpha
        wi, pdf, weight, grazing, _ = lobe_samples(n, wo, alpha, hammersley(LOBE_RAYS))
        rays, starts = np.stack(wi, axis=-1).reshape(-1, 3), np.repeat(at, LOBE_RAYS, axis=0)
        of_map = _looked_up(pyramid, rays, lobe_lod(pdf, LOBE_RAYS, pyramid).ravel())
        more = np.zeros_like(of_map)
        below, seen = self._ground_along(starts, rays)
        more[below] = seen - _looked_up(pyramid, rays[below], np.zeros(below.sum()))
        out, hidden = np.flatnonzero(weight.ravel() > 0), np.zeros(len(rays), bool)
        for body in (self.real, self.own):  # the latter is the nearer
            if body is not None:
                faces = first_faces(body, starts[out], rays[out])
                hit, faces = out[faces >= 0], faces[faces >= 0]
                hidden[hit] = True
                if body is self.real:
                    more[hit] = self.real_colors[faces]
                else:
                    more[hit] = self._sent(faces, rays[hit], pyramid, material, open_share)

        def reflected(light: np.ndarray, emitters: np.ndarray | float | None = None) -> np.ndarray:
            light = light.reshape(*weight.shape, 3)
            terms = [(one[..., None] * light).mean(axis=1) for one in (weight, grazing)]
            if emitters is not None:
                lit = emitters_specular(pyramid, n, wo, alpha, emitters)[1:]
                terms = [one + other for one, other in zip(terms, lit, strict=True)]
            return material.f0 * terms[0] + (1.0 - material.f0) * terms[1]

        own, real = self.open_shares(at, pyramid.emitters)
        kept = reflected(np.where(hidden[:, None], 0.0, of_map), own * real)
        return kept / np.maximum(reflected(of_map, 1.0), 1e-9), reflected(more)

    def _sent(
        self, faces: np.ndarray, rays: np.ndarray, pyramid: Pyramid, material: Material, open_share: np.ndarray
    ) -> Float[np.ndarray, "N 3"]:
        """Return what faces of the object send against rays [N, 3] that meet them, open_share [3] of the light on them
        left."""
        n = normalize(self.spot.mesh.normals[faces].mean(axis=1))
        n *= np.where((n * rays).sum(axis=1, keepdims=True) > 0, -1.0, 1.0)
        lod = lobe_lod(np.full(len(n), ggx_distribution(1.0, material.alpha) / 4), 1, pyramid)
        fresnel = material.f0 + (1.0 - material.f0) * schlick_weight(-(n * rays).sum(axis=1))[:, None]
        irradiance = bilinear(irradiance_map(reduced(self.light, MAP_HEIGHT)), direction_to_uv(n)) * open_share
        base = material.albedo * (1.0 - material.f0) * irradiance / np.pi
        return base + fresnel * _looked_up(pyramid, reflect(-rays, n), lod)


def _looked_up(pyramid: Pyramid, directions: np.ndarray, lod: np.ndarray) -> Float[np.ndarray, "N 3"]:
    """Return a pyramid's radiance in directions [N, 3] at levels [N]."""
    return np.stack(lookup_rgb(pyramid, directions[:, 0], directions[:, 1], directions[:, 2], lod), axis=-1)


def draw_on_ground(
    around: Surroundings, camera: Camera, material: Material, **finer: int
) -> Float[np.ndarray, "S S 4"]:
    """Draw a placed object in its surroundings; see picture.draw_mesh.

    finer: arguments of draw_mesh.
    """
    mesh, size = around.spot.mesh, camera.size
    drawn = draw_mesh(mesh, camera, around.lit, material, **finer)
    points = Points.seen(mesh, camera, COARSE)
    if not len(points.at):
        return drawn
    at = points.at + OFF_SURFACE * around.own.cell.max() * points.n
    base, open_share = np.zeros_like(drawn[..., :3]), np.ones(3)
    if np.any(material.albedo):
        reflected = material.albedo * (1.0 - material.f0)
        coat = draw_mesh(mesh, camera, around.lit, replace(material, albedo=np.zeros(3)), **finer)
        near = Points.seen(mesh, camera, COARSER)
        base = drawn[..., :3] - coat[..., :3] + near.picture(reflected * around.nearer_ground(near), size)
        remaining, hidden, of_real = around.remaining(points, at)
        base = np.maximum(base, 0.0) * points.picture(remaining, size)
        again = reflected * (base + coat[..., :3])[drawn[..., 3] > 0].mean(axis=0)
        base += points.picture(hidden * again + reflected * of_real, size)
        drawn, open_share = coat, remaining.mean(axis=0)
    share, more = (points.picture(one, size) for one in around.coat(points, at, material, open_share))
    drawn[..., :3] = base + np.maximum(drawn[..., :3] * share + more, 0.0)
    drawn[..., :3] *= drawn[..., 3:] > 0
    return drawn
