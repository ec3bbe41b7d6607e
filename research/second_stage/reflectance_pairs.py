"""What a second stage learns from, made on the fly: points of reflectance maps, no photos.

A light turned into a camera's frame is reflected by all materials at once (reflectance_tables) and serves many
samples. A sample has a material, the normals of a real surface, the camera's exposure, and the errors of the first
stage on that very surface (first_stage). Batch number k is a function of (seed, k) alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import direction_to_uv, pixel_directions
from anyprobe.core.response import CameraCurve, response
from anyprobe.learning.dataset import distributions
from anyprobe.learning.dataset.batch_shading import pixel_wo
from anyprobe.learning.dataset.distributions import METALS
from anyprobe.learning.dataset.seen_surroundings import ASPECTS, GAIN_STOPS, TURN_COLUMNS
from anyprobe.learning.dataset.surfaces import ELEVATION_SINES
from anyprobe.learning.nets.lifting import mirror_direction
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.render.reflectance import lookup_coords
from anyprobe.scatter.microfacet import albedo_table, directional_albedo, f0_from_ior
from research.second_stage.first_stage import SeenSurfaces
from research.second_stage.reflectance_tables import ALPHAS, ROWS
from research.world.materials import kind_given_alpha

BASE_ROWS = 64
"""Rows of the maps that are turned."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ReflectanceConfig:
    """batch: samples a step; fresh: lights made at once, every `period` steps; pool: how many such groups are at hand.

    world: share of samples with dataset.distributions; the others have those of dataset.pairs.
    errors: share of samples with the first stage's normals, the others have true ones; most_errors: by how much
    its errors are drawn out at most, since they are smaller on surfaces that it has learned from.
    normals, material, surroundings: shares of samples that come with them, as input.
    blends: share of lights that are a mixture of two.
    """

    batch: int = 128
    fresh: int = 64
    period: int = 20
    pool: int = 10
    seed: int = 0
    world: float = 0.5
    errors: float = 1.0
    most_errors: float = 1.5
    normals: float = 0.4
    material: float = 0.4
    surroundings: float = 0.3
    blends: float = 0.35


@dataclass(frozen=True, kw_only=True, slots=True)
class ReflectanceBatch:
    """B samples, pictures of S = 32.

    photo [B, 3, S, S]: display RGB; weight [B, 1, S, S]: coverage by the given mask; normals [B, 3, S, S]: unit,
    given or estimated; given [B, 1]: whether they are given; tan_half [B, 1]; root_alpha [B, 1]: estimated, or of the
    given material; material [B, 8]: 1, f0, albedo, root alpha of a given one, else zeros; surroundings [B, 4, 32, 64]:
    display RGB times cover, and cover.
    radiance [B, 3, 32, 64]: the target, in exposure units; true_material [B, 8]: as material, the first number whether
    it is a metal.
    """

    photo: torch.Tensor
    weight: torch.Tensor
    normals: torch.Tensor
    given: torch.Tensor
    tan_half: torch.Tensor
    root_alpha: torch.Tensor
    material: torch.Tensor
    surroundings: torch.Tensor
    radiance: torch.Tensor
    true_material: torch.Tensor

    def inputs(self) -> tuple[torch.Tensor, ...]:
        """What the network is given, in its order."""
        return tuple(getattr(self, one.name) for one in fields(self)[:8])


@dataclass(frozen=True, kw_only=True, slots=True)
class _Lights:
    """tables [L, T, 3, R, R]; radiance [L, 3, 64, 128]."""

    tables: torch.Tensor
    radiance: torch.Tensor


