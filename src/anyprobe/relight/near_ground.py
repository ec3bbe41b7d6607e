"""Objects drawn where they stand: they and the real object beside hide light from them, and are seen in them.

render.picture draws a mesh under a distant map. Here the picture is corrected by what arrives at its points in place
of that map, on a coarser picture, as shares and differences, which need few samples:

    diffuse     the share of the map's irradiance that no body hides, by parallel light from the emitters and from
                DIRECTIONS of the rest; in place of what is hidden arrives what bodies send along rays that meet them
    coat        the share of it that is not hidden, of emitters and of rays of the lobe; and what these meet instead
    near ground 1 / N sum_i [ L_ground(p + t_i d_i) - L_map(d_i) ], d_i cosine-distributed about the normal, below the
                horizon, t_i d_i the way from p to the ground: the map is the ground's as seen from the object's middle

A point near the foot sees mostly ground in the object's own shadow; without that a matte object seems to float. The map
below the horizon is the ground that the photo shows, or what the map shows in its direction where that is outside the
photo or hidden by the real object.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.core import Float
from anyprobe.core.color import luminance
from anyprobe.core.frames import normalize, orthonormal_basis, reflect, world_from_local
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, uv_to_direction
from anyprobe.core.resample import resample
from anyprobe.core.response import response
from anyprobe.core.sampling import hammersley, square_to_cosine_hemisphere
from anyprobe.estimate.photo import Photo
from anyprobe.light.environment import MAP_HEIGHT, integral, reduced
from anyprobe.light.filtering import irradiance_map
from anyprobe.light.octahedral import Pyramid, lookup_rgb
from anyprobe.paper.equations import ggx_distribution, schlick_weight
from anyprobe.relight.ground_view import View
from anyprobe.relight.placement import LEAST_RISE, Placement
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.integrate import PATCHES, emitters_specular, lobe_lod, lobe_samples, shading_pyramid
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import LIGHT_ROWS, draw_mesh
from anyprobe.render.surface import Camera, see
from anyprobe.render.voxels import faces_around, first_faces, first_hits, open_shares, sharp_shares, voxelize
from anyprobe.scatter.materials import Material

_ROWS = 128
"""Smallest number of rows of the map."""

EDGE = 0.08
"""Width of the photo's rim, as a share of its shorter side, over which its pixels blend into the mean colour."""


RIM = 0.004
"""Width of the rim around the real object that is not taken for ground, as a share of the photo's longer side."""
DARK_GROUND = 0.25
"""Median display luminance of a ground on which shadows hardly show: with half of its light it is .08 darker."""
RING_RADII, RING_POINTS = (0.6, 0.8, 1.0, 1.2, 1.4), 64
"""Where that is read around the foot, in radii of the object, and at how many points of each circle."""


class GroundPicture:
    """The ground as the photo shows it; elsewhere what a map shows in the same direction from the camera."""

    def __init__(self, photo: Photo, view: View, radiance: np.ndarray) -> None:
        """Keep photo, camera and map [H, 2H, 3] in the camera's frame."""
        self.photo, self.view, self.radiance = photo, view, radiance
        hidden = photo.mask if photo.hidden is None else np.maximum(photo.mask, photo.hidden)
        reach = 2 * max(1, round(RIM * max(hidden.shape))) + 1
        grown = Image.fromarray((hidden > 0.02).astype(np.uint8)).filter(ImageFilter.MaxFilter(reach))
        self.free = np.asarray(grown) == 0

    def at(self, points: np.ndarray, shadow: GroundShadow) -> np.ndarray:
        """Return linear radiance [P, 3] of points of the ground in the object's shadow, and in the real one's."""
        photo, view = self.photo, self.view
        pixels = view.pixels(points)
        border = np.minimum(pixels, [view.width, view.height] - pixels).min(axis=-1)
        weight = np.clip(border / (EDGE * min(view.width, view.height)), 0.0, 1.0) * (points[:, 2] < -1e-3)
        column, row = np.clip(pixels, 0, [view.width - 1, view.height - 1]).astype(int).T
        weight = (weight * self.free[row, column])[:, None]
        shown = photo.linear((row, column))
        toward = points / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-9)
        around = np.minimum(bilinear(self.radiance, direction_to_uv(toward.astype(np.float32))), 1.0)  # no lamp
        return weight * shown * shadow.at(points) + (1 - weight) * around * shadow.at(points, with_beside=True)


