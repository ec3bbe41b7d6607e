"""Foregrounds: objects lit by one map, patterned and cut out, for scenes of many objects.

Patterns are drawn once and read many times: procedural ones, and crops of the maps, which are photos of real
surroundings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.render.integrate import shade
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Surface, frame_object, see
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.distributions import draw_alpha, draw_material
from anyprobe_train.dataset.drawn_shapes import draw_shape, figure, part, stretched, transformed
from anyprobe_train.dataset.sky import horizontal_irradiance, tint
from anyprobe_train.dataset.textured import draw_texture, smooth_noise

VIEW_PX = 128
"""Side of a pattern [pixels of its own]."""

REAL_SHARE = 0.5
"""Share of patterns that are crops of maps, if there are maps."""


class TexturePool:
    """Pool of reflectances [3, VIEW_PX, VIEW_PX], mirrored at their borders."""

    def __init__(self, seed: int, count: int, maps: Sequence[np.ndarray | torch.Tensor] = ()) -> None:
        """Draw patterns; maps: [H, 2H, 3] radiance, at their own sharpness where H is 256."""
        rng = np.random.default_rng((seed, 3))
        num_crops = round(REAL_SHARE * count) if len(maps) else 0
        procedural = [
            torch.from_numpy(draw_texture(rng)).permute(2, 0, 1).contiguous() for _ in range(count - num_crops)
        ]
        crops = [_crop(rng, maps[int(rng.integers(len(maps)))]) for _ in range(num_crops)]
        self.patterns = torch.stack(procedural + crops)

    def read(self, rng: np.random.Generator, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """Return a random pattern at coordinates x, y [...] where 2 is one tile: [3, ...]."""
        pattern = self.patterns[int(rng.integers(len(self.patterns)))]
        grid = torch.stack([x, y], dim=-1).reshape(1, 1, -1, 2)
        read = F.grid_sample(pattern[None], grid, padding_mode="reflection", align_corners=False)
        return read.reshape(3, *x.shape)


def _crop(rng: np.random.Generator, radiance: np.ndarray | torch.Tensor) -> torch.Tensor:
    """Crop a piece of a map away from its poles, its brightness compressed to the range of paint."""
    height, width = radiance.shape[:2]
    side = int(rng.integers(height // 4, height // 2 + 1))
    top = int(rng.integers(height * 5 // 32, height * 27 // 32 - side))
    left = int(rng.integers(0, width - side))
    piece = torch.as_tensor(radiance)[top : top + side, left : left + side].permute(2, 0, 1).float()
    piece = piece / (2.0 * piece.flatten().median().clip(min=1e-4))
    piece = F.interpolate(piece[None], size=(VIEW_PX, VIEW_PX), mode="bilinear")[0]
    return (piece / (1 + 0.5 * piece)).clip(0.02, 0.95)


VIEWPOINT_SINES = (-0.1, 0.95)
"""Bounds of the sine of a camera's elevation, even between."""

FOV_DEG = (6.0, 50.0)
"""Bounds of the angle that an object's unit sphere fills; even in its logarithm."""

REAL_SHAPES, STRETCH = 0.5, 0.2
"""Share of real shapes, if there are any; standard deviation of ln of what stretches all along three directions."""

SMALLEST_COVER = 0.04
"""Smallest share of its window that an object covers."""

SAMPLES = 16
"""Directions that the light on a point is summed over."""

FOREGROUNDS = 8
"""Number of objects of one view."""

PATTERNS = {"none": 0.3, "marks": 0.15, "regions": 0.25, "texture": 0.15, "bands": 0.1, "patch": 0.05}
"""Shares of the kinds of an object's colour variation. An object is all of its parts, even if one has a much stronger
colour than the others."""

JOINED_SHARE = 0.25
"""Share of objects of two shapes of different materials, grown together: a pot and its plant, a figure and its base."""

