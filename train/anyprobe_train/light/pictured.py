"""Batches of the world as the network sees them in training: in mirrors, and with some of what is known left out."""

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.response import response
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.scatter.materials import LEAST_REFLECTANCE, MATERIAL_INPUTS
from anyprobe_train.light.network import LightInputs
from anyprobe_train.light.seen_on_sphere import SeenOnSphere
from anyprobe_train.light.shape import CROP_PX
from anyprobe_train.world.batch import fieldwise

NO_OBJECT, NO_PLACE, PLAIN = 0.08, 0.08, 0.5
"""Shares of photos whose object, or surroundings, are left out, and of the latter those that one colour replaces."""
PANORAMA, GIVEN_UP, GIVEN_NORMALS, GIVEN_MATERIAL, GIVEN_SUN = 0.04, 0.15, 0.08, 0.05, 0.04
"""Shares of photos with a part of a panorama in the place of what they show, and with each thing that may be given."""
SUN_ERROR, UP_ERROR, NORMALS_ERROR = 0.06, 0.02, 0.08
"""Errors of what is given [radians]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightTruth:
    """The truth: radiance [N, 3, 64, 128]; sources [N, 3, 8]; soft, outdoors [N]; up [N, 3]; fov [N] degrees;
    normals [N, 3, 48, 48], zero where hidden; material [N, 4], NaN without an object; family [N]. See the world."""

    radiance: torch.Tensor
    sources: torch.Tensor
    soft: torch.Tensor
    outdoors: torch.Tensor
    up: torch.Tensor
    fov: torch.Tensor
    normals: torch.Tensor
    material: torch.Tensor
    family: torch.Tensor


CUT_OUT = 5
"""Family of photos whose object stands before one colour, which counts as seen like any photo's background."""


def tensors_of(batch: Any, device: str = "cpu") -> tuple[LightInputs, LightTruth]:
    """Return a batch of the world as it is, with nothing given."""

    def picture(values: np.ndarray, scale: float = 1.0) -> torch.Tensor:
        moved = torch.from_numpy(np.ascontiguousarray(values)).to(device).permute(0, 3, 1, 2).float()
        return (moved / scale).contiguous()

    def numbers(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(values)).to(device).float()

    count = len(batch.lens)
    zero = {"up": (3,), "normals": (3, *batch.normals.shape[1:3]), "material": (MATERIAL_INPUTS,), "sun": (3,)}
    given = {name: torch.zeros(count, *shape, device=device) for name, shape in zero.items()}
    context, crop = picture(batch.context, 255.0), picture(batch.crop, 255.0)
    true = {name: numbers(getattr(batch, name)) for name in ("sources", "soft", "outdoors", "up", "fov", "material")}
    family = torch.from_numpy(batch.family.astype(np.int64)).to(device)
    fine = F.interpolate(crop, size=(CROP_PX, CROP_PX), mode="bilinear", align_corners=False)
    lens = numbers(batch.lens)
    seen = _laid_on_sphere(context, lens)
    inputs = LightInputs(context=context, crop=crop, picture=fine, seen=seen, lens=lens, **given)
    truth = LightTruth(radiance=picture(batch.truth), normals=picture(batch.normals, 127.0), family=family, **true)
    return inputs, truth


_on_sphere = functools.cache(lambda device: SeenOnSphere().to(device))


def _laid_on_sphere(context: torch.Tensor, lens: torch.Tensor) -> torch.Tensor:
    return _on_sphere(context.device)(context, lens[:, 0]).clamp(max=1.0)


def seen_again(inputs: LightInputs, some: torch.Tensor) -> LightInputs:
    """Lay what some [N] photos show beside their objects on the sphere anew, after a change of that."""
    seen = inputs.seen.clone()
    seen[some] = _laid_on_sphere(inputs.context[some], inputs.lens[some])
    return replace(inputs, seen=seen)


def mirrored_inputs(inputs: LightInputs) -> LightInputs:
    """Exchange left and right."""
    pictures = {name: getattr(inputs, name).flip(3) for name in ("context", "crop", "picture", "seen")}
    lens = inputs.lens * inputs.lens.new_tensor([1.0, -1.0, 1.0, 1.0, 1.0])
    sides = {name: other_side(getattr(inputs, name)) for name in ("up", "normals", "sun")}
    return replace(inputs, **pictures, lens=lens, **sides)


