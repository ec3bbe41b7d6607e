"""Points of a surface with normals -> the light around it: level, colour and pattern apart.

Level is settled in closed form as far as it goes: what the photo shows, divided by what the material reflects, is the
anchor that all else is relative to. Without a given material the divisor is an ordinary grey, and the network adds
what it expects beside, with its uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response
from anyprobe.learning.nets.emitter_head import POWER_FLOOR
from anyprobe.learning.nets.lifting import lift_to_map, map_pixel, mirror_direction, pyramid
from anyprobe.render.surface import pixel_rays
from research.harmonics import real_basis

SIZE = 32
"""Side of the pictures of the surface."""
FINE, COARSE, SOFT = 32, 16, 8
"""Rows of lifted pixels, of what the network works on, and of its gates."""
ORDER = 8
"""Highest order of the pattern that is made from all points together; finer detail is lifted, where it is seen."""
GREY = 0.3
"""Reflectance of an object of which nothing is known."""
DARK = 0.004
"""Added to radiance before its logarithm: half a step of 8 bits near black."""
WIDTHS = np.sqrt(np.array([0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0]))
CODE = 39
"""Numbers that are known of the whole photo."""
SCALARS = {"level": 3, "bias": 3, "above": 3, "power": 1, "chroma": 2, "spread": 3, "material": 8, "material_spread": 1}
"""Numbers of the last layer that are of the whole map. spread: ln standard deviations of above, power and chroma."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SecondGuess:
    """What SecondStage estimates, maps with 32 rows.

    ln_shown [N, 3, 32, 64]: radiance up to white. ln_above [N, 3]: ln(total power above white + POWER_FLOOR), sr of
    white. emitter_logit, confidence_logit [N, 1, 32, 64]. ln_power [N, 1]: ln of the mean luminance of the sphere;
    chroma [N, 2]: ln R/G and ln B/G of its total power. ln_spread [N, 3]: ln standard deviations of ln_above, ln power
    and chroma. material [N, 8]: logit of being a metal, f0, albedo, root alpha; material_ln_spread [N, 1] of f0 and
    albedo.
    """

    ln_shown: torch.Tensor
    ln_above: torch.Tensor
    emitter_logit: torch.Tensor
    confidence_logit: torch.Tensor
    ln_power: torch.Tensor
    chroma: torch.Tensor
    ln_spread: torch.Tensor
    material: torch.Tensor
    material_ln_spread: torch.Tensor


