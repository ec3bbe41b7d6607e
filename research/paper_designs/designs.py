"""Every design and rival, trained side by side on the same batches.

    image        photo -> irradiance image (Eq. 5), the first network of the chain
    direct       photo -> map
    irradiance   estimated irradiance image -> map
    ours         the same with targets that sharpen (Eq. 6)
    ideal        true irradiance image -> map, targets that sharpen
    normals      true irradiance image and true normals -> map, targets that sharpen: a ceiling
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
from research.paper_designs.blocks import pixels_of
from research.paper_designs.gradual import epoch_of, filtered
from research.paper_designs.nets import HdrNet, IrradianceNet, MirrorNet, PictureNet
from research.paper_designs.pairs import Batch
from research.paper_designs.scale import Scale
from research.paper_designs.tables import Tables


@dataclass(frozen=True, kw_only=True, slots=True)
class Design:
    """What an illumination network sees, of the names in inputs_of, and whether its targets sharpen."""

    sees: str
    gradual: bool = False


DESIGNS = {
    "direct": Design(sees="photo"),
    "irradiance": Design(sees="estimate"),
    "ours": Design(sees="estimate", gradual=True),
    "ideal": Design(sees="truth", gradual=True),
    "normals": Design(sees="truth and normals", gradual=True),
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
        def seeded(maker, *args) -> nn.Module:
            torch.manual_seed(seed)
            return maker(*args)

        side, rows, size = scale.side, scale.rows, (scale.width, scale.code)
        with torch.random.fork_rng(devices=[]):
            nets = {
                name: seeded(PictureNet, 7 if "normals" in design.sees else 4, side, 2 * rows**2, *size)
                for name, design in DESIGNS.items()
            }
            nets["image"] = seeded(IrradianceNet, side, *size)
            nets["georgoulis"] = seeded(PictureNet, 4, side, side**2, *size)
            nets["meka"] = seeded(MirrorNet, side, *size)
            nets["hdr"] = seeded(HdrNet, rows, *size)
        super().__init__(nets)


def inputs_of(batch: Batch, estimate: torch.Tensor) -> dict[str, torch.Tensor]:
    """What illumination networks may see, by name. estimate: of the irradiance image."""
    mask = batch.photo[..., 3:]
    truth = torch.cat([batch.irradiance, mask], dim=2)
    return {
        "photo": batch.photo,
        "estimate": torch.cat([estimate.clip(0, 1), mask], dim=2),
        "truth": truth,
        "truth and normals": torch.cat([truth, batch.normals], dim=2),
    }


@dataclass(frozen=True, kw_only=True, slots=True)
class SquaredError:
    """A network's loss: the mean over all numbers of weight (output - target)^2."""

    output: torch.Tensor
    target: torch.Tensor
    weight: torch.Tensor | None = None

    def gradient(self) -> torch.Tensor:
        """Of the loss by the output."""
        error = (self.output.detach() - self.target).mul_(2.0 / self.output.numel())
        return error if self.weight is None else error.mul_(self.weight)

    def value(self) -> float:
        """The loss."""
        error = (self.output.detach().float() - self.target.float()).square()
        return float((error if self.weight is None else error * self.weight.float()).mean())


class Losses:
    """The loss of every network of a Designs (Sect. 3.2 to 3.4); keeps the maps as the present epoch shows them."""

    def __init__(self, nets: Designs, tables: Tables) -> None:
        self._nets, self._ldr = nets, tables.ldr
        self._epoch, self._soft = 0, torch.empty(0)

    def __call__(self, batch: Batch, progress: float) -> dict[str, SquaredError]:
        """progress: share of the run's steps that are done, [0, 1)."""
        nets = self._nets
        estimate = nets["image"](batch.photo)
        per_object = 1.0 / batch.photo[..., 3:].mean(dim=1, keepdim=True).clip(min=LEAST_COVER)
        losses = {"image": SquaredError(output=estimate, target=batch.irradiance, weight=per_object)}
        seen = inputs_of(batch, estimate.detach())
        soft = self._targets(progress)[batch.light].to(batch.ldr.dtype)
        for name, design in DESIGNS.items():
            target = soft if design.gradual else batch.ldr
            losses[name] = SquaredError(output=nets[name](seen[design.sees]), target=target)
        losses["georgoulis"] = SquaredError(output=nets["georgoulis"](batch.photo), target=batch.sphere)
        mirror = nets["meka"](torch.cat([batch.photo, batch.normals], dim=2))
        losses["meka"] = SquaredError(output=mirror, target=batch.mirror, weight=per_object)
        losses["hdr"] = self._hdr({name: losses[name].output.detach().clip(0, 1) for name in HDR_SOURCES}, batch)
        return losses

    def _targets(self, progress: float) -> torch.Tensor:
        epoch = epoch_of(progress)
        if epoch != self._epoch:
            self._epoch, self._soft = epoch, pixels_of(filtered(self._ldr, epoch)).contiguous()
        return self._soft

    def _hdr(self, maps: dict[str, torch.Tensor], batch: Batch) -> SquaredError:
        """ln radiance, half from true maps and half from estimated ones, mostly where Eq. 7 will read it."""
        count = max(len(batch.ldr) // HDR_SHARE, 4)
        turns = [batch.ldr] * len(maps) + list(maps.values())
        ldr = torch.stack([turns[k % len(turns)][k] for k in range(count)])
        gamma = blend_weight(torch.maximum(ldr, batch.ldr[:count]).float()).to(ldr.dtype)
        return SquaredError(output=self._nets["hdr"](ldr), target=batch.ln_radiance[:count], weight=0.1 + gamma)