def mirrored_truth(truth: LightTruth) -> LightTruth:
    """Exchange left and right."""
    signs = truth.sources.new_tensor([1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    sides = {name: other_side(getattr(truth, name)) for name in ("up", "normals")}
    return replace(truth, radiance=truth.radiance.flip(3), sources=truth.sources * signs, **sides)


def other_side(vectors: torch.Tensor) -> torch.Tensor:
    """Exchange left and right of vectors [N, 3], or of pictures of them [N, 3, H, W]."""
    turned = vectors.flip(3) if vectors.dim() == 4 else vectors
    return turned * vectors.new_tensor([-1.0, 1.0, 1.0]).view(-1, *[1] * (vectors.dim() - 2))


def learned(inputs: LightInputs, truth: LightTruth, seed: tuple[int, int]) -> tuple[LightInputs, LightTruth]:
    """Return a batch as a step of training sees it: mirrored, left out and given by chance; a function of the seed."""
    rng = np.random.default_rng((*seed, 29))
    count, device = len(inputs.lens), inputs.lens.device

    def some(share: float) -> torch.Tensor:
        return torch.from_numpy(rng.random(count) < share).to(device)

    def normal(*shape: int) -> torch.Tensor:
        return torch.from_numpy(rng.normal(size=(count, *shape))).float().to(device)

    flipped = some(0.5)

    def either(there: torch.Tensor, here: torch.Tensor) -> torch.Tensor:
        return torch.where(flipped.view(-1, *[1] * (here.dim() - 1)), there, here)

    inputs = fieldwise(either, mirrored_inputs(inputs), inputs)
    truth = fieldwise(either, mirrored_truth(truth), truth)
    inputs = _given(inputs, truth, some, normal)
    gone = some(NO_OBJECT) & (inputs.seen[:, 3].amax(dim=(1, 2)) > 0) & (truth.family != CUT_OUT)
    inputs = without_object(inputs, gone)
    truth = replace(
        truth,
        normals=truth.normals * ~gone[:, None, None, None],
        material=torch.where(gone[:, None], truth.material.new_tensor(torch.nan), truth.material),
    )
    alone = (some(NO_PLACE) | ((truth.family == CUT_OUT) & some(0.5))) & (inputs.crop[:, 3].amax(dim=(1, 2)) > 0)
    color = torch.from_numpy(rng.choice([0.0, 1.0, 0.5], (count, 1)) + 0.1 * rng.random((count, 3))).float()
    inputs = without_place(inputs, alone, color.clip(0, 1).to(device), some(PLAIN))
    inputs = seen_again(inputs, gone | alone)
    return _with_panorama(inputs, truth, some(PANORAMA), rng), truth


def without_object(inputs: LightInputs, some: torch.Tensor) -> LightInputs:
    """Leave out the object of some [N] photos: it is seen as a part of the place, and nobody says where it is."""
    keep = (~some).float()[:, None, None, None]
    context, lens = inputs.context.clone(), inputs.lens.clone()
    context[:, 3:4] *= keep
    lens[:, 1:4] *= keep[:, :, 0, 0]
    crop, picture, normals = (one * keep for one in (inputs.crop, inputs.picture, inputs.normals))
    own = {"crop": crop, "picture": picture, "normals": normals, "material": inputs.material * keep[:, :, 0, 0]}
    return replace(inputs, context=context, lens=lens, **own)


def without_place(inputs: LightInputs, some: torch.Tensor, color: torch.Tensor, plain: torch.Tensor) -> LightInputs:
    """Leave out what is beside the object of some [N] photos: transparent there, or of one colour [N, 3] if plain [N].

    One colour is seen all the same: the network is to know that it is not the place. See `seen_again`.
    """
    gone = some[:, None, None, None].float()
    shown = plain[:, None, None, None].float()
    mask, cover = inputs.context[:, 3:4], inputs.context[:, 4:]
    behind = color[:, :, None, None] * (cover - mask).clamp(min=0.0) * shown
    alone = torch.cat([inputs.context[:, :3] * mask + behind, mask, shown * cover + (1 - shown) * mask], dim=1)
    return replace(inputs, context=gone * alone + (1 - gone) * inputs.context)


def _given(inputs: LightInputs, truth: LightTruth, some: Any, normal: Any) -> LightInputs:
    """Give what may be given, with errors."""

    def rows(chosen: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        return torch.nan_to_num(values) * chosen.view(-1, *[1] * (values.dim() - 1)).float()

    known = (truth.normals.square().sum(dim=1, keepdim=True) > 0.25).float()
    off = NORMALS_ERROR * normal(3)[:, :, None, None]
    reflectance = torch.log(truth.material[:, 1:].clamp(min=LEAST_REFLECTANCE))
    is_metal = truth.material[:, :1]
    f0 = is_metal * truth.material[:, 1:] + (1 - is_metal) * 0.04
    material = torch.cat([torch.ones_like(is_metal), torch.full_like(is_metal, 0.6), reflectance, f0], dim=1)
    shines = truth.sources[:, :1, 0] > 0.5
    anywhere = normal(3)
    anywhere = anywhere * torch.sign((anywhere * truth.up).sum(dim=1, keepdim=True))  # behind clouds or a house
    sun = F.normalize(torch.where(shines, truth.sources[:, 0, 1:4] + SUN_ERROR * normal(3), anywhere), dim=1)
    has_object = (inputs.crop[:, 3].amax(dim=(1, 2)) > 0) & ~torch.isnan(truth.material[:, 0])
    return replace(
        inputs,
        up=rows(some(GIVEN_UP), F.normalize(truth.up + UP_ERROR * normal(3), dim=1)),
        normals=rows(some(GIVEN_NORMALS), F.normalize(truth.normals + off, dim=1) * known),
        material=rows(some(GIVEN_MATERIAL) & has_object, material),
        sun=rows(some(GIVEN_SUN) & (truth.outdoors > 0.5), sun),
    )


def _with_panorama(inputs: LightInputs, truth: LightTruth, some: torch.Tensor, rng: np.random.Generator) -> LightInputs:
    """Show a part of the map, as from a panorama, in the place of what some photos show of it."""
    columns = 2 * MAP_HEIGHT
    turn, width = int(rng.integers(columns)), int(rng.integers(columns // 4, columns))
    low, high = (int(MAP_HEIGHT * share) for share in (rng.uniform(0, 0.5), rng.uniform(0.5, 1)))
    cover = truth.radiance.new_zeros(1, 1, MAP_HEIGHT, columns)
    cover[:, :, low:high, :width] = 1.0
    cover = cover.roll(turn, dims=3).expand(len(some), -1, -1, -1)
    shown = response(truth.radiance.clamp(max=1.0))
    panorama = torch.cat([shown * cover, cover], dim=1)
    return replace(inputs, seen=torch.where(some[:, None, None, None], panorama, inputs.seen))