class SecondStage(nn.Module):
    """See forward.

    width: of the hidden layers; blocks: how many of them.
    """

    def __init__(self, width: int = 512, blocks: int = 2) -> None:
        super().__init__()
        unit = torch.from_numpy(pixel_rays(1.0, SIZE)).permute(2, 0, 1)
        self.register_buffer("slope", (unit[:2] / unit[2:])[None], persistent=False)
        basis = real_basis(pixel_directions(COARSE).reshape(-1, 3).astype(np.float64), ORDER)[:, 1:]
        angles = np.repeat(pixel_solid_angles(COARSE)[:, 0], 2 * COARSE)[:, None]
        orders = np.concatenate([np.full(2 * n + 1, n - 1) for n in range(1, ORDER + 1)])
        self.register_buffer("basis", torch.from_numpy(basis.T.astype(np.float32).copy()), persistent=False)
        project = torch.from_numpy((basis * angles).astype(np.float32))
        self.register_buffer("project", project, persistent=False)
        self.register_buffer("orders", torch.from_numpy(orders), persistent=False)
        self.register_buffer("widths", torch.from_numpy(WIDTHS.astype(np.float32)), persistent=False)
        pixels, gates = 2 * COARSE**2, 2 * SOFT**2
        self.sizes = {"pattern": 3 * len(orders), "orders": 2 * ORDER, "gates": 5 * gates, "emitters": pixels}
        self.sizes |= {"confidence": gates, **SCALARS}
        self.code = nn.Linear(CODE, 64)
        self.first = nn.Linear(9 * pixels + 5 * gates + 64, width)
        self.scale = nn.ModuleList(nn.Linear(64, 2 * width) for _ in range(blocks + 1))
        self.blocks = nn.ModuleList(nn.Linear(width, width) for _ in range(blocks))
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(blocks + 1))
        self.last = nn.Linear(width, sum(self.sizes.values()))
        nn.init.normal_(self.last.weight, std=0.01)
        nn.init.zeros_(self.last.bias)

    def forward(
        self,
        photo: torch.Tensor,
        weight: torch.Tensor,
        normals: torch.Tensor,
        given: torch.Tensor,
        tan_half: torch.Tensor,
        root_alpha: torch.Tensor,
        material: torch.Tensor,
        surroundings: torch.Tensor,
    ) -> SecondGuess:
        """All as reflectance_pairs.ReflectanceBatch has them."""
        weight = weight * (weight > 0.5)
        whole = weight.sum(dim=(2, 3)).clip(min=1e-3)
        known = material[:, :1]
        f0, albedo = material[:, 1:4], material[:, 4:7]
        fresnel = f0 + (1 - f0) / 21.0
        reflected = torch.log((fresnel + (1 - fresnel) * albedo).clip(min=0.02))
        reflected = torch.lerp(torch.full_like(reflected, float(np.log(GREY))), reflected, known)
        ln = torch.log(inverse_response(photo) + DARK) - reflected[:, :, None, None]
        anchor = (ln * weight).sum(dim=(2, 3)) / whole  # [N, 3]
        clipped = ((photo.amax(dim=1, keepdim=True) - 0.9) * 12).clip(0.0, 1.0)
        rest = ln - anchor[:, :, None, None]
        slope = self.slope * tan_half[:, :, None, None]
        wo = torch.cat([slope, torch.ones_like(slope[:, :1])], dim=1)
        wo = wo * torch.rsqrt(slope[:, :1] ** 2 + slope[:, 1:] ** 2 + 1)
        values = torch.cat([rest, clipped], dim=1)
        mirrored = pyramid(lift_to_map(values, weight, map_pixel(mirror_direction(normals, wo), FINE), FINE), 5)
        faced = pyramid(lift_to_map(values, weight, map_pixel(normals, SOFT), SOFT), 3)
        facing = faced[0]
        surroundings_ln = self._relative(F.avg_pool2d(surroundings, int(surroundings.shape[2]) // COARSE), anchor)
        spread = ((rest.mean(dim=1, keepdim=True) ** 2 * weight).sum(dim=(2, 3)) / whole).sqrt()
        numbers = [material, given, tan_half, anchor - anchor.mean(dim=1, keepdim=True), root_alpha]
        numbers += [anchor.mean(dim=1, keepdim=True), (anchor + reflected), whole / SIZE**2, spread]
        numbers += [(clipped * weight).sum(dim=(2, 3)) / whole, root_alpha**2]
        numbers += [torch.exp(-(((root_alpha - self.widths) / 0.12) ** 2)), surroundings_ln[:, 3:].mean(dim=(2, 3))]
        numbers += [(rest * weight).flatten(2).amax(dim=2), (rest * weight).flatten(2).amin(dim=2)]
        numbers += [(rest * normals[:, 1:2] * weight).sum(dim=(2, 3)) / whole]
        code = F.gelu(self.code(torch.cat(numbers, dim=1)))
        seen = [_shares(mirrored[1]), _shares(facing), surroundings_ln.flatten(1)]
        x = self._scaled(self.norms[0](self.first(torch.cat([*seen, code], dim=1))), code, 0)
        for number, block in enumerate(self.blocks, start=1):
            x = x + self._scaled(self.norms[number](block(x)), code, number)
        out = dict(zip(self.sizes, self.last(x).float().split(list(self.sizes.values()), dim=1), strict=True))
        smooth = torch.stack([filled(mirrored[1:]), grown(filled(faced), COARSE // SOFT)], dim=1)
        return self._assembled(out, anchor, mirrored[:2], smooth.flatten(3) @ self.project)

    def _relative(self, surroundings: torch.Tensor, anchor: torch.Tensor) -> torch.Tensor:
        cover = surroundings[:, 3:]
        display = surroundings[:, :3] / cover.clip(min=1e-3)
        ln = torch.log(inverse_response(display) + DARK) - anchor[:, :, None, None]
        return torch.cat([ln * cover, cover], dim=1)

    def _scaled(self, x: torch.Tensor, code: torch.Tensor, number: int) -> torch.Tensor:
        gain, offset = self.scale[number](code).chunk(2, dim=1)
        return F.gelu(x * (1 + gain) + offset)

    def _assembled(
        self, out: dict[str, torch.Tensor], anchor: torch.Tensor, mirrored: list[torch.Tensor], smooth: torch.Tensor
    ) -> SecondGuess:
        """smooth: [N, 2, 3, 80] harmonics of what is seen in mirror directions, and of what faces each direction."""
        fine, coarse = mirrored
        gates = torch.sigmoid(grown(out["gates"].unflatten(1, (5, SOFT, 2 * SOFT)), 2) - 2.0)
        level = (out["level"] * 2)[:, :, None, None]
        bias = (out["bias"] + out["level"] * 2)[:, :, None, None]
        shares = (out["orders"] * 4).unflatten(1, (2, ORDER))[:, :, self.orders]  # one an order: turns with the light
        pattern = out["pattern"].unflatten(1, (3, -1)) + (smooth * shares[:, :, None]).sum(dim=1)
        pattern = (pattern @ self.basis).unflatten(2, (COARSE, 2 * COARSE))
        shown = level + pattern
        shown = shown + gates[:, :1] * coarse[:, 4:] * (coarse[:, :3] + bias - shown)
        upper, shown = grown(gates, 2), grown(shown, 2)
        shown = shown + upper[:, 1:2] * fine[:, 4:] * (fine[:, :3] + bias - shown)
        logit = grown(out["emitters"].unflatten(1, (1, COARSE, 2 * COARSE)) * 4, 2)
        bright = fine[:, :3].mean(dim=1, keepdim=True)
        logit = logit + fine[:, 4:] * (4 * upper[:, 2:3] * bright + 8 * upper[:, 3:4] * fine[:, 3:4])
        confidence = grown(out["confidence"].unflatten(1, (1, SOFT, 2 * SOFT)), 4) + 2 * upper[:, 4:] * fine[:, 4:]
        middle = anchor.mean(dim=1, keepdim=True)
        return SecondGuess(
            ln_shown=shown + anchor[:, :, None, None],
            ln_above=torch.log(torch.exp((out["above"] * 2 + middle).clip(max=9.0)) + POWER_FLOOR),
            emitter_logit=logit,
            confidence_logit=confidence,
            ln_power=out["power"] * 2 + middle,
            chroma=out["chroma"] + (anchor[:, ::2] - anchor[:, 1:2]),
            ln_spread=out["spread"].clip(-4.0, 3.0),
            material=out["material"],
            material_ln_spread=out["material_spread"].clip(-4.0, 2.0),
        )


def filled(scales: list[torch.Tensor]) -> torch.Tensor:
    """The first three channels of a pyramid's finest map [N, 3, H, 2H], gaps filled from coarser ones; else zero."""
    result = torch.zeros_like(scales[-1][:, :3])
    for number, scale in enumerate(reversed(scales)):
        result = result if number == 0 else grown(result, 2)
        result = result + scale[:, -1:] * (scale[:, :3] - result)
    return result


def _shares(lifted: torch.Tensor) -> torch.Tensor:
    """Means times their coverage, so that what is not seen is zero, [N, C H W]."""
    return torch.cat([lifted[:, :-1] * lifted[:, -1:], lifted[:, -1:]], dim=1).flatten(1)


def grown(x: torch.Tensor, times: int) -> torch.Tensor:
    """A map with so many times the rows, linear between pixels, across the seam."""
    x = torch.cat([x[..., -1:], x, x[..., :1]], dim=3)
    x = F.interpolate(x, scale_factor=times, mode="bilinear", align_corners=False)
    return x[..., times:-times]