def hides_shadows(photo: Photo, view: View, spot: Placement) -> bool:
    """Return whether the ground that a photo shows around a foot is mostly too dark for shadows to be seen."""
    side, across = orthonormal_basis(view.up)
    angle = np.linspace(0, 2 * np.pi, RING_POINTS, endpoint=False)
    around = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * across
    points = spot.foot + spot.radius * np.concatenate([radius * around for radius in RING_RADII])
    seen = seen_ground(photo, view, points)
    shown = luminance(response(seen[np.isfinite(seen).all(axis=-1)]))
    return len(shown) > 0 and bool(np.median(shown) < DARK_GROUND)


def seen_ground(photo: Photo, view: View, points: np.ndarray) -> np.ndarray:
    """Return linear radiance [P, 3] of points of the ground; NaN where the photo does not show them."""
    column, row = np.floor(view.pixels(points)).T
    seen = (column >= 0) & (column < view.width) & (row >= 0) & (row < view.height) & (points[:, 2] < 0)
    column, row = (np.where(seen, of, 0).astype(int) for of in (column, row))
    seen &= photo.mask[row, column] < 0.5
    if photo.hidden is not None:
        seen &= ~photo.hidden[row, column]
    return np.where(seen[:, None], photo.linear((row, column)), np.nan)


