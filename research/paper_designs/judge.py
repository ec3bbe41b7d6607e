"""What the networks of a seed make of unseen and of seen pairs, pair by pair."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.light.reconstruct import reconstruct
from research.paper_designs.blocks import picture_of
from research.paper_designs.designs import DESIGNS, Designs, inputs_of
from research.paper_designs.pairs import Batch, PairMaker, Which, balanced
from research.paper_designs.tables import Tables, mirror_places
from research.paper_designs.transport import TO_EYE

TEST_PAIRS = 1000
"""Test pairs that are judged; of training pairs, half as many."""
BLOCK = 250
WINDOW, SIGMA = 5, 1.5
"""SSIM's 11 x 11 Gaussian (Wang et al. 2004)."""
HDR_TONE = 8.0
"""Radiance that the tone mapping before SSIM of HDR maps makes white."""


class Judge:
    """Scores of the same test pairs every time, of maps and shapes that no network has seen, and of training pairs."""

    def __init__(self, test: Tables, seen: Tables, pairs: int = TEST_PAIRS) -> None:
        self._sets = {"test": (test, balanced(test, pairs, 1)), "seen": (seen, balanced(seen, pairs // 2, 2))}

    def write(self, nets: Designs, path: Path) -> None:
        """One array a set, design and figure: "test/direct/rmse" [pairs] float32; and "test/map", "test/shape",
        "test/material" [pairs]."""
        columns = {}
        for name, (tables, chosen) in self._sets.items():
            columns |= {f"{name}/{key}": value for key, value in scores(nets, tables, chosen).items()}
        partial = path.with_suffix(".part.npz")
        np.savez_compressed(partial, **columns)
        partial.replace(path)


@torch.no_grad()
def scores(nets: Designs, tables: Tables, chosen: Which) -> dict[str, np.ndarray]:
    """ "design/figure" and what each pair is, [pairs] each."""
    parts: list[dict[str, torch.Tensor]] = []
    maker = PairMaker(tables)
    for first in range(0, len(chosen.map), BLOCK):
        part = Which(**{name: getattr(chosen, name)[first : first + BLOCK] for name in Which.__slots__})
        parts.append(_block(nets, maker(part), tables.ldr.shape[2], round(tables.surface.shape[1] ** 0.5)))
    found = {key: torch.cat([part[key] for part in parts]).cpu().numpy() for key in parts[0]}
    return found | {name: getattr(chosen, name).cpu().numpy().astype(np.int16) for name in ("map", "shape", "material")}


def _block(nets: Designs, batch: Batch, rows: int, side: int) -> dict[str, torch.Tensor]:
    estimate = nets["image"](batch.photo)
    found = _figures("image", picture_of(estimate, side), picture_of(batch.irradiance, side), wraps=False)
    pixels, maps = estimated_maps(nets, batch, estimate, rows, side)
    truth, ln_truth = picture_of(batch.ldr, rows), picture_of(batch.ln_radiance, rows)
    for name, ldr in maps.items():
        found |= _figures(name, ldr, truth, wraps=True)
        if name in DESIGNS:
            ln_radiance = picture_of(nets["hdr"](pixels[name]), rows)
            found |= _hdr_figures(name, ln_radiance, ldr, ln_truth)
    return found


def estimated_maps(
    nets: Designs, batch: Batch, estimate: torch.Tensor, rows: int, side: int
) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
    """LDR maps by design: in the order of blocks [B, Q, 3], without the rivals; and as pictures [B, 3, rows, 2 rows].

    estimate: what nets["image"] makes of the photos.
    """
    seen = inputs_of(batch, estimate)
    normals, mask = picture_of(batch.normals, side), picture_of(batch.photo[..., 3:], side)
    pixels = {name: nets[name](seen[design.sees]).clip(0, 1) for name, design in DESIGNS.items()}
    pixels["ideal_on_estimate"] = nets["ideal"](seen["estimate"]).clip(0, 1)
    maps = {name: picture_of(values, rows) for name, values in pixels.items()}
    maps["georgoulis"] = unwrap_sphere(picture_of(nets["georgoulis"](batch.photo), side).clip(0, 1), rows)
    mirror = nets["meka"](torch.cat([batch.photo, batch.normals], dim=2)).clip(0, 1)
    maps["meka"] = unwrap_mirror(picture_of(mirror, side), normals, mask, rows)
    return pixels, maps


def _figures(name: str, estimate: torch.Tensor, truth: torch.Tensor, wraps: bool) -> dict[str, torch.Tensor]:
    return {f"{name}/rmse": rmse(estimate, truth), f"{name}/ssim": ssim(estimate, truth, wraps)}


def _hdr_figures(
    name: str, ln_radiance: torch.Tensor, ldr: torch.Tensor, ln_truth: torch.Tensor
) -> dict[str, torch.Tensor]:
    """Of Eq. 7's radiance: RMSE of its common logarithm, SSIM of its tone-mapped values."""

    def last(x: torch.Tensor) -> torch.Tensor:
        return x.permute(0, 2, 3, 1)

    truth = ln_truth.exp()
    radiance = reconstruct(last(ldr), last(ln_radiance)).permute(0, 3, 1, 2).clip(min=1e-3)
    tones = response(radiance / HDR_TONE), response(truth / HDR_TONE)
    return {
        f"{name}/hdr_rmse": rmse(radiance.log10(), truth.clip(min=1e-3).log10()),
        f"{name}/hdr_ssim": ssim(*tones, wraps=True),
    }


def rmse(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Of pictures [B, C, H, W]: [B], the plain mean over all numbers, as in the paper."""
    return (a - b).square().mean(dim=(1, 2, 3)).sqrt()


def ssim(a: torch.Tensor, b: torch.Tensor, wraps: bool) -> torch.Tensor:
    """Wang et al. 2004, Eq. 13, of pictures [B, C, H, W] in [0, 1]: [B].

    wraps: columns go on around and rows by their edge, so that every pixel has a window; else whole windows count.
    """
    both = torch.cat([a, b, a * a, b * b, a * b])
    if wraps:
        both = F.pad(F.pad(both, (WINDOW, WINDOW, 0, 0), "circular"), (0, 0, WINDOW, WINDOW), "replicate")
    down, across = (_windows(size, a.device) for size in both.shape[2:])
    blurred = down @ both.flatten(0, 1) @ across.T
    mean_a, mean_b, aa, bb, ab = blurred.reshape(5, len(a), -1)
    c1, c2 = 0.01**2, 0.03**2
    top = (2 * mean_a * mean_b + c1) * (2 * (ab - mean_a * mean_b) + c2)
    bottom = (mean_a**2 + mean_b**2 + c1) * (aa - mean_a**2 + bb - mean_b**2 + c2)
    return (top / bottom).mean(dim=1)


@lru_cache(maxsize=8)
def _windows(size: int, device: torch.device) -> torch.Tensor:
    """Weights [size - 10, size] of a line's pixels in each whole window."""
    x = torch.arange(size)[None] - torch.arange(WINDOW, size - WINDOW)[:, None]
    weights = torch.where(x.abs() <= WINDOW, torch.exp(-x.square() / (2 * SIGMA**2)), 0.0)
    return (weights / weights.sum(dim=1, keepdim=True)).to(device)


def unwrap_sphere(sphere: torch.Tensor, rows: int) -> torch.Tensor:
    """Mirror spheres [B, 3, S, S], drawn as tables.sphere_places says, to maps [B, 3, rows, 2 rows]."""
    half = normalize(pixel_directions(rows) + TO_EYE * (1 + 1e-6))
    theta = np.arccos(np.clip(half[..., 2], -1, 1)) / (np.pi / 2)
    length = np.maximum(np.hypot(half[..., 0], half[..., 1]), 1e-9)
    place = np.stack([half[..., 0], -half[..., 1]], axis=-1) / length[..., None] * theta[..., None]
    grid = torch.from_numpy(place.astype(np.float32)).to(sphere.device).expand(len(sphere), -1, -1, -1)
    return F.grid_sample(sphere, grid, padding_mode="border", align_corners=False)


def unwrap_mirror(mirror: torch.Tensor, normals: torch.Tensor, mask: torch.Tensor, rows: int) -> torch.Tensor:
    """Mirror images [B, 1, S, S] of shapes with these normals [B, 3, S, S], seen from far away, to grey maps [B, 3,
    rows, 2 rows]."""
    uv = torch.from_numpy(mirror_places(normals.permute(0, 2, 3, 1).cpu().numpy())).to(mirror.device)
    return spread_mirror(mirror, uv, mask, rows)


def spread_mirror(mirror: torch.Tensor, uv: torch.Tensor, mask: torch.Tensor, rows: int) -> torch.Tensor:
    """Mirror images [B, 1, S, S] whose pixels see the map at uv [B, S, S, 2] to grey maps [B, 3, rows, 2 rows].

    Every pixel goes where it sees the map; what none sees is filled from ever coarser means.
    """
    column = (uv[..., 0] * 2 * rows).long().clip(0, 2 * rows - 1)
    row = (uv[..., 1] * rows).long().clip(0, rows - 1)
    place = (row * 2 * rows + column).flatten(1)
    there = mask.flatten(1)
    values = mirror.new_zeros(len(mirror), 2 * rows * rows).scatter_add(1, place, mirror.flatten(1) * there)
    count = torch.zeros_like(values).scatter_add(1, place, there)
    shape = (len(mirror), 1, rows, 2 * rows)
    return _fill(values.reshape(shape), count.reshape(shape)).expand(-1, 3, -1, -1)


def _fill(values: torch.Tensor, count: torch.Tensor) -> torch.Tensor:
    """Sums over counts, [B, 1, H, 2H] each; where the count is 0, of the next coarser scale that has some."""
    mean = values / count.clip(min=1e-6)
    if values.shape[2] == 1:
        return mean
    coarse = _fill(4 * F.avg_pool2d(values, 2), 4 * F.avg_pool2d(count, 2))
    return torch.where(count > 0, mean, F.interpolate(coarse, scale_factor=2, mode="bilinear"))


def clustered_error(d: np.ndarray, maps: Sequence[int], shapes: Sequence[int]) -> float:
    """Standard error of the mean of d [N], where pairs under one map, and pairs of one shape, may err together.

    V_map + V_shape - V_both (Cameron, Gelbach and Miller 2011), and no less than the larger of the first two.
    """
    both = np.asarray(maps).astype(np.int64) * 10_000 + np.asarray(shapes)
    by_map, by_shape, by_both = (_variance(d, clusters) for clusters in (maps, shapes, both))
    return float(np.sqrt(max(by_map + by_shape - by_both, by_map, by_shape)))


def _variance(d: np.ndarray, clusters: Sequence[int]) -> float:
    """Of the mean of d, where those of one cluster may err together (Liang and Zeger 1986)."""
    _, number = np.unique(clusters, return_inverse=True)
    sums = np.bincount(number, weights=d - d.mean())
    return float(len(sums) / (len(sums) - 1) * np.square(sums / len(d)).sum())
