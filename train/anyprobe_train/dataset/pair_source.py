"""Training pairs made on the fly: a lit material on a surface, through a camera.

Batch number k is a function of (seed, k) alone, so a run that was killed resumes with exactly the same pairs.
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
from anyprobe.scatter.materials import material_input
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.batch_shading import curves, draw_grain, pixel_wo, see_behind, shade_batch
from anyprobe_train.dataset.camera import column_of, draw_shot, meter, take_photo
from anyprobe_train.dataset.distributions import draw_material
from anyprobe_train.dataset.lighting import Illuminator, LitMaterial
from anyprobe_train.dataset.mask_errors import disturb_mask
from anyprobe_train.dataset.occlusion import mirrored_cells
from anyprobe_train.dataset.pair import LN_RANGE
from anyprobe_train.dataset.reflectance import lookup_coords
from anyprobe_train.dataset.seen_surroundings import draw_frame, gather, perturb, photo_surroundings
from anyprobe_train.dataset.shape_augment import join_some, reshape_some
from anyprobe_train.dataset.surfaces import NUM_ELEVATIONS, SurfaceSet
from anyprobe_train.dataset.textured import paint_some


@dataclass(frozen=True, kw_only=True, slots=True)
class PairConfig:
    """Settings of pairs made on the fly.

    batch: pairs per step; reuse: pairs that each lit material serves; pool: groups of lit materials kept per lane.

    lanes: step k belongs to lane k modulo lanes, and each lane has lit materials of its own, so that as
    many processes can make batches without shading anything twice.
    conditions: 1 for photos and masks with real-world flaws, 0 for clean photos and exact masks.
    world: share of lit materials, and so of photos, drawn from dataset.distributions: real objects' materials, and
        exposure and white balance as phones choose them.
    cut_out: share of photos with black behind the object, as in a picture that was already cut out.
    given_normals: share of photos that come with their normals, all turned by GIVEN_NORMALS_ERROR_DEG, as those of a
        tracked model are.
    surroundings: share of photos whose background is given too: the map as far as the picture shows it
        (dataset.seen_surroundings).
    merged_surroundings: share of those for which the backgrounds of other photos of the object are also given.
    given_material: share of photos that come with their material, slightly wrong (GIVEN_MATERIAL_ERROR).
    joined, shape_augment: shares of surfaces that get another surface in front, and that are deformed
        (dataset.shape_augment).
    textured, two_materials: shares of photos whose object has a mild texture, or a second material of the same alpha
        (dataset.textured); both affect the targets only through the photo's exposure.
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