FLASH_SHARE = 0.12
"""Share of views lit by a flash at the camera as well."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LitView:
    """A light seen by one camera, and objects in it.

    Attributes:
        foregrounds: [N, 4, S, S] radiance times cover, and cover; row N's object fills its window.
        sky: [256, 512, 3] the map in its own frame; world_from_camera: [3, 3], mirrored or not.
        elevation: of the camera [radians]; positive looks down.
        ground: [3] radiance of a white matt plane facing up.
        scene_log_mean: exp(mean ln luminance) of the map.
    """

    foregrounds: torch.Tensor
    sky: torch.Tensor
    world_from_camera: np.ndarray
    elevation: float
    ground: np.ndarray
    scene_log_mean: float


class ViewSource:
    """Source of lit views by number: view k is a function of (seed, k) alone."""

    def __init__(
        self, store: AssetStore, textures: TexturePool, seed: int, size: int = 192, real_share: float = REAL_SHAPES
    ) -> None:
        """Draw from the maps and shapes of a store; size: of each object's window."""
        self.store, self.textures, self.seed, self.size, self.real_share = store, textures, seed, size, real_share

    @torch.no_grad()
    def view(self, number: int) -> LitView:
        """Draw a map, a camera, and eight objects."""
        rng = np.random.default_rng((self.seed, 1, number))
        light = list(self.store.maps.values())[int(rng.integers(len(self.store.maps)))]
        elevation = float(np.arcsin(rng.uniform(*VIEWPOINT_SINES)))
        rotation = world_from_camera(rng.uniform(0, 2 * np.pi), elevation, rng.normal(0, 0.05))
        if rng.random() < 0.5:
            rotation = np.diag([-1.0, 1.0, 1.0]) @ rotation
        ground = horizontal_irradiance(light.radiance) / np.pi
        power = float(np.exp(rng.uniform(np.log(0.3), np.log(4.0)))) * float(ground.mean())
        flash = power if rng.random() < FLASH_SHARE else 0.0
        objects = [self._object(rng, light.id, rotation, elevation, flash) for _ in range(FOREGROUNDS)]
        scene = np.maximum(luminance(reduced(light.radiance, MAP_HEIGHT)), 1e-4)
        return LitView(
            foregrounds=torch.stack([_join(rng, item, objects) for item in objects]),
            sky=torch.from_numpy(light.radiance),
            world_from_camera=rotation,
            elevation=elevation,
            ground=ground,
            scene_log_mean=float(np.exp(np.log(scene).mean())),
        )

    def _object(
        self, rng: np.random.Generator, map_id: str, rotation: np.ndarray, elevation: float, flash: float
    ) -> torch.Tensor:
        """Draw an object [4, S, S], see LitView, lit by a map that is seen through rotation [3, 3], and by a flash."""
        surface = self._surface(rng, elevation)
        material = draw_material(rng, draw_alpha(rng))
        turn = rotation.T.astype(np.float32)
        pyramid, u = self.store.pyramid(map_id), hammersley(SAMPLES)
        shading = shade(pyramid, surface.normals @ turn, surface.wo @ turn, float(material.alpha), u)
        matt = flash * rng.uniform(0.05, 0.9, 3) * surface.normals[:, 2:].clip(min=0.0)
        shown = np.zeros((7, self.size, self.size), np.float32)
        shown[:3, surface.mask] = (shading.radiance(material) + matt).T
        shown[3], shown[4:, surface.mask] = surface.mask, surface.normals.T
        item, normals = torch.from_numpy(shown).split([4, 3])
        item[:3] *= draw_pattern(rng, normals, self.textures)
        return item

    def _surface(self, rng: np.random.Generator, elevation: float) -> Surface:
        """Draw a shape and see it from a height [radians]."""
        while True:
            mesh = transformed(self._shape(rng), stretched(STRETCH, rng))
            fov_deg = float(np.exp(rng.uniform(*np.log(FOV_DEG))))
            turned = world_from_camera(rng.uniform(0, 2 * np.pi), elevation)
            surface = see(mesh, frame_object(mesh, turned, fov_deg, rng.uniform(1.04, 1.2), self.size))
            if surface.mask.mean() >= SMALLEST_COVER:
                return surface

    def _shape(self, rng: np.random.Generator) -> Mesh:
        """Draw a real shape, or one of our own."""
        shapes = list(self.store.shapes.values())
        if shapes and rng.random() < self.real_share:
            return shapes[int(rng.integers(len(shapes)))].mesh
        return (draw_shape, figure, part)[rng.integers(3)](rng)


