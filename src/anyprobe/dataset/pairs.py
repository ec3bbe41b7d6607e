"""Training pairs on the fly: a lit material on a surface, through a camera.

Batch number k is a function of (seed, k) alone, so a run that was killed goes on
with exactly the pairs it would have seen.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import REC709
from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.dataset import distributions
from anyprobe.dataset.batch_shading import Behind, column_of, curves, pixel_wo, shade_batch
from anyprobe.dataset.camera import Shot, draw_shot
from anyprobe.dataset.distributions import draw_material
from anyprobe.dataset.ground_plane import Scenes, make_scenes
from anyprobe.dataset.lighting import Illuminator, LitMaterial
from anyprobe.dataset.occlusion import mirrored
from anyprobe.dataset.pair import LN_RANGE
from anyprobe.dataset.photograph import LitObjects, photograph
from anyprobe.dataset.seen_surroundings import (
    GAIN_STOPS,
    draw_frame,
    gather,
    ground_surroundings,
    inside_frame,
    photo_surroundings,
    unsteady,
)
from anyprobe.dataset.shape_augment import join_some, reshape_some
from anyprobe.dataset.surfaces import NUM_ELEVATIONS, SurfaceSet
from anyprobe.dataset.textured import paint_some
from anyprobe.given_material import material_input
from anyprobe.render.reflectance import lookup_coords


@dataclass(frozen=True, kw_only=True, slots=True)
class PairConfig:
    """batch: pairs a step; reuse: pairs a lit material serves; pool: groups of lit materials kept in a lane.

    lanes: step k belongs to lane k modulo lanes, and each lane has lit materials of its own, so that as
    many processes can make batches without shading anything twice.
    conditions: 1 for photos and masks as the world gives them, 0 for clean photos and exact masks.
    world: share of lit materials, and so of photos, of dataset.distributions: what objects are made of, and how
        phones expose and balance them.
    cut_out: share of photos with black behind the object, as in a picture that was cut out before.
    given_normals: share of photos that come with their normals, all turned by GIVEN_NORMALS_ERROR_DEG, as of a
        tracked model.
    surroundings: share of photos of which more is known than the object: the map, as far as the picture shows it
        (dataset.seen_surroundings).
    merged_surroundings: of these, the share of which also what other photos of the object show is known.
    given_material: share of photos that come with their material, a little wrong (GIVEN_MATERIAL_ERROR).
    joined, shape_augment: shares of surfaces before which another is put, and that are given another shape
        (dataset.shape_augment).
    textured, two_materials: shares of photos of objects with a mild texture, and with a second material, of the same
        alpha (dataset.textured); targets know of neither but by the photo's exposure.
    ground: share of lit materials on a ground (dataset.ground_plane); above 0, all photos that come with their
        surroundings come with their context too.
    """

    batch: int = 32
    seed: int = 0
    reuse: int = 12
    group: int = 16
    pool: int = 12
    lanes: int = 2
    conditions: int = 1
    world: float = 0.0
    cut_out: float = 0.0
    given_normals: float = 0.0
    surroundings: float = 0.0
    merged_surroundings: float = 0.0
    given_material: float = 0.0
    joined: float = 0.0
    shape_augment: float = 0.0
    textured: float = 0.0
    two_materials: float = 0.0
    ground: float = 0.0


CONTEXT_SIZE, CONTEXT_SCALE = 96, 3
"""Side of the context, and how many times as wide it is as the crop."""
CONTEXT_SHRINK = 4
"""Pixels of the crop on one of the context's."""
CONTEXT_ALONE = 0.1
"""Share of photos with context of which no other surroundings are given."""
CANDIDATES = 24
"""Surfaces of which the most upright one is put on a ground."""
GIVEN_NORMALS_ERROR_DEG = 2.0
"""Standard deviation of each of the three angles by which given normals are turned."""
GIVEN_MATERIAL_ERROR = np.array([0.0, 0.03, 0.08, 0.08, 0.08, 0.0, 0.0, 0.0], np.float32)
"""Standard deviations of a given material's numbers, in the order of given_material.material_input."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Batch:
    """photo [B, 4, S, S]: display RGB times mask, and mask; irradiance [B, 3, S, S] and ldr [B, 3, H, 2H] through the
    mean curve; ln_radiance [B, 3, H, 2H]; alpha [B]; normals [B, 3, S, S], zero outside the object, and tan_half [B] of
    half the field of view; given_normals_rotation [B, 3, 3]: from these normals to the given ones, a small turn, or
    zero where none are given; surroundings [B, 4, H, 2H]: what else the photo shows, see dataset.seen_surroundings, or
    zero; material [B, 8]: of the object (given_material.material_input; zero where a dataset does not say), and
    given_material [B, 8]: as it is given, or zero; context [B, 5, 96, 96]: the photo CONTEXT_SCALE times as wide as the
    crop, display RGB, mask, and where the photo is, or zero; up [B, 3], unit, in the crop's frame, zero where a dataset
    does not say; stands [B]: whether the object stands on a ground."""

    photo: torch.Tensor
    irradiance: torch.Tensor
    ldr: torch.Tensor
    ln_radiance: torch.Tensor
    alpha: torch.Tensor
    normals: torch.Tensor
    tan_half: torch.Tensor
    given_normals_rotation: torch.Tensor
    surroundings: torch.Tensor
    material: torch.Tensor
    given_material: torch.Tensor
    context: torch.Tensor
    up: torch.Tensor
    stands: torch.Tensor

    def to(self, device: str) -> Batch:
        """The same on another device."""
        return Batch(**{one.name: getattr(self, one.name).to(device) for one in fields(self)})


def slide(kept: dict, wanted: range, make: Callable[[int], Any]) -> list:
    """The things of the wanted numbers, made when not kept yet; the others are forgotten."""
    for number in kept.keys() - set(wanted):
        del kept[number]
    return [kept[number] if number in kept else kept.setdefault(number, make(number)) for number in wanted]


class PairSource:
    """Endless fresh batches; `batch(k)` for consecutive k is fast."""

    def __init__(self, illuminator: Illuminator, surfaces: SurfaceSet, config: PairConfig) -> None:
        self.config, self.illuminator = config, illuminator
        self.surfaces = surfaces
        self.device = illuminator.device
        self._places, self._tone = illuminator.wrap(lookup_coords), illuminator.wrap(response)
        self._groups: dict[int, dict[int, list[LitMaterial]]] = defaultdict(dict)
        self._by_elevation = [np.nonzero(surfaces.elevation == e)[0] for e in range(NUM_ELEVATIONS)]
        self._steps_per_group = max(1, config.group * config.reuse // config.batch)

    def _pool(self, step: int) -> list[LitMaterial]:
        """The lit materials that the step's lane has at hand, the oldest first."""
        turn, lane = divmod(step, self.config.lanes)
        first = turn // self._steps_per_group

        def draw(number: int) -> list[LitMaterial]:
            rng = np.random.default_rng((self.config.seed, 1, lane, number))
            config = self.config
            return [self.illuminator.draw(rng, config.world, config.ground) for _ in range(config.group)]

        return sum(slide(self._groups[lane], range(first, first + self.config.pool), draw), [])

    @torch.no_grad()
    def batch(self, step: int) -> Batch:
        """The pairs of step number `step`."""
        pool = self._pool(step)
        rng = np.random.default_rng((self.config.seed, 2, step))
        chosen = [pool[i] for i in rng.choice(len(pool), self.config.batch, replace=len(pool) < self.config.batch)]
        index = np.array([rng.choice(self._by_elevation[lit.elevation]) for lit in chosen])
        mirror = rng.random(len(index)) < 0.5  # seen in a mirror, a shape is another shape
        on_ground = np.array([lit.stand is not None for lit in chosen])
        for one in np.nonzero(on_ground)[0]:
            index[one] = self._upright(chosen[one], mirror[one], rng)
        drawn = np.asarray(self.surfaces.normals[index])
        shadows = None if self.surfaces.hidden is None else np.array(self.surfaces.hidden[index])
        scenes = self._scenes(chosen, index, mirror, on_ground) if on_ground.any() else None
        for one in np.nonzero(mirror)[0]:
            drawn[one] = drawn[one, :, :, ::-1]
            drawn[one, 0] *= -1
            if shadows is not None:
                shadows[one] = mirrored(shadows[one])
        hidden = None if shadows is None else torch.from_numpy(shadows).to(self.device)
        normals = torch.from_numpy(drawn).to(self.device).float()
        tan_half = self.surfaces.tan_half[index]
        angles = torch.from_numpy(tan_half).to(self.device)
        if self.config.joined > 0:
            index = rng.integers(len(self.surfaces.normals), size=len(index))
            others = torch.from_numpy(np.asarray(self.surfaces.normals[index])).to(self.device).float()
            other_angles = torch.from_numpy(self.surfaces.tan_half[index]).to(self.device)
            alone = normals
            normals = join_some(normals, angles, others, other_angles, rng, self.config.joined)
            normals[on_ground] = alone[on_ground]  # its shadow is cast
            if hidden is not None:  # what the other hides from itself is left out
                changed = (normals != alone).any(dim=1, keepdim=True).float()
                hidden *= F.adaptive_max_pool2d(changed, hidden.shape[-1]) == 0
        if self.config.shape_augment > 0:
            alone, shaded = normals[on_ground], None if hidden is None else hidden[on_ground]
            normals = reshape_some(normals, angles, rng, self.config.shape_augment, hidden)
            normals[on_ground] = alone
            if hidden is not None and shaded is not None:
                hidden[on_ground] = shaded
        return self.compose(chosen, normals, tan_half, rng, hidden, scenes)

    def _upright(self, lit: LitMaterial, mirror: bool, rng: np.random.Generator) -> int:
        """The surface, of some of the lit material's elevation, that stands most upright on its ground."""
        some = rng.choice(self._by_elevation[lit.elevation], CANDIDATES)
        assert self.surfaces.up is not None  # of all surfaces that are put on a ground
        up = self.surfaces.up[some] * np.array([-1.0 if mirror else 1.0, 1.0, 1.0], np.float32)
        return int(some[np.argmax(up @ lit.up)])

    def _scenes(
        self, chosen: list[LitMaterial], index: np.ndarray, mirror: np.ndarray, on_ground: np.ndarray
    ) -> Scenes:
        """Those of chosen that are on_ground, on theirs."""
        index, mirror = index[on_ground], mirror[on_ground]
        flip = np.where(mirror[:, None] & (np.arange(3) == 0), -1.0, 1.0).astype(np.float32)
        assert self.surfaces.points is not None  # as of up
        assert self.surfaces.center is not None
        points = self.surfaces.points[index].astype(np.float32) * flip[:, None]
        center = self.surfaces.center[index] * flip
        stands = [lit.stand for lit in chosen if lit.stand is not None]
        return make_scenes(stands, *(torch.from_numpy(one).to(self.device) for one in (points, center)))

    def compose(
        self,
        chosen: list[LitMaterial],
        normals: torch.Tensor,
        tan_half: np.ndarray,
        rng: np.random.Generator,
        hidden: torch.Tensor | None = None,
        scenes: Scenes | None = None,
    ) -> Batch:
        """Put lit materials on surfaces [B, 3, S, S], give them colours and take the photos.

        hidden: what the surfaces hide from themselves, [B, AZIMUTHS, SIDE, SIDE] of dataset.occlusion.
        scenes: of the lit materials that stand on a ground, in their order.
        """
        count, size = len(chosen), normals.shape[-1]
        materials = [
            draw_material(rng, lit.alpha) if lit.kind is None else distributions.draw_one(rng, lit.kind, lit.alpha)
            for lit in chosen
        ]
        described = np.stack([material_input(one) for one in materials])
        shares = self.config.textured, self.config.two_materials
        if max(shares) > 0:  # by random numbers of its own: all else of a photo stays as it is
            materials = paint_some(materials, normals.cpu().numpy(), rng.spawn(1)[0], *shares)

        def column(values) -> torch.Tensor:
            return column_of(values, self.device)

        mask = (normals.abs().sum(dim=1, keepdim=True) > 0).float()
        wo = pixel_wo(column(tan_half), size)
        radiance, first_factor = shade_batch(chosen, materials, normals, wo, self._places, hidden)

        shots = [draw_shot(rng, self.config.conditions) for _ in range(count)]
        light = torch.stack([lit.radiance for lit in chosen]).permute(0, 3, 1, 2)
        stands = torch.tensor([lit.stand is not None for lit in chosen], device=self.device)
        rays = None
        if self.config.ground > 0:
            rays = -pixel_wo(CONTEXT_SCALE * column(tan_half), CONTEXT_SIZE)
        behind = Behind(light, wo, self.config.cut_out, rng, rays, CONTEXT_SCALE, scenes, stands)
        taken = photograph(
            shots,
            self._lit(chosen, radiance, mask, light),
            rng,
            behind=behind,
            grain=lambda: behind.grain,
            flawed=self.config.conditions > 0,
            tone=partial(self._tone, curve=curves(shots, self.device)),
        )
        shots, framed, wide = taken.shots, behind.framed, behind.wide
        gain = radiance.new_tensor(taken.gain).reshape(-1, 1, 1, 1)
        light = light * gain
        photo_mask = torch.from_numpy(taken.mask[:, None]).to(self.device).float()
        white_balance = column([shot.white_balance for shot in shots])
        light, gain = light * white_balance, gain * white_balance
        given = np.zeros((count, 3, 3), np.float32)
        if self.config.given_normals > 0:
            given = _small_turns(count, rng) * (rng.random(count) < self.config.given_normals)[:, None, None]
        angles = torch.from_numpy(np.asarray(tan_half, np.float32)).to(self.device)
        surroundings_map = light.new_zeros(count, 4, *light.shape[2:])
        context = light.new_zeros(count, 5, CONTEXT_SIZE, CONTEXT_SIZE)
        if self.config.surroundings > 0:
            framed &= rng.random(count) < self.config.surroundings
            frames = np.stack([draw_frame(rng, each) for each in tan_half]) * framed[:, None]
            tone = partial(self._tone, curve=curves(shots, self.device))
            surroundings_map = photo_surroundings(unsteady(light, rng), photo_mask, angles, frames, tone)
            if scenes is not None:
                on = stands.cpu().numpy()
                bright = (gain * 2.0 ** column(rng.normal(0.0, GAIN_STOPS, count)))[stands]  # with white balance
                some = partial(
                    self._tone, curve=curves([shot for shot, one in zip(shots, on, strict=True) if one], self.device)
                )
                surroundings_map[stands] = ground_surroundings(
                    scenes, photo_mask[stands], angles[stands], frames[on], rng, lambda seen: some(seen * bright)
                )
            if wide is not None and rays is not None:
                seen = inside_frame(rays, frames)[:, None].float()
                small = F.avg_pool2d(torch.cat([radiance * gain * mask, mask, photo_mask], dim=1), CONTEXT_SHRINK)
                context = self._context(wide * white_balance, small, seen, tone, shots, rng)
                alone = framed & (rng.random(count) < CONTEXT_ALONE)
                surroundings_map = surroundings_map * column(~alone)
            if self.config.merged_surroundings > 0:
                more = framed & (rng.random(count) < self.config.merged_surroundings)
                surroundings_map = gather(surroundings_map, light, photo_mask, angles, more, rng, tone)
        return Batch(
            photo=torch.cat([taken.photo / 255, photo_mask], dim=1),
            irradiance=self._tone(first_factor * gain, MEAN_CURVE) * mask,
            ldr=self._tone(light, MEAN_CURVE),
            ln_radiance=torch.log(light.clip(min=1e-6)).clip(*LN_RANGE),
            alpha=torch.tensor([lit.alpha for lit in chosen], device=self.device),
            normals=normals,
            tan_half=angles,
            given_normals_rotation=torch.from_numpy(given.astype(np.float32)).to(self.device),
            surroundings=surroundings_map,
            material=torch.from_numpy(described).to(self.device),
            given_material=torch.from_numpy(self._given(described, rng)).to(self.device),
            context=context,
            up=torch.from_numpy(np.stack([np.zeros(3, np.float32) if lit.up is None else lit.up for lit in chosen])).to(
                self.device
            ),
            stands=stands.float(),
        )

    def _context(
        self,
        behind: torch.Tensor,
        small: torch.Tensor,
        inside: torch.Tensor,
        tone: Callable,
        shots: list[Shot],
        rng: np.random.Generator,
    ) -> torch.Tensor:
        """The photo around the crop, see Batch.context.

        Args:
            behind: [B, 3, 96, 96] in the photos' units; small: of the crop at this scale, radiance times mask, mask,
                and the mask as it was found, [B, 5, 32, 32]; inside: [B, 1, 96, 96].
        """
        edge = (CONTEXT_SIZE - small.shape[-1]) // 2
        radiance, mask, found = F.pad(small, (edge,) * 4).split([3, 1, 1], dim=1)
        generator = torch.Generator(device=self.device).manual_seed(int(rng.spawn(1)[0].integers(2**62)))
        grain = torch.randn(behind.shape, generator=generator, device=self.device)
        grain *= column_of([shot.noise / CONTEXT_SHRINK for shot in shots], self.device)
        display = (tone(behind * (1 - mask) + radiance) + grain).clip(0.0, 1.0)
        return torch.cat([(display * 255).round() / 255 * inside, found * inside, inside], dim=1)

    def _given(self, described: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Of materials [B, 8] those that come with their photos, with their errors; the rest zero."""
        if self.config.given_material == 0:
            return np.zeros_like(described)
        rng = rng.spawn(1)[0]  # all else of a photo stays as it is
        wrong = described + rng.standard_normal(described.shape, np.float32) * GIVEN_MATERIAL_ERROR
        wrong[:, 1] = wrong[:, 1].clip(0.1, 1.0)
        return wrong * (rng.random((len(wrong), 1)) < self.config.given_material)

    def _lit(self, chosen: list[LitMaterial], radiance, mask, light) -> LitObjects:
        """radiance [B, 3, S, S] of objects, with mask [B, 1, S, S], under light [B, 3, H, 2H]."""
        weights = radiance.new_tensor(REC709).reshape(1, 3, 1, 1)
        seen = (radiance * weights).sum(1, keepdim=True)
        return LitObjects(
            radiance=radiance,
            mask=mask > 0,
            on_object=((seen * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3)).clip(min=1.0)).tolist(),
            brightness=(light * weights).sum(1),
            maps=lambda number: chosen[number].radiance.cpu().numpy(),
            by_phone=[lit.kind is not None for lit in chosen],
        )


def _small_turns(count: int, rng: np.random.Generator) -> np.ndarray:
    """Rotations [count, 3, 3] about all three axes, GIVEN_NORMALS_ERROR_DEG each."""
    angles = rng.normal(0.0, np.radians(GIVEN_NORMALS_ERROR_DEG), (count, 3))
    return np.stack([rotation_x(x) @ rotation_y(y) @ rotation_z(z) for x, y, z in angles])
