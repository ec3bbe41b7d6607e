"""Shadow of a mesh on the ground under a whole map: contact shadow and the dominant light's at once.

    ratio(p) = integral of L V(p, wi) B(p, wi) cos dwi / integral of L B(p, wi) cos dwi

over the sky above the ground, is the remaining share of a Lambert ground's irradiance at p, for each channel. V is the
visibility past the mesh, B past what stands beside it: light that the photo's own object keeps from the ground cannot
be lost once more. The integrals are sums over directions with density L cos (luminance). Light is distant: the points
of the ground that a mesh occludes from wi are its projection along wi, rasterised, so one drawing per direction serves
every p. In place of what it keeps off, the mesh sends light of its own (`with_light`); where the real object's shadow
is seen, its depth says which share of the light is the dominant one's, and its colour counts (`as_seen`).
relight.insert.Stage.shadow draws it.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import orthonormal_basis, world_from_local
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.resample import between, resample
from anyprobe.core.sampling import hammersley, square_to_cosine_hemisphere
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import irradiance_map
from anyprobe.light.light_sources import edge_cosine, find_dominant_light
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import cover
from anyprobe.render.voxels import open_shares, voxelize

NUM_DIRECTIONS = 192
SHADOW_CELLS = 320
BACK_DIRECTIONS, BACK_CELLS = 64, 48
"""Number of directions and grid side of the light that the mesh sends to the ground."""
REACH = 5.0
"""Half the side of the shaded square of ground, in radii of the object."""

FADE = 0.75
"""Share of the reach beyond which the shadow fades to nothing at the edge."""

LEAST_COSINE = 0.05
"""Smallest cosine: lower light (under 3 degrees) throws its shadow past the reach, and carries hardly any
irradiance."""

LEAST_LIT = 0.02
"""Smallest share of the light that must reach the ground past what stands beside the object: none of less is lost."""

SHADED, LIT, LEAST_SEEN = 0.5, 0.9, 0.005
"""Shares left of the dominant light below which ground is in the shadow of what stands beside, and of all light above
which it is not; and the share of the cells of either that must be seen."""
DEEP = 0.25
"""Quantile of the shaded cells that counts: some of them are beside the shadow that is seen."""


def sample_sky(radiance: np.ndarray, up: np.ndarray, count: int = NUM_DIRECTIONS) -> tuple[np.ndarray, np.ndarray]:
    """Draw directions above the ground with density L cos.

    Args:
        radiance: [H, 2H, 3]. up: [3], in the map's frame.
    Returns:
        directions: [N, 3], each once. weights: [N, 3], each direction's share of the ground's irradiance in each
        channel; they sum to 1, or to 0 where a channel is black.
    """
    radiance = reduced(radiance)
    # pixels cut into 4 x 4, so that cos and the horizon are right in pixels that the horizon crosses
    light = np.repeat(np.repeat(radiance, 4, axis=0), 4, axis=1)
    d = pixel_directions(len(light))
    cosine, sine = d @ up, np.hypot(d[..., 0], d[..., 2])
    power = luminance(light) * np.where(cosine > LEAST_COSINE, cosine, 0.0) * sine
    rows = np.cumsum(power.sum(axis=1))
    if not rows[-1] > 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    numbers = hammersley(count).astype(np.float64)
    row = np.searchsorted(rows, numbers[:, 0] * rows[-1], side="right")
    columns = np.cumsum(power[row], axis=1)
    column = np.array(
        [np.searchsorted(sums, x * sums[-1], side="right") for sums, x in zip(columns, numbers[:, 1], strict=True)]
    )
    row, column = np.minimum(row, len(d) - 1), np.minimum(column, 2 * len(d) - 1)
    drawn, times = np.unique(row * 2 * len(d) + column, return_counts=True)  # a sun's pixel is drawn many times
    row, column = np.divmod(drawn, 2 * len(d))
    color = light[row, column].astype(np.float64)
    weights = color * (times / luminance(color))[:, None]
    return d[row, column], weights / np.maximum(weights.sum(axis=0), 1e-12)


class GroundShadow:
    """Remaining share of the ground's irradiance around a mesh: a square of the ground, drawn once."""

    def __init__(
        self,
        mesh: Mesh,
        foot: np.ndarray,
        radius: float,
        up: np.ndarray,
        radiance: np.ndarray,
        count: int = NUM_DIRECTIONS,
        grid: int = SHADOW_CELLS,
        *,
        beside: Mesh | None = None,
    ) -> None:
        """Draw the shadow. The mesh stands at foot [3] on the plane up . (x - foot) = 0, all in one frame.

        beside: what shades the ground without the mesh, too.
        """
        self.mesh, self.foot, self.up = mesh, foot, up
        self.sky = sky_irradiance(radiance, up)
        self.side, self.across = orthonormal_basis(up)
        self.reach = REACH * radius
        self.grid = grid
        self._draw(mesh, beside, radiance, count)
        self._shine((1.0, 1.0), np.ones(3))

    def _draw(self, mesh: Mesh, beside: Mesh | None, radiance: np.ndarray, count: int) -> None:
        """Keep the shares of the light that reach the ground past what stands beside, and what the mesh keeps off of
        them, [2, G, G, 3]: of the dominant light last."""
        bodies = [body for body in (mesh, beside) if body is not None]
        relative = [body.positions - self.foot for body in bodies]
        height = [points @ self.up for points in relative]
        directions, weights = sample_sky(radiance, self.up, count)
        source = find_dominant_light(radiance)
        is_dominant = directions @ source.direction > edge_cosine(source)
        dominant = weights[is_dominant].sum(axis=0)
        lost, past = np.zeros((2, 2, self.grid * self.grid, 3))
        past += np.stack([1.0 - dominant, dominant])[:, None]
        golden = np.arange(len(directions)) * (5**0.5 - 1) / 2
        within_cell = np.stack([golden % 1, hammersley(len(directions))[:, 1]], axis=-1) - 0.5  # else edges are stairs
        for direction, weight, shift, kind in zip(directions, weights, within_cell, is_dominant * 1, strict=True):
            own, *others = (
                self._covered(points - (high / (direction @ self.up))[:, None] * direction, body.faces, shift)
                for points, high, body in zip(relative, height, bodies, strict=True)
            )
            kept = others[0] if others else np.zeros_like(own)
            past[kind, kept] -= weight
            lost[kind, own & ~kept] += weight
        self.dominant = dominant
        self._past, self._lost = (one.reshape(2, self.grid, self.grid, 3) for one in (past, lost))

    def _shine(self, scale: tuple[float, float], color: np.ndarray) -> None:
        """Make ratio and what reaches the ground past what stands beside, [G, G, 3], of scale times all other light and
        the dominant one; color [3]: of what the latter's shadow loses."""
        self.reached = scale[0] * self._past[0] + scale[1] * self._past[1]
        lost = scale[0] * self._lost[0] + scale[1] * color * self._lost[1]
        share = np.where(self.reached < LEAST_LIT, 0.0, lost / np.maximum(self.reached, LEAST_LIT))
        self.ratio = 1.0 - np.clip(share, 0.0, 1.0) * self._inward()

    def _inward(self) -> np.ndarray:
        """Return weights [G, G, 1] that fade at the edge."""
        at = np.abs((np.arange(self.grid) + 0.5) / self.grid * 2 - 1)
        return np.clip((1 - np.maximum.outer(at, at)) / (1 - FADE), 0.0, 1.0)[..., None]

    def points(self, count: int) -> np.ndarray:
        """Return the middles of count x count cells of the square, [count * count, 3]."""
        x = ((np.arange(count) + 0.5) / count * 2 - 1) * self.reach
        return (self.foot + x[None, :, None] * self.side + x[:, None, None] * self.across).reshape(-1, 3)

    def as_seen(self, likely: float, seen: np.ndarray | None = None) -> GroundShadow:
        """Return the shadow in a light of which the dominant one is as strong as it is likely, up to how strong the
        shadow of what stands beside shows it by its depth, and in that one's colour.

        seen: radiance of the ground at points(grid), [G * G, 3], NaN where it is not seen.
        """
        shares, found = np.maximum([1.0 - self.dominant, self.dominant], 1e-3), likely * self.dominant
        if seen is not None:
            past, known = self._past.reshape(2, -1, 3) / shares[:, None], np.isfinite(seen).all(axis=-1)
            shaded, lit = known & (luminance(past[1]) < SHADED), known & (luminance(self.reached).ravel() > LIT)
            if min(shaded.sum(), lit.sum()) >= LEAST_SEEN * len(seen):
                left = np.quantile(seen[shaded], DEEP, axis=0) / np.maximum(np.median(seen[lit], axis=0), 1e-3)
                lost = 1.0 - np.median(past[:, shaded], axis=1)  # of all other light there, and of the dominant one
                shown = (1.0 - left - lost[0]) / np.maximum(lost[1] - lost[0], LEAST_LIT)
                found = np.clip(shown, found, self.dominant)
        before, now = (max(float(luminance(one)), 1e-3) for one in (self.dominant, found))
        other = copy(self)
        other._shine(((1.0 - now) / max(1.0 - before, 1e-3), now / before), found / now * before / shares[1])
        return other

    def with_light(self, sent: np.ndarray) -> GroundShadow:
        """Return the shadow on a ground that the mesh lights, too, by radiance `sent` [3] from sides that are not in
        its shadow: those that face a point get as much of the light as it.

        It sends no more than a white ground does.
        """
        other = copy(self)
        other.ratio = self.ratio * (1 + self._mesh_share * np.minimum(np.pi * sent / np.maximum(self.sky, 1e-9), 1.0))
        return other

    @cached_property
    def _mesh_share(self) -> np.ndarray:
        """The share of what the ground sees, weighted by the cosine, that is the mesh, [G, G, 1]."""
        toward = world_from_local(square_to_cosine_hemisphere(hammersley(BACK_DIRECTIONS)), self.up[None])
        hidden = 1.0 - open_shares(voxelize(self.mesh), self.points(BACK_CELLS), toward).mean(axis=0)
        larger = resample(hidden.reshape(BACK_CELLS, BACK_CELLS), (self.grid, self.grid), smooth=True)
        return larger[..., None] * self._inward()

    def _covered(self, relative: np.ndarray, faces: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Return the cells [G * G] that triangles cover at a shift [2] from their centres; corners relative to the
        foot."""
        covered = np.zeros(self.grid * self.grid, bool)
        covered[cover((self._cells(relative) - shift)[faces], self.grid)[2]] = True
        return covered

    def _cells(self, relative: np.ndarray) -> np.ndarray:
        """Return column and row on the grid [..., 2] of points relative to the foot."""
        at = np.stack([relative @ self.side, relative @ self.across], axis=-1)
        return (at / self.reach + 1) * self.grid / 2

    def at(self, points: np.ndarray, *, with_beside: bool = False) -> np.ndarray:
        """Return the ratio [P, 3] at points [P, 3] of the ground, with the shadow of what stands beside the mesh, too,
        if asked; exactly 1 outside the square."""
        grid = self.ratio * (1.0 - (1.0 - self.reached) * self._inward()) if with_beside else self.ratio
        cell = self._cells(points - self.foot) - 0.5
        inside = np.isfinite(cell).all(axis=-1) & ((cell >= 0) & (cell < self.grid - 1)).all(axis=-1)
        ratio = np.ones((len(points), 3))
        ratio[inside] = between(grid, *cell[inside].T)
        return ratio


def sky_irradiance(radiance: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Compute the irradiance E [3] of a map on the ground, its normal up."""
    return bilinear(irradiance_map(reduced(radiance)), direction_to_uv(np.asarray(up, np.float32)[None]))[0]
