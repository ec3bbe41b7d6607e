"""What our renderer ought to give: the integral of Eq. 2-3 over the map itself, without a pyramid.

Multiple importance sampling (Veach's balance heuristic) of three densities: the map's own
brightness, the half vectors of the coat, and the cosine. Every sample reads the map between
its pixel centres, so nothing is prefiltered and the estimate is unbiased.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from measure import Converging

from anyprobe.core.color import luminance
from anyprobe.core.frames import dot, normalize, world_from_local
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_solid_angles, uv_to_direction
from anyprobe.core.sampling import hammersley, square_to_cosine_hemisphere
from anyprobe.paper.equations import ggx_distribution, reflectance
from anyprobe.scatter.materials import Material

SAMPLES = 1024
"""Of each of the three densities, a pass."""
LEAST_PASSES = 4
CHUNK_SAMPLES = 65_536
"""At a time: they fit the processor's cache."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightTable:
    """A map and its brightness as a density to draw from.

    texels [H, 2H, 4]: radiance, and the probability of each pixel times the number of pixels.
    row_edges [H + 1], column_edges [H, 2H + 1]: the distribution down the rows and along each row.
    """

    texels: torch.Tensor
    row_edges: np.ndarray
    column_edges: np.ndarray


def build_table(radiance: np.ndarray) -> LightTable:
    """The table of a map [H, 2H, 3]."""
    height = radiance.shape[0]
    power = luminance(radiance).astype(np.float64) * pixel_solid_angles(height) + 1e-12
    probability = power / power.sum()
    rows = probability.sum(axis=1)
    columns = np.cumsum(probability / rows[:, None], axis=1)
    texels = np.concatenate([radiance, probability[..., None] * probability.size], axis=-1)
    return LightTable(
        texels=torch.from_numpy(texels.astype(np.float32)),
        row_edges=np.concatenate([[0.0], np.cumsum(rows) / rows.sum()]),
        column_edges=np.concatenate([np.zeros((height, 1)), columns / columns[:, -1:]], axis=1),
    )


def _tent(t: np.ndarray) -> np.ndarray:
    """t in [0, 1) to an offset in (-1, 1) with density 1 - |offset|."""
    return np.where(t < 0.5, np.sqrt(2 * t) - 1, 1 - np.sqrt(2 * np.maximum(1 - t, 0)))


