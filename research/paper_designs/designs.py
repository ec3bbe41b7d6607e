"""Designs (noun): every design and rival, trained side by side on the same batches.

    image        photo -> irradiance image (Eq. 5), the first network of the chain
    direct       photo -> map
    irradiance   estimated irradiance image -> map
    ours         the same with targets that sharpen (Eq. 6)
    ideal        true irradiance image -> map, targets that sharpen
    ideal_sharp  the same with the maps themselves as targets
    normals      true irradiance image and true normals -> map: a ceiling
    georgoulis   photo -> mirror sphere, unwrapped to a map
    meka         photo and true normals -> grey mirror image, unwrapped by the normals
    hdr          map -> ln radiance, one for all designs

No design's loss reaches another's network. Networks of one shape have the same first weights within a seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn

from anyprobe.light.reconstruct import blend_weight
from anyprobe.nets.blocks import autocast
from research.paper_designs.gradual import epoch_of, filtered
from research.paper_designs.nets import HdrNet, IrradianceNet, MirrorNet, PictureNet
from research.paper_designs.pairs import Batch
from research.paper_designs.scale import Scale
from research.paper_designs.tables import Tables


@dataclass(frozen=True, kw_only=True, slots=True)
class Design:
    """What an illumination network sees, of the names in Learner._inputs, and whether its targets sharpen."""

    sees: str
    gradual: bool = False


DESIGNS = {
    "direct": Design(sees="photo"),
    "irradiance": Design(sees="estimate"),
    "ours": Design(sees="estimate", gradual=True),
    "ideal": Design(sees="truth", gradual=True),
    "ideal_sharp": Design(sees="truth"),
    "normals": Design(sees="truth and normals"),
}
HDR_SOURCES = ("direct", "irradiance", "ours")
"""Whose maps the HDR network learns from, beside true ones."""
HDR_SHARE = 8
"""It sees one in so many pairs."""
LEAST_COVER = 0.02
"""Smaller objects count as if they covered so much of the photo."""


class Designs(nn.ModuleDict):
    """All networks of one seed."""

    def __init__(self, scale: Scale, seed: int) -> None:
        def map_net(inputs: int = 4) -> nn.Module:
            torch.manual_seed(seed)
            size, start = (scale.rows, 2 * scale.rows), (4, 8)
            return PictureNet(inputs, scale.side, size, start, scale.width, scale.code)

        def seeded(maker, *args) -> nn.Module:
            torch.manual_seed(seed)
            return maker(*args)

        square = (scale.side, scale.side), (scale.side >> (scale.side // 3).bit_length() - 1,) * 2
        with torch.random.fork_rng(devices=[]):
            nets = {name: map_net(7 if "normals" in design.sees else 4) for name, design in DESIGNS.items()}
            nets["image"] = seeded(IrradianceNet, scale.side, scale.width)
            nets["georgoulis"] = seeded(PictureNet, 4, scale.side, *square, scale.width, scale.code)
            nets["meka"] = seeded(MirrorNet, scale.side, scale.width)
            nets["hdr"] = seeded(HdrNet, scale.width)
        super().__init__(nets)

    def run(self, name: str, picture: torch.Tensor) -> torch.Tensor:
        """One network in bfloat16 arithmetic, its result in float32."""
        with autocast(picture.device):
            return self[name](picture.contiguous(memory_format=torch.channels_last)).float()

    def irradiance_image(self, batch: Batch) -> torch.Tensor:
        """The estimated irradiance image [B, 3, S, S]."""
        return self.run("image", batch.photo)


def inputs_of(batch: Batch, estimate: torch.Tensor) -> dict[str, torch.Tensor]:
    """What illumination networks may see, by name. estimate: of the irradiance image."""
    mask = batch.photo[:, 3:]
    return {
        "photo": batch.photo,
        "estimate": torch.cat([estimate.clip(0, 1), mask], dim=1),
        "truth": torch.cat([batch.irradiance, mask], dim=1),
        "truth and normals": torch.cat([batch.irradiance, mask, batch.normals], dim=1),
    }


class Losses:
    """Mean squared errors of every network of a Designs; keeps the maps as the present epoch shows them."""

    def __init__(self, nets: Designs, tables: Tables) -> None:
        self._nets, self._ldr = nets, tables.ldr
        self._epoch, self._soft = 0, tables.ldr

    def __call__(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """progress: share of the run's steps that are done, [0, 1)."""
        nets = self._nets
        estimate = nets.irradiance_image(batch)
        losses = {"image": _per_object(estimate - batch.irradiance, batch.photo[:, 3:])}
        seen = inputs_of(batch, estimate.detach())
        soft = self._targets(progress)[batch.light].float()
        maps = {name: nets.run(name, seen[design.sees]) for name, design in DESIGNS.items()}
        for name, design in DESIGNS.items():
            losses[name] = (maps[name] - (soft if design.gradual else batch.ldr)).square().mean()
        losses["georgoulis"] = (nets.run("georgoulis", batch.photo) - batch.sphere).square().mean()
        mirror = nets.run("meka", torch.cat([batch.photo, batch.normals], dim=1))
        losses["meka"] = _per_object(mirror - batch.mirror, batch.photo[:, 3:])
        losses["hdr"] = self._hdr({name: maps[name].detach() for name in HDR_SOURCES}, batch)
        return losses

    def _targets(self, progress: float) -> torch.Tensor:
        epoch = epoch_of(progress)
        if epoch != self._epoch:
            self._epoch, self._soft = epoch, filtered(self._ldr, epoch)
        return self._soft

    def _hdr(self, maps: dict[str, torch.Tensor], batch: Batch) -> torch.Tensor:
        """ln radiance, half from true maps and half from estimated ones, mostly where Eq. 7 will read it."""
        count = max(len(batch.ldr) // HDR_SHARE, 4)
        turns = [batch.ldr] * len(maps) + list(maps.values())
        ldr = torch.stack([turns[k % len(turns)][k] for k in range(count)])
        gamma = blend_weight(torch.maximum(ldr, batch.ldr[:count]).permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        error = self._nets.run("hdr", ldr) - batch.ln_radiance[:count]
        return ((0.1 + gamma) * error.square()).mean()


def _per_object(error: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Mean square over the object's pixels of error [B, C, S, S], so that small objects count as much as large."""
    cover = mask.mean(dim=(1, 2, 3)).clip(min=LEAST_COVER)
    return ((error * mask).square().mean(dim=(1, 2, 3)) / cover).mean()
