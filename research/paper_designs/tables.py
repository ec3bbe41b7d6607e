"""All light and all shapes of a split, shaded once, so that a pair is two look-ups.

Light: every map from every camera, and what each normal shows of it in each material. Shapes: which normal each pixel
has, from every camera. Object and map turn together, as in the paper, which renders from fixed cameras.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from anyprobe.core.color import luminance
from anyprobe.core.frames import reflect, world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.files.meshes import MESH_SUFFIXES, read_mesh
from anyprobe.files.paths import visible_files
from anyprobe.light.environment import rotate, shrink
from anyprobe.maps.radiance import read_radiance
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import frame_object, see
from anyprobe_train.dataset.catalog import MAP_SUFFIXES
from research.paper_designs.scale import MATERIALS, VIEWS, Scale
from research.paper_designs.transport import TO_EYE, hemisphere, transport, viewpoint

SCENE_KEY = 0.12
"""What the one camera makes of a map's mean luminance (of its logarithm): a sixth of all irradiance clips."""
FAR_DEG = 0.5
"""Field of view of the camera, which is far away."""
COVER = 4
"""Pixels along either side of a photo's pixel that normals are averaged over."""
LN_RANGE = (-7.0, 9.0)
BLOCK = 1024
"""Lights, and normals, that are shaded in one go."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Tables:
    """One split. L lights (map by map, camera by camera), G views of shapes (shape by shape, camera by
    camera), N normals, M materials.

    shades [L * M, N + 1] int64: eight bytes each, display RGB of the photo, of the irradiance image (Eq. 5), the
        mirror's grey, and one that is unused; all zero for N, the background.
    ldr [L, 3, rows, 2 rows] uint8: display values of the map in the camera's frame.
    ln_radiance [L, 3, rows, 2 rows] float16.
    sphere [L, 3, side, side] uint8: a mirror sphere under that map.
    surface [G, side * side] int16: the number of each pixel's normal; N is background.
    normals [N + 1, 3]: the last is zero.
    map_names, shape_names: in the order of the numbers.
    """

    shades: torch.Tensor
    ldr: torch.Tensor
    ln_radiance: torch.Tensor
    sphere: torch.Tensor
    surface: torch.Tensor
    normals: torch.Tensor
    map_names: tuple[str, ...]
    shape_names: tuple[str, ...]

    @property
    def count(self) -> int:
        """Pairs: maps x shapes x materials x cameras."""
        return len(self.ldr) * len(self.shape_names) * len(MATERIALS)

    def to(self, device: str) -> Tables:
        """The same on another device."""
        values = {name: getattr(self, name) for name in Tables.__slots__}
        return Tables(**{name: x.to(device) if torch.is_tensor(x) else x for name, x in values.items()})


def build_tables(scale: Scale, maps: dict[str, np.ndarray], shapes: dict[str, Mesh], device: str = "cpu") -> Tables:
    """Shade everything, on the device; the tables are on the CPU. maps: [H, 2H, 3] each, any scale of radiance."""
    normals = hemisphere(scale.normals)
    light = np.concatenate([views_of(radiance, scale.light_rows) for radiance in maps.values()])
    small = np.stack([shrink(one, scale.rows) for one in light])
    sphere = sphere_places(scale.side)
    surface = np.concatenate([surfaces_of(mesh, normals, scale.side) for mesh in shapes.values()])
    channels = torch.from_numpy(light).to(device).permute(3, 1, 2, 0).flatten(1, 2).contiguous()  # [3, Q, L]
    shades = torch.zeros((len(light), len(MATERIALS), scale.normals + 1, 8), dtype=torch.uint8)
    mirror = np.stack([bilinear(luminance(one)[..., None], mirror_places(normals))[..., 0] for one in light])
    shades[:, :, :-1, 6] = display(torch.from_numpy(mirror))[:, None]
    for number, material in enumerate(MATERIALS):
        for low in range(0, scale.normals, BLOCK):
            some = slice(low, min(low + BLOCK, scale.normals))
            matrices = transport(normals[some], material, scale.light_rows)
            radiance, irradiance = (torch.from_numpy(matrix).to(device) for matrix in matrices)
            for part in (slice(first, first + BLOCK) for first in range(0, len(light), BLOCK)):
                for c in range(3):
                    shades[part, number, some, c] = display(radiance[c] @ channels[c, :, part]).T.cpu()
                    shades[part, number, some, 3 + c] = display(irradiance @ channels[c, :, part]).T.cpu()
    ln_radiance = np.log(small.clip(1e-6)).clip(*LN_RANGE).astype(np.float16)
    spheres = np.stack([bilinear(one, sphere) for one in light])
    return Tables(
        shades=shades.view(torch.int64)[..., 0].flatten(0, 1),
        ldr=_channels_first(display(torch.from_numpy(small))),
        ln_radiance=_channels_first(torch.from_numpy(ln_radiance)),
        sphere=_channels_first(display(torch.from_numpy(spheres))),
        surface=torch.from_numpy(surface),
        normals=torch.from_numpy(np.concatenate([normals, np.zeros((1, 3), np.float32)])),
        map_names=tuple(maps),
        shape_names=tuple(shapes),
    )


def _channels_first(pictures: torch.Tensor) -> torch.Tensor:
    return pictures.permute(0, 3, 1, 2).contiguous()


def display(radiance: torch.Tensor) -> torch.Tensor:
    """Radiance in exposure units to display values in steps of 1/255, uint8."""
    return (response(radiance) * 255.0).round().to(torch.uint8)


def views_of(radiance: np.ndarray, rows: int) -> np.ndarray:
    """A map in the frame of every camera and in exposure units, [VIEWS, rows, 2 rows, 3] float32."""
    fine = shrink(radiance, min(2 * rows, len(radiance)))
    brightness = luminance(fine)
    brightness = np.log(np.maximum(brightness, 1e-4 * brightness.mean()))
    gain = SCENE_KEY / np.exp((brightness * pixel_solid_angles(len(fine))).sum() / (4 * np.pi))
    turns = [world_from_camera(*viewpoint(view, VIEWS)).T for view in range(VIEWS)]
    return np.stack([shrink(rotate(fine, turn), rows) * gain for turn in turns]).astype(np.float32)


def mirror_places(normals: np.ndarray) -> np.ndarray:
    """Where mirrors of these normals [..., 3] see the map: uv [..., 2]."""
    return direction_to_uv(reflect(np.broadcast_to(TO_EYE, normals.shape), normals))


def sphere_places(side: int) -> np.ndarray:
    """Where the pixels of a mirror sphere see the map [side, side, 2].

    Its normals turn evenly along the radius, to 90 degrees at the rim; the corners show what the rim shows.
    """
    x = (np.arange(side) + 0.5) / side * 2 - 1
    right, up = np.meshgrid(x, -x)
    radius = np.hypot(right, up)
    theta = np.minimum(radius, 1.0) * np.pi / 2
    scale = np.sin(theta) / np.maximum(radius, 1e-9)
    return mirror_places(np.stack([right * scale, up * scale, np.cos(theta)], axis=-1))


def surfaces_of(mesh: Mesh, normals: np.ndarray, side: int) -> np.ndarray:
    """From every camera, the nearest of the normals [N, 3] at each pixel: [VIEWS, side * side] int16, N off the
    object."""
    found = []
    for view in range(VIEWS):
        camera = frame_object(mesh, world_from_camera(*viewpoint(view, VIEWS)), FAR_DEG, size=side * COVER)
        surface = see(mesh, camera)
        seen = np.zeros((side * COVER, side * COVER, 4), np.float32)
        seen[surface.mask] = np.concatenate([surface.normals, np.ones((len(surface.normals), 1), np.float32)], axis=1)
        mean = seen.reshape(side, COVER, side, COVER, 4).mean(axis=(1, 3)).reshape(-1, 4)
        nearest = (mean[:, :3] @ normals.T).argmax(axis=1)
        found.append(np.where(mean[:, 3] >= 0.5, nearest, len(normals)).astype(np.int16))
    return np.stack(found)


def load_maps(folder: Path, mirrored: bool, limit: int | None = None) -> dict[str, np.ndarray]:
    """Every map of a folder by name, each also mirrored left to right if asked for."""
    found = {}
    for path in sorted(visible_files(folder, MAP_SUFFIXES))[:limit]:
        found[path.stem] = read_radiance(path)
        if mirrored:
            found[f"{path.stem}, mirrored"] = np.ascontiguousarray(found[path.stem][:, ::-1])
    return found


def load_shapes(folder: Path, limit: int | None = None) -> dict[str, Mesh]:
    """Every mesh of a folder by name."""
    return {path.stem: read_mesh(path) for path in sorted(visible_files(folder, MESH_SUFFIXES))[:limit]}


def cached_tables(path: Path, make) -> Tables:
    """Tables from a file, made and written first if there is none; shared between processes by the page cache."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        tables = make()
        partial = path.with_suffix(".part")
        torch.save({name: getattr(tables, name) for name in Tables.__slots__}, partial)
        partial.replace(path)
    return Tables(**torch.load(path, weights_only=True, mmap=True))
