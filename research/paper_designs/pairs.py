"""Photos, their true intermediate images and their light, a whole batch at once by look-ups."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from research.paper_designs.blocks import pixels_of
from research.paper_designs.scale import MATERIALS, VIEWS
from research.paper_designs.tables import Tables


@dataclass(frozen=True, kw_only=True, slots=True)
class Batch:
    """B pairs, P pixels of photos and Q of maps in the order of `blocks`.

    Values are display values in [0, 1] unless said otherwise; images are zero off the object.

    photo [B, P, 4]: RGB and mask. irradiance [B, P, 3]: Eq. 5. normals [B, P, 3]: unit, camera frame.
    mirror [B, P, 1]: what a grey mirror of this shape shows. sphere [B, P, 3]: what a mirror sphere shows.
    ldr [B, Q, 3]: the map. ln_radiance [B, Q, 3]. light [B]: which map from which camera.
    """

    photo: torch.Tensor
    irradiance: torch.Tensor
    normals: torch.Tensor
    mirror: torch.Tensor
    sphere: torch.Tensor
    ldr: torch.Tensor
    ln_radiance: torch.Tensor
    light: torch.Tensor


@dataclass(frozen=True, kw_only=True, slots=True)
class Which:
    """Numbers of map, camera, material and shape of B pairs, [B] each."""

    map: torch.Tensor
    view: torch.Tensor
    material: torch.Tensor
    shape: torch.Tensor


def which(number: torch.Tensor, shapes: int) -> Which:
    """Of pairs by their number, 0 to Tables.count - 1."""
    number, shape = number // shapes, number % shapes
    number, material = number // len(MATERIALS), number % len(MATERIALS)
    return Which(map=number // VIEWS, view=number % VIEWS, material=material, shape=shape)


class PairMaker:
    """Pictures of pairs of some tables, on the tables' device; no loop over pairs. dtype: of the pictures."""

    def __init__(self, tables: Tables, dtype: torch.dtype = torch.float32) -> None:
        self._tables, self._dtype = tables, dtype
        side = round(tables.surface.shape[1] ** 0.5)
        self._surface = pixels_of(tables.surface.reshape(-1, 1, side, side))[..., 0].contiguous()
        self._normals = tables.normals.to(dtype)
        self._maps = {name: pixels_of(getattr(tables, name)).contiguous() for name in ("ldr", "ln_radiance", "sphere")}

    def __call__(self, chosen: Which) -> Batch:
        tables = self._tables
        light = chosen.map * VIEWS + chosen.view
        pixels = self._surface[chosen.shape * VIEWS + chosen.view].int()
        rows = (light * len(MATERIALS) + chosen.material)[:, None]
        shades = tables.shades.reshape(-1)[rows * tables.shades.shape[1] + pixels]
        shown = self._display(shades.view(torch.uint8).unflatten(1, (-1, 8)))
        mask = (pixels != len(tables.normals) - 1).to(self._dtype)[..., None]
        return Batch(
            photo=torch.cat([shown[..., :3], mask], dim=2),
            irradiance=shown[..., 3:6],
            mirror=shown[..., 6:7],
            normals=self._normals[pixels],
            sphere=self._display(self._maps["sphere"][light]),
            ldr=self._display(self._maps["ldr"][light]),
            ln_radiance=self._maps["ln_radiance"][light].to(self._dtype),
            light=light,
        )

    def _display(self, steps: torch.Tensor) -> torch.Tensor:
        return steps.to(self._dtype).mul_(1.0 / 255.0)


class Order:
    """Every pair once an epoch, shuffled anew each; which pairs a step sees depends on the seed and the step alone."""

    def __init__(self, tables: Tables, batch: int, seed: int) -> None:
        self._tables, self._batch, self._seed = tables, batch, seed
        self._epoch, self._shuffled = -1, torch.empty(0)

    def chosen(self, step: int) -> Which:
        """The pairs of a step; a step at an epoch's end may take from two."""
        places = torch.arange(step * self._batch, (step + 1) * self._batch)
        numbers = torch.empty_like(places)
        for epoch in torch.unique(places // self._tables.count).tolist():
            here = places // self._tables.count == epoch
            numbers[here] = self._numbers(epoch)[places[here] % self._tables.count].long()
        return which(numbers.to(self._tables.ldr.device), len(self._tables.shape_names))

    def _numbers(self, epoch: int) -> torch.Tensor:
        if epoch != self._epoch:
            generator = torch.Generator().manual_seed(1000 * self._seed + epoch)
            self._shuffled = torch.randperm(self._tables.count, generator=generator, dtype=torch.int32)
            self._epoch = epoch
        return self._shuffled


def balanced(tables: Tables, count: int, seed: int) -> Which:
    """Pairs to judge by: materials, shapes and maps in turn, so that each comes equally often; cameras at random."""
    generator = torch.Generator().manual_seed(seed)
    place = torch.arange(count)

    def turns(number: int) -> torch.Tensor:
        rounds = -(-count // number)
        return torch.cat([torch.randperm(number, generator=generator) for _ in range(rounds)])[:count]

    drawn = {
        "map": turns(len(tables.map_names)),
        "view": torch.randint(VIEWS, (count,), generator=generator),
        "material": place % len(MATERIALS),
        "shape": turns(len(tables.shape_names)),
    }
    return Which(**{name: numbers.to(tables.ldr.device) for name, numbers in drawn.items()})
