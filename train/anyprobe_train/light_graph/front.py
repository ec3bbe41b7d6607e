"""From a photo, its object's window and its lens to what networks see: crop, context, seen surroundings, and frames.

All of it belongs to light.onnx, so that programs in any language only slice and fill; see estimate.light_graph for the
inputs. One photo at a time: N = 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.light_graph import CROP_MARGIN, INPUTS
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.light_graph.sampling import inside, on_plane, read_at, read_map, read_window, shrink

CROP, NORMALS = (contract("sizes")[name] for name in ("crop", "normals"))
CONTEXT, CONTEXT_SCALE = 96, 2
"""Side of the context [px], and how many times as wide as the crop it is."""
GROW = 4
"""Rim around the object that shows no surroundings [px of the crop]."""
FINE = 2.0
"""Samples of the photo for a pixel of the map, along either side."""
THINNEST = 1e-3
SHORTEST: float = contract("graph")["shortest_normal"]
_EXPOSURE = contract("exposure")
FAR = 1e6


@dataclass(frozen=True, kw_only=True, slots=True)
class Given:
    """Inputs of the graph, of one photo, channels first; see estimate.light_graph.

    photo [5, H, W], window [4, h, w], geometry [6], lens [2], up [3], normals [3, n, m], material [8],
    panorama [4, 64, 128], sun [3], believe [].
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
        values = [one[0].permute(2, 0, 1) if one.dim() == 4 else one[0] for one in inputs]
        return cls(**{name: value for name, value in zip(INPUTS[:-1], values[:-1], strict=True)}, believe=values[-1][0])


@dataclass(frozen=True, kw_only=True, slots=True)
class Framed:
    """The square crop around the object.

    crop [4, 128, 128]: RGB times mask, above 1 radiance, and mask. camera_from_crop [3, 3]; tan_half []: of half the
    crop's field of view; center [2] and side []: in pixels of the full photo; well_exposed []: share of the object's
    pixels that are neither black nor clipped.
    """

    crop: torch.Tensor
    camera_from_crop: torch.Tensor
    tan_half: torch.Tensor
    center: torch.Tensor
    side: torch.Tensor
    well_exposed: torch.Tensor

    @property
    def display(self) -> torch.Tensor:
        """Return the crop as a display shows it."""
        mask = self.crop[3:]
        return torch.cat([torch.minimum(self.crop[:3], mask), mask])


