"""From a photo, its object's window and its lens to the square crop around the object, and its frame.

All of it belongs to light.onnx, so that programs in any language only slice and fill; see estimate.light_graph for the
inputs. One photo at a time: N = 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from anyprobe.core.color import REC709
from anyprobe.core.contract import contract
from anyprobe.estimate.light_graph import CROP_MARGIN, INPUTS
from anyprobe_train.light.read_windows import read_window

CROP: int = contract("sizes")["crop"]
SHORTEST: float = contract("graph")["shortest_normal"]
_EXPOSURE = contract("exposure")
FAR = 1e6


@dataclass(frozen=True, kw_only=True, slots=True)
class Given:
    """Inputs of the graph, of one photo; see estimate.light_graph.

    photo [H, W, 5], as it lies in memory. Channels first: window [4, h, w], geometry [6], lens [2], up [3],
    normals [3, n, m], material [8], panorama [4, 64, 128], sun [3], believe [].
    """

    photo: torch.Tensor
    window: torch.Tensor
    geometry: torch.Tensor
    lens: torch.Tensor
    up: torch.Tensor
    normals: torch.Tensor
    material: torch.Tensor
    panorama: torch.Tensor
    sun: torch.Tensor
    believe: torch.Tensor

    @classmethod
    def of(cls, inputs: Sequence[torch.Tensor]) -> Given:
        """Take the graph's inputs in the order of estimate.light_graph.INPUTS."""
        named = {name: one[0] for name, one in zip(INPUTS, inputs, strict=True)}
        first = {name: named[name].permute(2, 0, 1) for name in ("window", "normals", "panorama")}
        return cls(**{**named, **first, "believe": named["believe"][0]})


@dataclass(frozen=True, kw_only=True, slots=True)
class Framed:
    """The square crop around the object.

    crop [4, 128, 128]: RGB times mask, above 1 radiance, and mask. camera_from_crop [3, 3]; tan_half []: of half the
    crop's field of view; center [2] in pixels of the full photo; well_exposed []: share of the object's pixels that are
    neither black nor clipped.
    """

    crop: torch.Tensor
    camera_from_crop: torch.Tensor
    tan_half: torch.Tensor
    center: torch.Tensor
    well_exposed: torch.Tensor


def framed(given: Given) -> Framed:
    """Cut the square around the object; around the whole photo where the mask is empty."""
    width, height, _, x0, y0, step = given.geometry.unbind()
    _, center, side = square_around(given)
    start = ((center[0] - side / 2.0 - x0) / step, (center[1] - side / 2.0 - y0) / step)
    masked = torch.cat([given.window[:3] * given.window[3:], given.window[3:]])
    crop = read_window(masked, start, (side / step, side / step), CROP)
    ray = ray_through(given, center)
    tan_half = side / torch.maximum(width, height) * given.lens[0] * (-ray[2]) ** 1.5
    return Framed(
        crop=crop, camera_from_crop=turn_towards(ray), tan_half=tan_half, center=center, well_exposed=well_exposed(crop)
    )


def square_around(given: Given) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return whether there is an object [], and the centre [2] and side [] of the square around it, of the whole photo
    where there is none, full pixels."""
    width, height, _, x0, y0, step = given.geometry.unbind()
    mask = given.window[3]
    left, right = span(mask.amax(dim=0))
    top, bottom = span(mask.amax(dim=1))
    box = torch.stack([x0 + step * left, y0 + step * top, x0 + step * right, y0 + step * bottom])
    some = (mask.amax() > 0.5).float()
    box = some * box + (1.0 - some) * torch.stack([torch.zeros_like(width), torch.zeros_like(width), width, height])
    return some, (box[:2] + box[2:]) / 2.0, CROP_MARGIN * (box[2:] - box[:2]).amax()


def ray_through(given: Given, at: torch.Tensor) -> torch.Tensor:
    """Return the unit direction through a place of the full photo, camera frame."""
    size = given.geometry[:2]
    focal = size.amax() / 2.0 / given.lens[0]
    ray = torch.stack([(at[0] - size[0] / 2) / focal, -(at[1] - size[1] / 2) / focal, -torch.ones_like(focal)])
    return ray / ray.square().sum().sqrt()


def span(profile: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the first index of a vector's values above one half, and the last one's successor, as floats []."""
    index = torch.cumsum(torch.ones_like(profile), dim=0) - 1.0
    high = profile > 0.5
    first = torch.where(high, index, torch.full_like(index, FAR)).amin()
    return first, torch.where(high, index, torch.full_like(index, -1.0)).amax() + 1.0


def turn_towards(ray: torch.Tensor) -> torch.Tensor:
    """Return the shortest rotation [3, 3] that carries -Z to a unit direction [3] before the camera."""
    a, b, c = ray.unbind()
    zero, one = torch.zeros_like(a), 1.0 - c
    skew = torch.stack([torch.stack([zero, zero, -a]), torch.stack([zero, zero, -b]), torch.stack([a, b, zero])])
    return torch.eye(3) + skew + skew @ skew / one


def well_exposed(crop: torch.Tensor) -> torch.Tensor:
    """Return the share of the object's pixels [] of a crop [4, S, S] that are neither black nor clipped.

    In a nearly black object all pixels up to the level that is warned of count as black.
    """
    doubt = _EXPOSURE["doubt"]
    own = (crop[3] > 0.5).float()
    count = own.sum().clamp(min=1.0)
    shown = torch.einsum("c,chw->hw", torch.tensor(REC709), torch.minimum(crop[:3], crop[3:])) / crop[3].clamp(min=0.5)
    is_dark = ((shown <= doubt["dark"]) * own).sum() / count >= doubt["dark_share"]
    black = torch.where(is_dark, torch.tensor(doubt["dark"]), torch.tensor(_EXPOSURE["black"]))
    return ((shown > black) * (shown < _EXPOSURE["white"]) * own).sum() / count