def draw_pattern(rng: np.random.Generator, normals: torch.Tensor, textures: TexturePool) -> torch.Tensor:
    """Draw factors [3, S, S] on an object's radiance, by one of PATTERNS; normals [3, S, S], zero off the object."""
    size = normals.shape[-1]
    kind = str(rng.choice(list(PATTERNS), p=list(PATTERNS.values())))
    if kind == "none":
        return torch.ones(3, size, size)
    line = (torch.arange(size) + 0.5) / size * 2 - 1
    y, x = torch.meshgrid(line, line, indexing="ij")
    x, y = x + 0.4 * normals[0], y - 0.4 * normals[1]  # patterns bend with the surface
    if kind == "texture":
        scale = float(np.exp(rng.uniform(np.log(0.4), np.log(2.5))))
        pattern = textures.read(rng, x * scale, y * scale)
        return pattern / pattern.mean(dim=(1, 2), keepdim=True).clip(min=0.05)
    if kind == "bands":
        angle = rng.choice([0.0, rng.uniform(0, np.pi)])
        along = y * float(np.cos(angle)) + x * float(np.sin(angle))
        edges = np.sort(rng.uniform(-0.9, 0.9, int(rng.integers(1, 5))))
        labels = torch.bucketize(along.contiguous(), torch.from_numpy(edges.astype(np.float32)))
        return _colors(rng, labels, len(edges) + 1)
    if kind == "patch":
        centre, half = rng.uniform(-0.5, 0.5, 2), rng.uniform(0.08, 0.4, 2)
        inside = ((x - float(centre[0])) / half[0]) ** 2 + ((y - float(centre[1])) / half[1]) ** 2 < 1
        return _colors(rng, inside.long(), 2)
    if kind == "regions":
        cells = rng.uniform(0.8, 3.0)
        field = np.stack([smooth_noise(rng, size, cells) for _ in range(int(rng.integers(2, 5)))])
        return _colors(rng, torch.from_numpy(field.argmax(axis=0)), len(field))
    spots = smooth_noise(rng, size, rng.uniform(1.5, 6.0)) > rng.uniform(1.0, 2.0)
    return _colors(rng, torch.from_numpy(spots.astype(np.int64)), 2)


def _colors(rng: np.random.Generator, labels: torch.Tensor, count: int) -> torch.Tensor:
    """Draw factors [3, S, S]: 1 where the label is 0, a colour of its own, sometimes strong, for each other label."""
    table = [np.ones(3)]
    for _ in range(count - 1):
        table.append(np.exp(rng.uniform(np.log(0.08), np.log(2.5))) * tint(rng, rng.choice([0.1, 0.4, 1.0])))
    colors = torch.from_numpy(np.array(table, np.float32))
    return colors[labels].permute(2, 0, 1)


def _join(rng: np.random.Generator, foreground: torch.Tensor, others: list[torch.Tensor]) -> torch.Tensor:
    """Join JOINED_SHARE of the objects with another in front, overlapping, both shrunk into the window."""
    if rng.random() >= JOINED_SHARE:
        return foreground
    other = others[int(rng.integers(len(others)))]
    size = foreground.shape[-1]
    share = float(rng.uniform(0.35, 0.8))
    small = torch.nn.functional.interpolate(other[None], size=round(size * share), mode="bilinear", antialias=True)[0]
    rows = torch.nonzero((foreground[3] > 0.5).any(dim=1)).flatten()
    joined = torch.zeros(4, 2 * size, 2 * size)
    half = size // 2
    joined[:, half : half + size, half : half + size] = foreground
    side = small.shape[-1]
    inside = torch.nonzero(foreground[3] > 0.5)
    y, x = inside[int(rng.integers(len(inside)))].tolist()
    if rng.random() < 0.6:  # standing on it, or under it
        y = int(rows[0 if rng.random() < 0.5 else -1])
    top, left = half + y - side // 2, half + x - side // 2
    window = joined[:, top : top + side, left : left + side]
    joined[:, top : top + side, left : left + side] = window * (1 - small[3:]) + small
    covered = torch.nonzero(joined[3] > 0.5)
    (y0, x0), (y1, x1) = covered.amin(dim=0).tolist(), covered.amax(dim=0).tolist()
    extent = max(y1 - y0, x1 - x0) + 3
    y0 = min(max((y0 + y1 - extent) // 2, 0), 2 * size - extent)
    x0 = min(max((x0 + x1 - extent) // 2, 0), 2 * size - extent)
    cut = joined[None, :, y0 : y0 + extent, x0 : x0 + extent]
    return torch.nn.functional.interpolate(cut, size=(size, size), mode="bilinear", antialias=True)[0]
