"""PaperPairs by their numbers: photo, I-Irradiance image, LDR map and log map, a whole batch at once by look-ups."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from anyprobe.core.response import response
from anyprobe.paper.chain import LN_SCALE
from anyprobe_train.dataset.recipe import VIEWPOINTS as VIEWS
from anyprobe_train.paper.lobes import Rings
from anyprobe_train.paper.materials import MATERIALS
from anyprobe_train.paper.tables import Tables


@dataclass(frozen=True, kw_only=True, slots=True)
class Which:
    """Numbers of map, camera, material and shape of B pairs, [B] each; mirrored: all turned over, left to right."""

    map: np.ndarray
    view: np.ndarray
    material: np.ndarray
    shape: np.ndarray
    mirrored: bool = False

    def part(self, chosen: slice) -> Which:
        """Return some of the pairs."""
        names = ("map", "view", "material", "shape")
        return Which(**{name: getattr(self, name)[chosen] for name in names}, mirrored=self.mirrored)


@dataclass(frozen=True, kw_only=True, slots=True)
class PaperPairs:
    """B pairs, pictures [B, C, H, W] of display values in [0, 1], zero off the object.

    photo: RGB and mask. irradiance: RGB and mask, Eq. 5. mirror [B, 1, S, S]: what a grey mirror of this shape shows.
    ldr: the map. ln_radiance: its natural logarithm. numbers [B, S, S]: of normals, rings' where not mirrored.
    """

    photo: torch.Tensor
    irradiance: torch.Tensor
    mirror: torch.Tensor
    numbers: torch.Tensor
    rings: Rings
    mirrored: bool
    ldr: torch.Tensor
    ln_radiance: torch.Tensor

    @property
    def mask(self) -> torch.Tensor:
        """1 on the object, [B, 1, S, S]."""
        return self.photo[:, 3:]

    @property
    def normals(self) -> torch.Tensor:
        """Unit normals in the camera's frame [B, 3, S, S], zero off the object."""
        found = torch.from_numpy(self.rings.normals()).to(self.numbers.device)[self.numbers]
        turned = (found * found.new_tensor([-1.0, 1.0, 1.0])).flip(2) if self.mirrored else found
        return turned.permute(0, 3, 1, 2)


def drawn(tables: Tables, allowed: np.ndarray, count: int, step: int) -> Which:
    """Draw the pairs of a step: a function of the step alone. allowed: numbers of the maps it may have."""
    rng = np.random.default_rng(step)
    return Which(
        map=allowed[rng.integers(len(allowed), size=count)],
        view=rng.integers(VIEWS, size=count),
        material=rng.integers(len(MATERIALS), size=count),
        shape=rng.integers(len(tables.shapes), size=count),
        mirrored=bool(rng.integers(2)),
    )


def balanced(tables: Tables, count: int, seed: int) -> Which:
    """Draw pairs to score: materials, shapes and maps in turn, so that each comes equally often; cameras at random."""
    rng = np.random.default_rng(seed)

    def turns(number: int) -> np.ndarray:
        return np.concatenate([rng.permutation(number) for _ in range(-(-count // number))])[:count]

    maps, view = turns(len(tables.maps)), rng.integers(VIEWS, size=count)
    shape = turns(len(tables.shapes))
    return Which(map=maps, view=view, material=np.arange(count) % len(MATERIALS), shape=shape)


def pairs_of(tables: Tables, which: Which, frame: str = "sphere") -> PaperPairs:
    """Look the pairs up, on the tables' device; frame: of tables.FRAMES."""
    device = tables.ldr.device
    light, material, view = (
        torch.from_numpy(numbers).to(device)
        for numbers in (which.map * VIEWS + which.view, which.material, which.shape * VIEWS + which.view)
    )
    normals = tables.surface[frame][view].long()  # [B, S * S]
    places = (light * len(MATERIALS) + material)[:, None] * tables.shades.shape[1] + normals
    shades = torch.take(tables.shades, places).view(torch.uint8).unflatten(1, (-1, 8))
    side = round(normals.shape[1] ** 0.5)
    shown = _pictures(shades.unflatten(1, (side, side)), which.mirrored)
    ldr, ln_radiance = (_pictures(maps[light], which.mirrored) for maps in (tables.ldr, tables.ln_radiance))
    mask = shown[:, 3:4]
    return PaperPairs(
        photo=shown[:, :4].contiguous(memory_format=torch.channels_last),
        irradiance=torch.cat([shown[:, 4:7], mask], dim=1),
        mirror=shown[:, 7:],
        numbers=normals.unflatten(1, (side, side)),
        rings=Rings(count=round((tables.shades.shape[1] / 4) ** 0.5)),
        mirrored=which.mirrored,
        ldr=ldr,
        ln_radiance=ln_radiance,
    )


def reexposed(pairs: PaperPairs, factor: torch.Tensor) -> PaperPairs:
    """Photograph the maps anew, with radiance times factor [B]; the object's pictures are not."""
    ln_radiance = (pairs.ln_radiance + factor.log()[:, None, None, None]).clip(*LN_SCALE)
    ldr = (response(ln_radiance.exp()) * 255.0).round() / 255.0
    return replace(pairs, ldr=ldr, ln_radiance=ln_radiance)


def _pictures(stored: torch.Tensor, mirrored: bool) -> torch.Tensor:
    """Convert [B, H, W, C], of bytes display values, to [B, C, H, W] float32 with the channels last in memory."""
    stored = stored.flip(2) if mirrored else stored
    values = stored.float().div_(255.0) if stored.dtype == torch.uint8 else stored.float()
    return values.permute(0, 3, 1, 2)
