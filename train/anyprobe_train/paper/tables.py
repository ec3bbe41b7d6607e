"""All light and all shapes of a split, shaded once, so that a pair is two look-ups.

Light: every map from every camera, and what each normal shows of it in each material. Shapes: which normal each pixel
has, from every camera. Object and map turn together, as in the paper, which renders from fixed cameras.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import reduced, rotate
from anyprobe.paper.chain import LN_SCALE
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera, frame_object, see
from anyprobe_train.dataset.catalog import MapAsset, ShapeAsset
from anyprobe_train.dataset.pair import fibonacci_viewpoint
from anyprobe_train.dataset.recipe import VIEWPOINTS as VIEWS
from anyprobe_train.paper.lobes import Rings, light_places, light_waves, lobes, shown
from anyprobe_train.paper.materials import MATERIALS
from anyprobe_train.paper.settings import Setting

SCENE_KEY = 0.12
"""Geometric mean luminance of a map at an exposure of 1."""
EXPOSURES = (0.5, 2.0)
"""Range of exposures (Sect. 3.5)."""
FAR_DEG = 0.5
"""Field of view of the camera, which is far away."""
COVER = 2
"""Pixels along either side of a photo's pixel that normals are averaged over."""
CHUNK = 4
"""Maps that are shaded in one go."""
FRAMES = ("sphere", "box")
"""Framings, by what fills the picture: the shape's bounding sphere, as in the paper, or its box as in estimates."""

_LEVELS = torch.from_numpy(np.round(response(np.arange(65536, dtype=np.float32) / 65535) * 255).astype(np.uint8))


@dataclass(frozen=True, kw_only=True, slots=True)
class Tables:
    """One split. L lights (map by map, camera by camera), G views of shapes (shape by shape, camera by camera),
    N normals, M materials.

    shades [L * M, N + 1] int64: eight bytes each, display RGB of the photo, 255 for the mask, display RGB of the
        I-Irradiance image, and the mirror's grey; all zero for N, the background.
    ldr [L, rows, 2 rows, 3] uint8: display values of the map in the camera's frame.
    ln_radiance [L, rows, 2 rows, 3] float16, in LN_SCALE.
    surface: by name of FRAMES, [G, side * side] int16, the number of each pixel's normal.
    exposure [maps] float32. measured [maps] bool: neither procedural nor lifted from eight bits.
    maps, shapes: names in the order of the numbers.
    """

    shades: torch.Tensor
    ldr: torch.Tensor
    ln_radiance: torch.Tensor
    surface: dict[str, torch.Tensor]
    exposure: torch.Tensor
    measured: torch.Tensor
    maps: tuple[str, ...]
    shapes: tuple[str, ...]

    def to(self, device: str) -> Tables:
        """Return the same on another device."""
        if device == "cpu":
            return self
        moved = {name: getattr(self, name).to(device) for name in ("shades", "ldr", "ln_radiance", "exposure")}
        surface = {name: pixels.to(device) for name, pixels in self.surface.items()}
        return replace(self, **moved, surface=surface)

    def mean_map(self) -> torch.Tensor:
        """Average all maps, [rows, 2 rows, 3] in [0, 1]."""
        total = sum(part.double().sum(dim=0) for part in self.ldr.split(256))
        return (total / (255.0 * len(self.ldr))).float()


def build_tables(
    folder: Path, setting: Setting, maps: Sequence[MapAsset], shapes: Sequence[ShapeAsset], frames: Sequence[str]
) -> None:
    """Shade everything into files of a folder. The exposure of a map is drawn from its id."""
    rings = Rings(count=setting.rings)
    folder.mkdir(parents=True, exist_ok=True)
    count, shape = len(maps) * VIEWS, (setting.rows, 2 * setting.rows, 3)
    shades = _file(folder, "shades", np.uint8, (count, len(MATERIALS), rings.number + 1, 8))
    ldr, ln_radiance = _file(folder, "ldr", np.uint8, (count, *shape)), _file(folder, "ln", np.float16, (count, *shape))
    turns = [world_from_camera(*fibonacci_viewpoint(view)) for view in range(VIEWS)]
    uvs = [light_places(turn, rings) for turn in turns]
    spectra = [lobes(material, rings) for material in MATERIALS]
    exposures = [exposure_of(asset.id) for asset in maps]
    for first in range(0, len(maps), CHUNK):
        waves, greys, rows = [], [], slice(first * VIEWS, min(first + CHUNK, len(maps)) * VIEWS)
        for number in range(first, min(first + CHUNK, len(maps))):
            radiance = exposed(maps[number].radiance, exposures[number])
            fine, light = (reduced(radiance, min(n, len(radiance))) for n in (2 * setting.rows, setting.light_rows))
            for view, (turn, uv) in enumerate(zip(turns, uvs, strict=True)):
                seen, wave = light_waves(light, uv)
                waves.append(wave)
                greys.append(mirror_greys(seen))
                label = reduced(rotate(fine, turn.T), setting.rows)
                place = number * VIEWS + view
                ldr[place] = np.round(response(label) * 255.0)
                ln_radiance[place] = np.log(np.maximum(label, 1e-6)).clip(*LN_SCALE)
        stacked = torch.stack(waves)
        grey = display_levels(torch.from_numpy(np.stack(greys))).numpy()
        for k, spectrum in enumerate(spectra):
            display = display_levels(shown(stacked, spectrum, rings)).permute(0, 2, 1).numpy()
            shades[rows, k, :-1, :3], shades[rows, k, :-1, 4:7] = display[..., :3], display[..., 3:]
            shades[rows, k, :-1, 3], shades[rows, k, :-1, 7] = 255, grey
    for frame in frames:
        surface = _file(folder, frame, np.int16, (len(shapes) * VIEWS, setting.side**2))
        for k, asset in enumerate(shapes):
            for view, turn in enumerate(turns):
                surface[k * VIEWS + view] = surface_of(asset.mesh, turn, frame, rings, setting.side)
    about = {
        "maps": [asset.name for asset in maps],
        "shapes": [asset.name for asset in shapes],
        "exposure": exposures,
        "measured": [asset.licence != "own" and not asset.lifted for asset in maps],
    }
    with atomic_path(folder / "about.json") as path:  # last: a folder that has it is whole
        path.write_text(json.dumps(about, indent=1), encoding="utf-8")