class Front(nn.Module):
    """Cuts and projects what is given."""

    directions: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("directions", torch.from_numpy(pixel_directions(MAP_HEIGHT)).float(), persistent=False)

    def framed(self, given: Given) -> Framed:
        """Cut the square around the object; around the whole photo where the mask is empty."""
        width, height, _, x0, y0, step = given.geometry.unbind()
        mask = given.window[3]
        left, right = span(mask.amax(dim=0))
        top, bottom = span(mask.amax(dim=1))
        some = (mask.amax() > 0.5).float()
        box = torch.stack([x0 + step * left, y0 + step * top, x0 + step * right, y0 + step * bottom])
        whole = torch.stack([torch.zeros_like(width), torch.zeros_like(width), width, height])
        box = some * box + (1.0 - some) * whole
        center = (box[:2] + box[2:]) / 2.0
        side = CROP_MARGIN * (box[2:] - box[:2]).amax()
        start = ((center[0] - side / 2.0 - x0) / step, (center[1] - side / 2.0 - y0) / step)
        masked = torch.cat([given.window[:3] * mask, mask[None]])
        crop = read_window(masked, start, (side / step, side / step), CROP)
        ray = self._ray(given, center)
        longest = torch.maximum(width, height)
        tan_half = side / longest * given.lens[0] * (-ray[2]) ** 1.5
        return Framed(
            crop=crop,
            camera_from_crop=turn_towards(ray),
            tan_half=tan_half,
            center=center,
            side=side,
            well_exposed=well_exposed(crop),
        )

    def _ray(self, given: Given, at: torch.Tensor) -> torch.Tensor:
        """Return the unit direction through a place of the full photo, camera frame."""
        focal = focal_px(given)
        size = given.geometry[:2]
        ray = torch.stack([(at[0] - size[0] / 2) / focal, -(at[1] - size[1] / 2) / focal, -torch.ones_like(focal)])
        return ray / ray.square().sum().sqrt()

    def normals(self, given: Given, framed: Framed) -> torch.Tensor:
        """Return the given normals [3, 64, 64] over the crop and in its frame, unit or zero."""
        _, _, _, x0, y0, step = given.geometry.unbind()
        reach = step * torch.ones_like(given.window[3, 0]).sum(), step * torch.ones_like(given.window[3, :, 0]).sum()
        scale = (
            torch.ones_like(given.normals[0, 0]).sum() / reach[0],
            torch.ones_like(given.normals[0, :, 0]).sum() / reach[1],
        )
        first = framed.center - framed.side / 2.0
        start = ((first[0] - x0) * scale[0], (first[1] - y0) * scale[1])
        mean = read_window(given.normals, start, (framed.side * scale[0], framed.side * scale[1]), NORMALS)
        length = mean.square().sum(dim=0, keepdim=True).sqrt()
        turned = torch.einsum("ck,chw->khw", framed.camera_from_crop, mean / length.clamp(min=SHORTEST))
        return turned * (length > SHORTEST).float()

    def context(self, given: Given, framed: Framed) -> torch.Tensor:
        """Return the photo [5, 96, 96] CONTEXT_SCALE times as wide as the crop: display RGB, mask, cover."""
        k, side = given.geometry[2], CONTEXT_SCALE * framed.side
        first = (framed.center - side / 2.0) / k
        rgb, cover, mask = given.photo[:3].clamp(max=1.0), given.photo[3:4], given.photo[4:]
        seen = read_window(torch.cat([rgb * cover, mask, cover]), (first[0], first[1]), (side / k, side / k), CONTEXT)
        return seen.clamp(0.0, 1.0)

    def seen(self, given: Given, framed: Framed, camera_from_map: torch.Tensor) -> torch.Tensor:
        """Return what the photo shows beside the object of a map in any frame, [5, 64, 128]: RGB times cover, a value
        above 1 radiance; cover; and the share of it that is measured above white, too."""
        size = given.geometry[:2] / given.geometry[2]
        focal = focal_px(given) / given.geometry[2]
        d = self.directions @ camera_from_map.T
        x, y, front = on_plane(d)
        column, row = size[0] / 2 + focal * x, size[1] / 2 - focal * y
        opaque = given.photo[3:4]
        cell = (focal * math.pi / (FINE * MAP_HEIGHT)).clamp(min=1.0)
        small = shrink(torch.cat([given.photo[:3] * opaque, opaque]), size[0], size[1], cell)
        share = read_at(small, column / cell, row / cell)
        hidden = self._hidden(framed, d)
        cover = front * inside(column, row, size[0], size[1]) * (1.0 - hidden) * share[3]
        shown = share[:3] / share[3:].clamp(min=THINNEST)
        measured = (given.photo[:3].amax() > 1.0).float()
        return torch.cat([shown * cover, cover[None], measured * cover[None]])

    def _hidden(self, framed: Framed, d: torch.Tensor) -> torch.Tensor:
        """Return how much of each direction of the camera's frame the object hides, its edge counted to it."""
        grown = F.max_pool2d(framed.crop[None, 3:], 2 * GROW + 1, 1, GROW)[0]
        x, y, front = on_plane(d @ framed.camera_from_crop)
        column, row = CROP / 2 * (1.0 + x / framed.tan_half), CROP / 2 * (1.0 - y / framed.tan_half)
        size = torch.full_like(framed.tan_half, float(CROP))
        return read_at(grown, column, row)[0] * front * inside(column, row, size, size)

    def panorama(self, given: Given, camera_from_map: torch.Tensor) -> torch.Tensor:
        """Return the given panorama in a map's frame, as seen has it."""
        measured = (given.panorama[:3].amax() > 1.0).float()
        found = torch.cat([given.panorama, measured * given.panorama[3:]])
        return read_map(found, self.directions @ camera_from_map.T).clamp(min=0.0)


def focal_px(given: Given) -> torch.Tensor:
    """Return the focal length [] in pixels of the full photo."""
    return given.geometry[:2].amax() / 2.0 / given.lens[0]


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


def over(upper: torch.Tensor, lower: torch.Tensor) -> torch.Tensor:
    """Composite surroundings [5, H, 2H]: the upper ones where they cover, else the lower."""
    return upper + (1.0 - upper[3:4]) * lower