def with_ground(ground: GroundPicture, spot: Placement, shadow: GroundShadow) -> Float[np.ndarray, "K 2*K 3"]:
    """Return a ground's map, in the camera's frame and of at least _ROWS rows, with the ground and the shadow on it
    below the horizon."""
    view, radiance = ground.view, ground.radiance
    times = max(1, _ROWS // radiance.shape[0])
    light = radiance.repeat(times, axis=0).repeat(times, axis=1)  # power is neither lost nor moved
    directions = pixel_directions(len(light))
    sine = directions @ view.up
    share = np.clip(0.5 - sine * len(light) / np.pi, 0.0, 1.0)  # of a pixel below the horizon
    below = share > 0
    height = float(((spot.mesh.positions - spot.foot) @ view.up).max()) / 2
    landed = spot.foot + height * view.up + directions[below] * (height / np.maximum(-sine[below], 1e-3))[:, None]
    weight = share[below][:, None]
    result = light.astype(np.float32, copy=True)
    result[below] = result[below] * (1 - weight) + ground.at(landed, shadow) * weight
    return result


COARSE, COARSER = 128, 32
"""Sides [px] of the pictures in which light is hidden, and in which the ground is near."""
DIRECTIONS, LOBE_RAYS, NEAR_RAYS = 192, 8, 64
"""Numbers of directions of parallel light, of rays of a wide lobe, and of rays of the cosine, of a point."""
OFF_SURFACE, OFF_SHARP = 1.5, 0.375
"""Distances from the surface, in the longest sides of cells, from which points look: at cells, and at shadow maps,
which are four times as fine."""
STRONG = 1 / 16
"""Smallest share of all light of a direction whose shadows are sharp."""
LIKELY = 0.04
"""Standard deviation of the real object's outline, in its size. Of .1, inserts under a sun are farther from renders."""


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
        """See a mesh in a picture of this size."""
        surface = see(mesh, replace(camera, size=size))
        turn = np.asarray(camera.world_from_camera).T
        rays = -surface.wo / surface.wo[:, 2:]
        at = camera.position + (rays * surface.depth[:, None]) @ turn
        n, wo = ((v @ turn).astype(np.float32) for v in (surface.normals, surface.wo))
        return cls(mask=surface.mask, at=at, n=n, wo=wo)

    def picture(self, values: np.ndarray, size: int, mean_of: int = 1) -> Float[np.ndarray, "S S C"]:
        """Return values [P, C] as a picture [size, size, C], smooth between the points.

        Beside them, where the object may cover part of a pixel, it is the mean of those around.

        Args:
            mean_of: side of the squares of pixels whose mean counts.
        """
        rows, columns = self.mask.shape
        padded = np.zeros((rows + 2, columns + 2, values.shape[1] + 1), np.float32)
        coarse = padded[1:-1, 1:-1]
        coarse[self.mask] = np.concatenate([values, np.ones((len(values), 1))], axis=1)
        around = np.sum([padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3)], axis=0)
        filled = np.where(self.mask[..., None], coarse, around / np.maximum(around[..., -1:], 1.0))
        filled = resample(filled, (columns // mean_of, rows // mean_of))
        larger = resample(filled, (size, size), smooth=True)
        return larger[..., :-1] / np.maximum(larger[..., -1:], 1e-6)


class Surroundings:
    """Light that reaches an object where it stands: the map's, the shadowed ground's, and that of what is beside it."""

    def __init__(
        self, ground: GroundPicture, spot: Placement, shadow: GroundShadow, beside: Mesh | None, material: Material
    ) -> None:
        """Keep all of them; beside: the real object, in the photo's frame. material: the object's."""
        self.ground, self.spot, self.shadow, self.material = ground, spot, shadow, material
        self.open_share = np.ones(3)  # of the light, which no body hides from the object
        self.beside = beside
        self.lit = with_ground(ground, spot, shadow)
        self.light = reduced(np.asarray(self.lit, np.float32), LIGHT_ROWS)
        volume = np.linalg.det(spot.mesh.positions[spot.mesh.faces] - spot.foot).sum()
        self.own, self.normals = voxelize(spot.mesh), np.sign(volume) * normalize(spot.mesh.normals.mean(axis=1))
        self.real = None if beside is None else voxelize(beside)
        if beside is not None:
            self.around_real = faces_around(beside)
            self._color(beside)

    def _color(self, beside: Mesh) -> None:
        """Keep the radiance [V, 3] of the real object's corners.

        What the photo does not show has the mean albedo of what it shows, in the light of its side; on the way from one
        to the other it is mixed of both.
        """
        photo, view, at = self.ground.photo, self.ground.view, beside.positions
        a, b, c = np.moveaxis(at[beside.faces], 1, 0)
        n = np.zeros_like(at)
        np.add.at(n, beside.faces, np.cross(b - a, c - a)[:, None])
        n = normalize(n) * np.sign((n * (at - at.mean(axis=0))).sum(axis=1, keepdims=True))
        column, row = np.clip(view.pixels(at), 0, [view.width - 1, view.height - 1]).astype(int).T
        facing = np.clip(-2 * (n * normalize(at)).sum(axis=1, keepdims=True), 0.0, 1.0)
        seen = facing * (photo.mask[row, column, None] > 0.5)
        shown, lit = photo.linear((row, column)), self.irradiance(n)
        mean = [(of * seen).sum(axis=0) for of in (shown, lit)]
        self.real_colors = seen * shown + (1.0 - seen) * lit * mean[0] / np.maximum(mean[1], 1e-9)

    def irradiance(self, n: np.ndarray) -> Float[np.ndarray, "N 3"]:
        """Return the irradiance of the light on sides of normals n [N, 3]."""
        return bilinear(irradiance_map(reduced(self.light, MAP_HEIGHT)), direction_to_uv(n.astype(np.float32)))

    def off(self, points: Points, distance: float = OFF_SURFACE) -> Float[np.ndarray, "P 3"]:
        """Return where points look from, off the surface."""
        return points.at + distance * self.own.cell.max() * points.n

    def open_shares(self, points: Points, directions: np.ndarray, power: np.ndarray) -> Float[np.ndarray, "P D"]:
        """Return how much light passes the object itself and the real one to its points.

        power: [D, 3], radiance times solid angle of each direction; STRONG ones cast sharp shadows.
        """
        sharp = luminance(power) > STRONG * luminance(integral(self.light))
        share = np.ones((len(points.at), len(directions)), np.float32)
        for mesh, body, blur in ((self.spot.mesh, self.own, 0.0), (self.beside, self.real, LIKELY)):
            if mesh is not None and body is not None:
                share[:, sharp] *= sharp_shares(mesh, self.off(points, OFF_SHARP), directions[sharp], blur).T
                share[:, ~sharp] *= open_shares(body, self.off(points), directions[~sharp]).T
        return share

    def nearer(
        self, points: Points
    ) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"], Float[np.ndarray, "P 1"]]:
        """Return the diffuse light over pi that the near ground sends to points more than the map, mostly less than
        nothing, that of both bodies along NEAR_RAYS, and the share of these that meet one."""
        d = world_from_local(square_to_cosine_hemisphere(hammersley(NEAR_RAYS))[None], points.n[:, None])  # [P, N, 3]
        rays, starts = d.reshape(-1, 3), np.repeat(self.off(points), NEAR_RAYS, axis=0)
        below, seen = self._ground_along(starts, rays)
        difference = np.zeros(rays.shape)
        difference[below] = seen - np.minimum(bilinear(self.lit, direction_to_uv(rays[below])), 1.0)
        met, sent = self._bodies_along(starts, rays, shading_pyramid(self.light, self.material.alpha))
        of_ground, of_bodies, share = (of.reshape(*d.shape[:2], -1).mean(axis=1) for of in (difference, sent, met))
        return of_ground, of_bodies, share

    def _ground_along(self, starts: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which rays [N, 3] meet the ground, and what it sends along those."""
        up = self.ground.view.up
        sine = rays @ up
        below = sine < -LEAST_RISE
        height = np.maximum((starts[below] - self.spot.foot) @ up, 0.0)
        return below, self.ground.at(starts[below] + (height / -sine[below])[:, None] * rays[below], self.shadow)

    def remaining(self, points: Points) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 1"]]:
        """Return the share of the light's irradiance that reaches points, and that of an even one that bodies hide."""
        pyramid, u = shading_pyramid(self.light), hammersley(DIRECTIONS)
        around = uv_to_direction(np.stack([u[:, 0], np.arccos(1.0 - 2.0 * u[:, 1]) / np.pi], axis=-1))
        each, even = 4 * np.pi / DIRECTIONS, np.full(DIRECTIONS, 0.25 / np.pi)
        rest = _looked_up(pyramid, around, lobe_lod(even, DIRECTIONS, pyramid))
        directions = np.concatenate([around, pyramid.emitters])
        power = np.concatenate([rest * each, pyramid.emitter_power])
        cosine = np.maximum(points.n @ directions.T.astype(np.float32), 0.0)
        passed = self.open_shares(points, directions, power)
        hidden = (cosine * (1.0 - passed))[:, :DIRECTIONS].sum(axis=1, keepdims=True) * each / np.pi
        return (cosine * passed @ power) / np.maximum(cosine @ power, 1e-9), hidden

    def coat(
        self, points: Points, each: int
    ) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"]]:
        """Return what the coat reflects of the map where no body hides it, of all of it, and of both bodies and the
        near ground, more than of the map, by so many rays of each point; four points of a square share theirs."""
        n, wo, alpha = points.n, points.wo, self.material.alpha
        pyramid = shading_pyramid(self.light, alpha)
        u = hammersley(4 * each)
        wi, (pdf, weight, grazing) = np.empty((3, len(n), each)), np.empty((3, len(n), each))
        row, column = np.nonzero(points.mask)
        for k in range(4):
            some = np.flatnonzero((row % 2 == k // 2) & (column % 2 == k % 2))
            lobe = lobe_samples(n[some], wo[some], alpha, u[k::4])
            wi[:, some], pdf[some], weight[some], grazing[some], _ = lobe
        rays, starts = np.moveaxis(wi, 0, -1).reshape(-1, 3), np.repeat(self.off(points), each, axis=0)
        of_map = _looked_up(pyramid, rays, lobe_lod(pdf, len(u), pyramid).ravel())
        more = np.zeros_like(of_map)
        below, seen = self._ground_along(starts, rays)
        more[below] = seen - _looked_up(pyramid, rays[below], np.zeros(below.sum()))
        out, hidden = np.flatnonzero(weight.ravel() > 0), np.zeros(len(rays), bool)
        hidden[out], sent = self._bodies_along(starts[out], rays[out], pyramid)
        more[hidden] = sent[hidden[out]]

        def reflected(light: np.ndarray, emitters: np.ndarray | float | None = None) -> np.ndarray:
            light = light.reshape(*weight.shape, 3)
            terms = [(one[..., None] * light).mean(axis=1) for one in (weight, grazing)]
            if emitters is not None:
                lit = emitters_specular(pyramid, n, wo, alpha, emitters)[1:]
                terms = [one + other for one, other in zip(terms, lit, strict=True)]
            return self.material.f0 * terms[0] + (1.0 - self.material.f0) * terms[1]

        passed = self.open_shares(points, pyramid.emitters, pyramid.emitter_power)
        return reflected(np.where(hidden[:, None], 0.0, of_map), passed), reflected(of_map, 1.0), reflected(more)

    def _bodies_along(
        self, starts: np.ndarray, rays: np.ndarray, pyramid: Pyramid
    ) -> tuple[np.ndarray, Float[np.ndarray, "N 3"]]:
        """Return which rays [N, 3] meet a body, and what it sends along them."""
        hidden, sent = np.zeros(len(rays), bool), np.zeros(rays.shape)
        for body in (self.real, self.own):  # the latter is the nearer
            if body is not None:
                if body is self.own:  # a face seen from behind is the one that the ray left, in a cell next to it
                    faces = first_faces(body, starts, rays)
                    met = (faces >= 0) & ((self.normals[faces] * rays).sum(axis=1) < 0)
                    sent[met] = self._sent(faces[met], rays[met], pyramid)
                else:
                    assert self.beside is not None
                    faces, weights = first_hits(self.beside, body, self.around_real, starts, rays)
                    met = faces >= 0
                    sent[met] = (self.real_colors[self.beside.faces[faces[met]]] * weights[met, :, None]).sum(axis=1)
                hidden |= met
        return hidden, sent

    def _sent(self, faces: np.ndarray, rays: np.ndarray, pyramid: Pyramid) -> Float[np.ndarray, "N 3"]:
        """Return what faces of the object send against rays [N, 3] that meet them: of emitters what no body hides, of
        the rest open_share [3]."""
        n, emitters, power, material = self.normals[faces], pyramid.emitters, pyramid.emitter_power, self.material
        lod = lobe_lod(np.full(len(n), ggx_distribution(1.0, material.alpha) / 4), 1, pyramid)
        fresnel = material.f0 + (1.0 - material.f0) * schlick_weight(-(n * rays).sum(axis=1))[:, None]
        middle = self.spot.mesh.positions[self.spot.mesh.faces[faces]].mean(axis=1)
        passed = self.open_shares(Points(mask=faces >= 0, at=middle, n=n, wo=-rays), emitters, power)
        cosine = np.maximum(n @ emitters.T, 0.0)
        irradiance = np.maximum(self.irradiance(n) - cosine @ power, 0.0) * self.open_share + cosine * passed @ power
        lit = emitters_specular(pyramid, n, -rays, material.alpha, passed)[1:]
        of_emitters = material.f0 * lit[0] + (1.0 - material.f0) * lit[1]
        base = material.albedo * (1.0 - material.f0) * irradiance / np.pi
        return base + fresnel * _looked_up(pyramid, reflect(-rays, n), lod) + of_emitters


def _looked_up(pyramid: Pyramid, directions: np.ndarray, lod: np.ndarray) -> Float[np.ndarray, "N 3"]:
    """Return a pyramid's radiance in directions [N, 3] at levels [N]."""
    return np.stack(lookup_rgb(pyramid, directions[:, 0], directions[:, 1], directions[:, 2], lod), axis=-1)


def draw_on_ground(around: Surroundings, camera: Camera, **finer: int) -> Float[np.ndarray, "S S 4"]:
    """Draw a placed object in its surroundings; see picture.draw_mesh.

    finer: arguments of draw_mesh.
    """
    mesh, size, material = around.spot.mesh, camera.size, around.material
    drawn = draw_mesh(mesh, camera, around.lit, material, **finer)
    points = Points.seen(mesh, camera, min(size, COARSE))
    if not len(points.at):
        return drawn
    base = np.zeros_like(drawn[..., :3])
    if np.any(material.albedo):
        reflected = material.albedo * (1.0 - material.f0)
        coat = draw_mesh(mesh, camera, around.lit, replace(material, albedo=np.zeros(3)), **finer)
        near = Points.seen(mesh, camera, min(size, COARSER))
        remaining, hidden = around.remaining(points)
        around.open_share = remaining.mean(axis=0)
        of_ground, of_bodies, met = around.nearer(near)
        base = drawn[..., :3] - coat[..., :3] + near.picture(reflected * of_ground, size)
        base = np.maximum(base, 0.0) * points.picture(remaining, size)
        mean = (base + coat[..., :3])[drawn[..., 3] > 0].mean(axis=0)
        each = (of_bodies + mean / NEAR_RAYS) / (met + 1 / NEAR_RAYS)
        base += points.picture(hidden, size) * near.picture(reflected * each, size)
        drawn = coat
    each = LOBE_RAYS
    if material.alpha < PATCHES[-1][0]:  # a wider lobe hardly resolves pixels
        points, each = Points.seen(mesh, camera, 2 * points.mask.shape[0]), LOBE_RAYS // 4
    kept, whole, more = (points.picture(one, size, 2) for one in around.coat(points, each))
    drawn[..., :3] = base + np.maximum(drawn[..., :3] * kept / np.maximum(whole, 1e-9) + more, 0.0)
    drawn[..., :3] *= drawn[..., 3:] > 0
    return drawn