def _file(folder: Path, name: str, kind: type, shape: tuple[int, ...]) -> np.ndarray:
    return np.lib.format.open_memmap(folder / f"{name}.npy", mode="w+", dtype=kind, shape=shape)


def read_tables(folder: Path) -> Tables:
    """Read what build_tables wrote; processes share it by the page cache."""
    about = json.loads((folder / "about.json").read_text(encoding="utf-8"))

    def stored(name: str) -> torch.Tensor:
        return torch.from_numpy(np.load(folder / f"{name}.npy", mmap_mode="c"))

    return Tables(
        shades=stored("shades").view(torch.int64)[..., 0].flatten(0, 1),
        ldr=stored("ldr"),
        ln_radiance=stored("ln"),
        surface={name: stored(name) for name in FRAMES if (folder / f"{name}.npy").is_file()},
        exposure=torch.tensor(about["exposure"]),
        measured=torch.tensor(about["measured"]),
        maps=tuple(about["maps"]),
        shapes=tuple(about["shapes"]),
    )


def exposure_of(map_id: str) -> float:
    """Draw the one exposure that all photos under a map share, evenly in stops over EXPOSURES."""
    low, high = np.log(EXPOSURES)
    return float(np.exp(np.random.default_rng(int(map_id, 16)).uniform(low, high)))


def exposed(radiance: np.ndarray, exposure: float) -> np.ndarray:
    """Scale a map [H, 2H, 3] so that its geometric mean luminance is SCENE_KEY times the exposure."""
    brightness = luminance(radiance)
    ln = np.log(np.maximum(brightness, 1e-4 * brightness.mean()))
    mean = np.exp((ln * pixel_solid_angles(len(radiance))).sum() / (4 * np.pi))
    return (radiance * (SCENE_KEY * exposure / mean)).astype(np.float32)


def display_levels(radiance: torch.Tensor) -> torch.Tensor:
    """Convert radiance in exposure units to display values in steps of 1/255, uint8."""
    return _LEVELS[(radiance.clip(0.0, 1.0) * 65535.0).to(torch.int32)]


def mirror_greys(light: np.ndarray) -> np.ndarray:
    """Return what a grey mirror shows at each normal [N] of light [2 rings, around, 3]: at twice the angle, between two
    rings."""
    return ((luminance(light[0::2]) + luminance(light[1::2])) / 2).reshape(-1).astype(np.float32)


def surface_of(mesh: Mesh, turn: np.ndarray, frame: str, rings: Rings, side: int) -> np.ndarray:
    """Return the number of the nearest normal at each pixel [side * side] int16; rings.number off the object."""
    if frame == "box":
        camera = frame_object(mesh, turn, FAR_DEG, size=side * COVER)
    else:
        half = np.radians(FAR_DEG) / 2
        position = turn @ np.array([0.0, 0.0, 1.0 / np.sin(half)])
        camera = Camera(world_from_camera=turn, position=position, tan_half=float(np.tan(half)), size=side * COVER)
    surface = see(mesh, camera)
    seen = np.zeros((side * COVER, side * COVER, 4), np.float32)
    seen[surface.mask, :3], seen[surface.mask, 3] = surface.normals, 1.0
    mean = seen.reshape(side, COVER, side, COVER, 4).mean(axis=(1, 3)).reshape(-1, 4)
    return np.where(mean[:, 3] >= 0.5, rings.nearest(mean[:, :3]), rings.number).astype(np.int16)