def _choose(edges: np.ndarray, u: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """In line lines[i] of the distributions edges [L, N + 1]: the cell of u[i], and where in it, in [0, 1]."""
    flat = (edges + 2.0 * np.arange(len(edges))[:, None]).ravel()  # rising all along
    cell = np.searchsorted(flat, u + 2.0 * lines, side="right") - 1 - lines * edges.shape[1]
    cell = np.clip(cell, 0, edges.shape[1] - 2)
    low, high = edges[lines, cell], edges[lines, cell + 1]
    return cell, np.clip((u - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)


def draw_directions(table: LightTable, u: np.ndarray) -> np.ndarray:
    """Directions [S, 3] with the density of read_light, from u [S, 2] in [0, 1)^2.

    A read between pixel centres is a sum of tents, one on each pixel: choose a pixel, then a
    place under its tent. Beyond a pole the tent is folded back, as the read clamps there.
    """
    height, width = table.texels.shape[:2]
    u = u.astype(np.float64)
    row, down = _choose(table.row_edges[None], u[:, 1], np.zeros(len(u), np.int64))
    column, right = _choose(table.column_edges, u[:, 0], row)
    y = np.abs(row + 0.5 + _tent(down))
    y = np.minimum(y, 2 * height - y)
    x = (column + 0.5 + _tent(right)) % width
    return uv_to_direction(np.stack([x / width, y / height], axis=-1))


def read_light(table: LightTable, d):
    """Radiance [..., 3] along d [..., 3], and the density [..., 1] per steradian that it is drawn with."""
    texel = bilinear(table.texels, direction_to_uv(d))
    sine = torch.sqrt(d[..., 0:1] ** 2 + d[..., 2:3] ** 2).clip(min=1e-4)
    return texel[..., :3], texel[..., 3:] / (2.0 * np.pi**2 * sine)


def separable_coat(material: Material, wo, wi, n):
    """f_r of a conductor with F = 1 and G = G1(wo) G1(wi), as Mitsuba's roughconductor has it."""
    a2 = material.alpha**2
    h = normalize(wo + wi)
    n_dot_wo, n_dot_wi = dot(n, wo).clip(min=1e-6), dot(n, wi).clip(min=1e-6)

    def masking_over_cosine(cosine):
        return 2.0 / (cosine + torch.sqrt(a2 + (1.0 - a2) * cosine**2))

    value = ggx_distribution(dot(n, h), material.alpha) * (
        masking_over_cosine(n_dot_wo) * masking_over_cosine(n_dot_wi) / 4.0
    )
    return torch.where(dot(n, wi) > 0, value, torch.zeros_like(value))


def brdf(material: Material, wo, wi, n):
    """f_r [1/sr], paper Eq. 2; no cosine inside. [..., 3] each -> [..., 3]."""
    return reflectance(material.albedo, material.f0, material.alpha, wo, wi, n)


def one_pass(table: LightTable, n, wo, emitter, u, material: Material, brdf: Callable = brdf):
    """One unbiased estimate of Lo [P, 3] with S samples of each density.

    Args:
        n, wo: [P, 3].   emitter: directions [S, 3] drawn from the table.   u: [2, S, 2] for the other two.
        material: of tensors.   brdf: f_r(material, wo, wi, n).
    """
    n, wo = n[:, None], wo[:, None]
    phi, level = 2.0 * np.pi * u[0][None, :, 0], u[0][None, :, 1]
    cosine = torch.sqrt((1.0 - level) / (1.0 + (material.alpha - 1.0) * (material.alpha + 1.0) * level))  # Karis 2013
    sine = torch.sqrt((1.0 - cosine**2).clip(min=0.0))
    h = world_from_local(torch.stack([sine * torch.cos(phi), sine * torch.sin(phi), cosine], dim=-1), n)
    total = 0.0
    for wi in (
        emitter[None].expand(n.shape[0], -1, -1),
        2.0 * dot(wo, h) * h - wo,
        world_from_local(square_to_cosine_hemisphere(u[1])[None], n),
    ):
        half = normalize(wo + wi)
        n_dot_h = dot(n, half).clip(min=0.0)
        light, drawn = read_light(table, wi)
        pdf = (
            drawn
            + ggx_distribution(n_dot_h, material.alpha) * n_dot_h / (4.0 * dot(wo, half).clip(min=1e-4))
            + dot(n, wi).clip(min=0.0) / np.pi
        )
        value = brdf(material, wo, wi, n) * light * dot(n, wi).clip(min=0.0)
        total = total + (value / pdf.clip(min=1e-12)).sum(dim=1)
    return total / u.shape[1]


def converge(
    table: LightTable,
    points: Callable[[int], tuple[np.ndarray, np.ndarray]],
    material: Material,
    *,
    seconds: float,
    noise: float,
    brdf: Callable = brdf,
    samples: int = SAMPLES,
    seed: int = 0,
) -> Converging:
    """Passes until the mean's relative RMSE is below noise or the time is up.

    points: from a pass's number to its n, wo [P, 3].
    """
    rng = np.random.default_rng(seed)
    result, start = Converging(), time.monotonic()
    material = Material(
        albedo=torch.from_numpy(material.albedo), f0=torch.from_numpy(material.f0), alpha=material.alpha
    )
    chunk = max(1, CHUNK_SAMPLES // samples)
    while result.count < LEAST_PASSES or (result.noise > noise and time.monotonic() - start < seconds):
        n, wo = (torch.from_numpy(np.ascontiguousarray(x, np.float32)) for x in points(result.count))
        shifts = rng.random((3, 2))
        emitter = torch.from_numpy(draw_directions(table, hammersley(samples, shifts[0])).astype(np.float32))
        u = torch.from_numpy(np.stack([hammersley(samples, shift) for shift in shifts[1:]]))
        with torch.no_grad():
            parts = [
                one_pass(table, some_n, some_wo, emitter, u, material, brdf)
                for some_n, some_wo in zip(n.split(chunk), wo.split(chunk), strict=True)
            ]
        result.add(torch.cat(parts).numpy())
    return result