GIVEN_NORMALS_ERROR_DEG = 2.0
"""Standard deviation of each of the three angles by which given normals are rotated [degrees]."""
GIVEN_MATERIAL_ERROR = np.array([0.0, 0.03, 0.08, 0.08, 0.08, 0.0, 0.0, 0.0], np.float32)
"""Standard deviations of the errors of a given material, in the order of materials.material_input."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Batch:
    """Batch of training pairs, as tensors.

    photo [B, 4, S, S]: display RGB times mask, and mask; irradiance [B, 3, S, S] and ldr [B, 3, H, 2H] through the
    mean curve; ln_radiance [B, 3, H, 2H]; alpha [B]; normals [B, 3, S, S], zero outside the object, and tan_half [B] of
    half the field of view; given_normals_rotation [B, 3, 3]: from these normals to the given ones, a small turn, or
    zero where none are given; surroundings [B, 4, H, 2H]: the background that the photo shows, see
    dataset.seen_surroundings, or zero; material [B, 8]: the object's (materials.material_input);
    given_material [B, 8]: the one that the network is given, or zero.
    """

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

    def to(self, device: str) -> Batch:
        """Move the batch to another device."""
        return Batch(**{one.name: getattr(self, one.name).to(device) for one in fields(self)})


def slide(cache: dict, numbers: range, make: Callable[[int], Any]) -> list:
    """Return the items of the wanted numbers, made unless cached; items of other numbers are dropped."""
    for number in cache.keys() - set(numbers):
        del cache[number]
    return [cache[number] if number in cache else cache.setdefault(number, make(number)) for number in numbers]


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
        """Return the lit materials available to the step's lane, the oldest first."""
        turn, lane = divmod(step, self.config.lanes)
        first = turn // self._steps_per_group

        def draw(number: int) -> list[LitMaterial]:
            rng = np.random.default_rng((self.config.seed, 1, lane, number))
            return [self.illuminator.draw(rng, self.config.world) for _ in range(self.config.group)]

        return sum(slide(self._groups[lane], range(first, first + self.config.pool), draw), [])

    @torch.no_grad()
    def batch(self, step: int) -> Batch:
        """Make the pairs of step number `step`."""
        pool = self._pool(step)
        rng = np.random.default_rng((self.config.seed, 2, step))
        chosen = [pool[i] for i in rng.choice(len(pool), self.config.batch, replace=len(pool) < self.config.batch)]
        index = np.array([rng.choice(self._by_elevation[lit.elevation]) for lit in chosen])
        drawn = np.asarray(self.surfaces.normals[index])
        shadows = None if self.surfaces.hidden is None else np.array(self.surfaces.hidden[index])
        for k in np.nonzero(rng.random(len(index)) < 0.5)[0]:  # seen in a mirror, a shape is another shape
            drawn[k] = drawn[k, :, :, ::-1]
            drawn[k, 0] *= -1
            if shadows is not None:
                shadows[k] = mirrored_cells(shadows[k])
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
            if hidden is not None:  # what the other hides from itself is left out
                changed = (normals != alone).any(dim=1, keepdim=True).float()
                hidden *= F.adaptive_max_pool2d(changed, hidden.shape[-1]) == 0
        if self.config.shape_augment > 0:
            normals = reshape_some(normals, angles, rng, self.config.shape_augment, hidden)
        return self.compose(chosen, normals, tan_half, rng, hidden)

    def compose(
        self,
        chosen: list[LitMaterial],
        normals: torch.Tensor,
        tan_half: np.ndarray,
        rng: np.random.Generator,
        hidden: torch.Tensor | None = None,
    ) -> Batch:
        """Put lit materials on surfaces [B, 3, S, S], draw their colours and take the photos.

        hidden: what the surfaces hide from themselves, [B, AZIMUTHS, SIDE, SIDE] of dataset.occlusion.
        """
        count, size = len(chosen), normals.shape[-1]
        materials = [
            draw_material(rng, lit.alpha) if lit.kind is None else distributions.draw_one(rng, lit.kind, lit.alpha)
            for lit in chosen
        ]
        described = np.stack([material_input(material) for material in materials])
        shares = self.config.textured, self.config.two_materials
        if max(shares) > 0:  # by random numbers of its own: all else of a photo stays as it is
            materials = paint_some(materials, normals.cpu().numpy(), rng.spawn(1)[0], *shares)

        mask = (normals.abs().sum(dim=1, keepdim=True) > 0).float()
        wo = pixel_wo(column_of(tan_half, normals), size)
        radiance, first_factor = shade_batch(chosen, materials, normals, wo, self._places, hidden)

        light = torch.stack([lit.radiance for lit in chosen]).permute(0, 3, 1, 2)
        weights = radiance.new_tensor(REC709).reshape(1, 3, 1, 1)
        seen = (radiance * weights).sum(1, keepdim=True)
        shots, gains = meter(
            [draw_shot(rng, self.config.conditions) for _ in range(count)],
            rng,
            maps=lambda number: chosen[number].radiance.cpu().numpy(),
            brightness=(light * weights).sum(1),
            on_object=((seen * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3)).clip(min=1.0)).tolist(),
            by_phone=[lit.kind is not None for lit in chosen],
        )
        gain = column_of(gains, radiance)
        light, framed = light * gain, np.ones(count, bool)
        background = see_behind(light, wo)
        if self.config.cut_out > 0:
            framed = rng.random(count) >= self.config.cut_out
            background = background * column_of(framed, background)
        grain = draw_grain(rng, background.shape, self.device)
        masks = (mask[:, 0] > 0).cpu().numpy()
        if self.config.conditions > 0:
            masks = np.stack([disturb_mask(one, rng) for one in masks])
        photo_mask = torch.from_numpy(masks[:, None]).to(self.device).float()
        tone = partial(self._tone, curve=curves([shot.curve for shot in shots], radiance))
        photo = take_photo(shots, radiance * gain, mask > 0, background, grain, tone) * photo_mask
        white_balance = column_of([shot.white_balance for shot in shots], light)
        light, gain = light * white_balance, gain * white_balance
        rotations = np.zeros((count, 3, 3), np.float32)
        if self.config.given_normals > 0:
            rotations = _small_turns(count, rng) * (rng.random(count) < self.config.given_normals)[:, None, None]
        angles = torch.from_numpy(np.asarray(tan_half, np.float32)).to(self.device)
        surroundings_map = light.new_zeros(count, 4, *light.shape[2:])
        if self.config.surroundings > 0:
            framed &= rng.random(count) < self.config.surroundings
            frames = np.stack([draw_frame(rng, photo_tan_half) for photo_tan_half in tan_half]) * framed[:, None]
            surroundings_map = photo_surroundings(perturb(light, rng), photo_mask, angles, frames, tone)
            if self.config.merged_surroundings > 0:
                merged = framed & (rng.random(count) < self.config.merged_surroundings)
                surroundings_map = gather(surroundings_map, light, photo_mask, angles, merged, rng, tone)
        return Batch(
            photo=torch.cat([photo / 255, photo_mask], dim=1),
            irradiance=self._tone(first_factor * gain, MEAN_CURVE) * mask,
            ldr=self._tone(light, MEAN_CURVE),
            ln_radiance=torch.log(light.clip(min=1e-6)).clip(*LN_RANGE),
            alpha=torch.tensor([lit.alpha for lit in chosen], device=self.device),
            normals=normals,
            tan_half=angles,
            given_normals_rotation=torch.from_numpy(rotations.astype(np.float32)).to(self.device),
            surroundings=surroundings_map,
            material=torch.from_numpy(described).to(self.device),
            given_material=torch.from_numpy(self._given(described, rng)).to(self.device),
        )

    def _given(self, described: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the materials [B, 8] given with the photos, with errors; zero where none is."""
        if self.config.given_material == 0:
            return np.zeros_like(described)
        rng = rng.spawn(1)[0]  # all else of a photo stays as it is
        noisy = described + rng.standard_normal(described.shape, np.float32) * GIVEN_MATERIAL_ERROR
        noisy[:, 1] = noisy[:, 1].clip(0.1, 1.0)
        return noisy * (rng.random((len(noisy), 1)) < self.config.given_material)


def _small_turns(count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw rotations [count, 3, 3] about all three axes, GIVEN_NORMALS_ERROR_DEG each."""
    angles = rng.normal(0.0, np.radians(GIVEN_NORMALS_ERROR_DEG), (count, 3))
    return np.stack([rotation_x(x) @ rotation_y(y) @ rotation_z(z) for x, y, z in angles])