class ReflectanceSource:
    """Endless batches; `batch(k)` for consecutive k is fast."""

    def __init__(
        self, maps: torch.Tensor, matrices: np.ndarray, surfaces: SeenSurfaces, config: ReflectanceConfig
    ) -> None:
        """maps [N, 3, 64, 128] of mean luminance 1; matrices of reflectance_tables."""
        self.config, self.maps, self.surfaces = config, maps, surfaces
        self._side = math.isqrt(matrices.shape[1])
        self._matrices = torch.from_numpy(matrices).to(torch.bfloat16).flatten(0, 1)  # [T side^2, pixels]
        self._table = torch.from_numpy(albedo_table())
        directions = pixel_directions(MAP_HEIGHT).reshape(-1, 3)
        self._directions = torch.from_numpy(np.ascontiguousarray(directions))
        self._kept: dict[int, _Lights] = {}

    @torch.no_grad()
    def batch(self, step: int) -> ReflectanceBatch:
        """The samples of step number `step`."""
        pool = self._pool(step)
        rng = np.random.default_rng((self.config.seed, 2, step))
        return self._samples(pool, rng)

    def _pool(self, step: int) -> list[_Lights]:
        first = step // self.config.period
        wanted = range(first, first + self.config.pool)
        for key in [key for key in self._kept if key not in wanted]:
            del self._kept[key]
        for key in wanted:
            if key not in self._kept:
                self._kept[key] = self._draw_lights(np.random.default_rng((self.config.seed, 1, key)))
        return [self._kept[key] for key in wanted]

    def _draw_lights(self, rng: np.random.Generator) -> _Lights:
        count = self.config.fresh
        radiance = self._turned(rng, count)
        share = torch.from_numpy(
            np.where(rng.random(count) < self.config.blends, rng.uniform(0.1, 0.5, count), 0.0).astype(np.float32)
        )[:, None, None, None]
        if bool((share > 0).any()):
            radiance = torch.lerp(radiance, self._turned(rng, count), share)
        tint = np.exp(rng.normal(0.0, 0.12, (count, 3, 1, 1))).astype(np.float32)
        radiance = radiance * torch.from_numpy(tint)
        pixels = F.avg_pool2d(radiance, MAP_HEIGHT // ROWS).flatten(2).flatten(0, 1)  # [3 L, 2 ROWS^2]
        tables = (self._matrices @ pixels.to(torch.bfloat16).T).float()
        tables = tables.reshape(-1, self._side, self._side, count, 3).permute(3, 0, 4, 1, 2)
        return _Lights(tables=tables.contiguous(), radiance=radiance)

    def _turned(self, rng: np.random.Generator, count: int) -> torch.Tensor:
        """Maps in the frames of cameras, [count, 3, 64, 128]."""
        which = torch.from_numpy(rng.integers(len(self.maps), size=count))
        turns = []
        for _ in range(count):
            elevation = float(np.arcsin(rng.uniform(ELEVATION_SINES[0], ELEVATION_SINES[-1])))
            turn = world_from_camera(rng.uniform(0, 2 * np.pi), elevation, rng.normal(0, 0.05))
            turns.append(np.diag([-1.0, 1.0, 1.0]) @ turn if rng.random() < 0.5 else turn)
        turns = torch.from_numpy(np.stack(turns).astype(np.float32))
        uv = direction_to_uv(self._directions @ turns.transpose(1, 2))  # [count, P, 2]
        wrapped = F.pad(self.maps[which], (1, 1, 0, 0), mode="circular")
        width = 2 * BASE_ROWS
        place = torch.stack([(uv[..., 0] * width + 1) / (width + 2), uv[..., 1]], dim=-1) * 2 - 1
        place = place.unflatten(1, (MAP_HEIGHT, 2 * MAP_HEIGHT))
        return F.grid_sample(wrapped, place, mode="bilinear", padding_mode="border", align_corners=False)

    def _samples(self, pool: list[_Lights], rng: np.random.Generator) -> ReflectanceBatch:
        config, count = self.config, self.config.batch
        steps, lights = rng.integers(len(pool), size=count), rng.integers(config.fresh, size=count)
        index = rng.integers(len(self.surfaces.tan_half), size=count)
        true = torch.from_numpy(self.surfaces.true[index]).float()
        estimated = torch.from_numpy(self.surfaces.estimated[index]).float()
        weight = torch.from_numpy(self.surfaces.mask[index]).float()[:, None]
        flip = torch.from_numpy(rng.random(count) < 0.5)
        true[flip], estimated[flip] = (_mirrored(one[flip]) for one in (true, estimated))
        weight[flip] = weight[flip].flip(3)
        tan_half = torch.from_numpy(self.surfaces.tan_half[index])[:, None]
        wo = pixel_wo(tan_half[:, :, None, None], true.shape[-1])  # [B, S, S, 3]
        world = rng.random(count) < config.world
        f0, albedo, alpha, kind_metal = self._materials(index, world, rng)

        inside = (true.abs().amax(dim=1, keepdim=True) > 0.25).float()
        light = torch.stack([pool[s].radiance[i] for s, i in zip(steps, lights, strict=True)])
        tables = [pool[s].tables[i] for s, i in zip(steps, lights, strict=True)]
        seen = self._reflected(tables, light, true, wo, f0, albedo, alpha)
        gain, curve = self._exposure(seen, inside, light, world, rng)
        light = light * gain
        behind = F.grid_sample(light, direction_to_uv(-wo) * 2 - 1, padding_mode="border", align_corners=False)
        display = response(torch.lerp(behind, seen * gain, inside).clip(min=0.0), curve)
        noise = rng.standard_normal(display.shape, np.float32) * rng.uniform(0.001, 0.006, (count, 1, 1, 1))
        photo = (display + torch.from_numpy(noise.astype(np.float32))).clip(0.0, 1.0)

        given = torch.from_numpy(rng.random(count) < config.normals)
        exact = given | torch.from_numpy(rng.random(count) >= config.errors)
        normals = self._with_errors(true, estimated, inside, exact, rng)
        root_alpha = torch.from_numpy(self._estimated_alpha(index, alpha, rng))
        with_material = torch.from_numpy(rng.random(count) < config.material)[:, None].float()
        numbers = torch.cat([f0, albedo, torch.from_numpy(np.sqrt(alpha))[:, None]], dim=1)
        root_alpha = torch.where(with_material[:, 0] > 0, numbers[:, 6], root_alpha)[:, None]
        target = F.avg_pool2d(light, MAP_HEIGHT // 32)
        return ReflectanceBatch(
            photo=photo * (weight > 0),
            weight=weight,
            normals=normals,
            given=given[:, None].float(),
            tan_half=tan_half,
            root_alpha=root_alpha.float(),
            material=torch.cat([with_material, numbers * with_material], dim=1),
            surroundings=self._surroundings(target, tan_half, weight, curve, rng),
            radiance=target,
            true_material=torch.cat([kind_metal[:, None], numbers], dim=1),
        )

    def _materials(
        self, index: np.ndarray, world: np.ndarray, rng: np.random.Generator
    ) -> tuple[torch.Tensor, torch.Tensor, np.ndarray, torch.Tensor]:
        """f0 [B, 3], albedo [B, 3], alpha [B], metal [B]: near the width that the first stage saw the surface in."""
        count = len(index)
        alpha = self.surfaces.root_alpha[index].astype(np.float64) ** 2 * np.exp(rng.normal(0.0, 0.1, count))
        alpha = np.clip(alpha, 0.01, 1.0)
        chances = kind_given_alpha(alpha).cumsum(axis=1)
        kind = (rng.random((count, 1)) > chances[:, :3]).sum(axis=1)
        albedo, f0 = distributions.draw_colors(rng, kind)
        metal, (other_albedo, other_f0) = rng.random(count) < 0.45, _older(rng, count)
        metal_f0 = np.array(METALS)[rng.integers(len(METALS), size=count)] * rng.uniform(0.75, 1.0, (count, 1))
        metal_f0 = np.clip(metal_f0 + rng.normal(0, 0.02, (count, 3)), 0.2, 1.0)
        other_f0 = np.where(metal[:, None], metal_f0, other_f0)
        other_albedo = np.where(metal[:, None], 0.0, other_albedo)
        f0 = np.where(world[:, None], f0, other_f0).astype(np.float32)
        albedo = np.where(world[:, None], albedo, other_albedo).astype(np.float32)
        is_metal = np.where(world, kind == 0, metal).astype(np.float32)
        return (torch.from_numpy(f0), torch.from_numpy(albedo), alpha.astype(np.float32), torch.from_numpy(is_metal))

    def _reflected(
        self,
        tables: list[torch.Tensor],
        light: torch.Tensor,
        normals: torch.Tensor,
        wo: torch.Tensor,
        f0: torch.Tensor,
        albedo: torch.Tensor,
        alpha: np.ndarray,
    ) -> torch.Tensor:
        """Radiance [B, 3, S, S] of the points; anything outside the objects."""
        below, share, mirror = _between(alpha)
        one, grazing = (
            torch.stack([torch.lerp(t[2 * b + k], t[2 * b + 2 + k], float(s))
                         for t, b, s in zip(tables, below, share, strict=True)])
            for k in (0, 1)
        )  # fmt: skip
        diffuse = torch.stack([t[-1] for t in tables])
        column = torch.from_numpy(alpha)[:, None, None, None]
        n = normals.permute(0, 2, 3, 1)
        _, lobe, at_normal, gain_one, gain_grazing = lookup_coords(n, wo, column.clip(min=ALPHAS[0]), self._table)
        f0, albedo = (each[:, :, None, None] for each in (f0, albedo))
        both = F.grid_sample(torch.cat([one, grazing], dim=1), lobe, align_corners=False)
        below_coat = albedo * F.grid_sample(diffuse, at_normal, align_corners=False)
        s1, ss = both[:, :3] * gain_one[:, None], both[:, 3:] * gain_grazing[:, None]
        narrow = np.nonzero(mirror > 0)[0]
        if len(narrow):
            each = mirror_direction(normals[narrow], wo[narrow].permute(0, 3, 1, 2)).permute(0, 2, 3, 1)
            shown = F.grid_sample(
                light[narrow], direction_to_uv(each) * 2 - 1, padding_mode="border", align_corners=False
            )
            cosine = (n[narrow] * wo[narrow]).sum(dim=-1).clip(min=0.0)
            e1, es = directional_albedo(cosine, column[narrow, ..., 0], self._table)
            part = torch.from_numpy(mirror[narrow]).float()[:, None, None, None]
            s1[narrow] = torch.lerp(s1[narrow], shown * e1[:, None], part)
            ss[narrow] = torch.lerp(ss[narrow], shown * es[:, None], part)
        return torch.lerp(ss + below_coat, s1, f0)

    def _exposure(
        self, seen: torch.Tensor, inside: torch.Tensor, light: torch.Tensor, world: np.ndarray, rng: np.random.Generator
    ) -> tuple[torch.Tensor, CameraCurve]:
        """Gains with white balance [B, 3, 1, 1] and curves, by the cameras of either kind of prior."""
        count = len(seen)
        weights = torch.tensor(REC709)[:, None, None]
        on_object = ((seen * weights).sum(1, keepdim=True) * inside).sum((1, 2, 3)) / inside.sum((1, 2, 3)).clip(min=1)
        on_object = on_object.double().numpy().clip(1e-6)
        luminance = (light * weights).sum(1)
        scene = torch.exp(torch.log(luminance.clip(min=1e-4)).mean((1, 2))).double().numpy()
        key = np.exp(rng.uniform(np.log(0.1), np.log(0.6), count)) / on_object
        scene = 0.25 * np.exp(rng.uniform(np.log(0.5), np.log(2.0), count)) / scene
        metering = rng.uniform(0.0, 0.7, count)
        older = key**metering * scene ** (1 - metering)
        older *= np.clip(on_object * older, 0.03, 0.9) / (on_object * older)
        weight, key = distributions.draw_metering(rng, count)
        newer = distributions.metered_gain(on_object, distributions.frame_level(luminance.numpy()), weight, key)
        newer *= np.clip(on_object * newer, *distributions.OBJECT_RANGE) / (on_object * newer)
        angles = torch.from_numpy(np.cos((np.arange(MAP_HEIGHT) + 0.5) / MAP_HEIGHT * np.pi - np.pi / 2)).float()
        ambient = (light * angles[:, None]).mean((2, 3)) / angles.mean()
        balance = distributions.draw_white_balance(rng, ambient.numpy())
        balance = np.where(world[:, None], balance, np.exp(rng.normal(0.0, 0.08, (count, 3))))
        gain = np.where(world, newer, older)[:, None] * balance
        exponent = np.clip(rng.normal(0.9, 0.1, count), 0.4, 1.6)
        sigma = np.clip(rng.normal(0.6, 0.1, count), 0.2, 1.2)
        column = (torch.from_numpy(each.astype(np.float32))[:, None, None, None] for each in (exponent, sigma))
        curve = CameraCurve(exponent=next(column), sigma=next(column))
        return torch.from_numpy(gain.astype(np.float32))[:, :, None, None], curve

    def _with_errors(
        self, true: torch.Tensor, estimated: torch.Tensor, inside: torch.Tensor, exact: torch.Tensor, rng
    ) -> torch.Tensor:
        """Unit normals as the network gets them: exact but for a small turn, or estimated with drawn-out errors."""
        count = len(true)
        more = torch.from_numpy(rng.uniform(0.8, self.config.most_errors, count).astype(np.float32))
        wrong = _unit(torch.lerp(true, estimated, more[:, None, None, None]))
        wrong = torch.where(wrong[:, 2:] > -0.2, wrong, estimated)
        wrong = torch.where(inside > 0, wrong, estimated)
        angles = torch.from_numpy(rng.normal(0.0, np.radians(2.0), (count, 3)).astype(np.float32))
        turned = _unit(true + torch.cross(angles[:, :, None, None].expand_as(true), true, dim=1))
        turned = torch.where(inside > 0, turned, estimated)
        return torch.where(exact[:, None, None, None], turned, wrong)

    def _estimated_alpha(self, index: np.ndarray, alpha: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Root alpha as the first stage takes it for: its error on this surface."""
        error = self.surfaces.estimated_root_alpha[index] - self.surfaces.root_alpha[index]
        return np.clip(np.sqrt(alpha) + error, 0.05, 1.0).astype(np.float32)

    def _surroundings(
        self, light: torch.Tensor, tan_half: torch.Tensor, weight: torch.Tensor, curve: CameraCurve, rng
    ) -> torch.Tensor:
        """What the rest of the picture shows of the map, [B, 4, 32, 64]; zero for most."""
        count = len(light)
        half = np.tan(np.radians(rng.uniform(45.0, 80.0, count)) / 2)[:, None] / np.stack(
            [np.ones(count), rng.choice(ASPECTS, count)], axis=1
        )
        half = np.where(rng.random((count, 1)) < 0.5, half, half[:, ::-1])
        half = np.maximum(half, tan_half.numpy())
        center = rng.uniform(-1, 1, (count, 2)) * (half - tan_half.numpy())
        d = torch.from_numpy(pixel_directions(light.shape[2]))
        plane = d[..., :2] / -d[..., 2:].clip(max=-0.05)
        off = (plane - torch.from_numpy(center.astype(np.float32))[:, None, None]).abs()
        cover = (off < torch.from_numpy(half.astype(np.float32))[:, None, None]).all(dim=-1) & (d[..., 2] < -0.05)
        grown = F.max_pool2d((weight > 0).float(), 3, 1, 1)
        on_crop = plane * torch.tensor([1.0, -1.0]) / tan_half[:, :, None, None]
        cover = cover[:, None] * (1 - F.grid_sample(grown, on_crop, align_corners=False))
        cover = cover * torch.from_numpy(rng.random(count) < self.config.surroundings)[:, None, None, None]
        columns = int(rng.integers(-TURN_COLUMNS // 2, TURN_COLUMNS // 2 + 1))
        gains = np.exp2(rng.normal(0.0, GAIN_STOPS, (count, 1, 1, 1))).astype(np.float32)
        shown = response(torch.roll(light, columns, dims=3) * torch.from_numpy(gains), curve).clip(max=1.0)
        return torch.cat([shown * cover, cover], dim=1)


def _unit(v: torch.Tensor) -> torch.Tensor:
    """Vectors [B, 3, S, S] of length 1; by far faster than by a norm over a dimension that is not the last."""
    x, y, z = v.unbind(dim=1)
    return v * torch.rsqrt((x * x + y * y + z * z).clip(min=1e-8))[:, None]


def _mirrored(normals: torch.Tensor) -> torch.Tensor:
    return normals.flip(3) * torch.tensor([-1.0, 1.0, 1.0])[:, None, None]


def _older(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Albedo and f0 of the dielectrics of dataset.distributions, [N, 3] each."""
    f0 = np.repeat(f0_from_ior(rng.uniform(1.3, 1.8, (count, 1))), 3, axis=1)
    tint = np.exp(rng.normal(0.0, 1.0, (count, 3)) * rng.choice([0.03, 0.15, 0.6], (count, 1)))
    albedo = rng.uniform(0.08, 0.9, (count, 1)) * tint / tint.max(axis=1, keepdims=True)
    return np.clip(albedo, 0.01, 0.95), f0


def _between(alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The table below each alpha, the share of the one above it, and of what a mirror shows."""
    roots = np.sqrt(ALPHAS)
    place = np.interp(np.sqrt(alpha), roots, np.arange(len(roots)))
    below = np.minimum(place.astype(int), len(roots) - 2)
    return below, place - below, np.clip(1.0 - alpha / ALPHAS[0], 0.0, 1.0)
