"""Initial weights of the paper's irradiance and illumination nets from the same layers of `lift`."""

from __future__ import annotations

from collections.abc import Mapping

import torch

LAYERS = {
    "irradiance.unet.": "light.object.",
    "irradiance.head.": "light.object.head.",
    "illumination.normals.": "light.normals.",
    "illumination.places.": "light.object.",
    "illumination.head.": "light.object.head.",
    "illumination.code.": "light.object.code.",
    "illumination.sphere.": "light.sphere.",
}
"""Layers of the chain, with the layers of LightNet that they start as."""
ROOT_ALPHA = 0.5
"""Value of LightNet's root alpha, which the chain's code lacks."""


def chain_from_lift(lift: Mapping[str, torch.Tensor], fresh: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return the weights of the chain, by their names in fresh, that LightNet has; none without such a network.

    LightNet sees more, the photo beside its irradiance, given normals, material and surroundings, and says more: what
    it has for these is left out, and what it has for the photo is added to what it has for the irradiance.
    """
    weights = {}
    for name in fresh:
        for ours, theirs in LAYERS.items():
            source = theirs + name.removeprefix(ours)
            if name.startswith(ours) and source in lift:
                weights[name] = _part(name, lift[source], fresh[name].shape)
    if "light.sphere.start.0.bias" in lift and "illumination.sphere.start.0.bias" in weights:
        weights["illumination.sphere.start.0.bias"] = (
            lift["light.sphere.start.0.bias"] + ROOT_ALPHA * lift["light.sphere.start.0.weight"][:, -1]
        )
    full = lift.get("light.normals.whole.1.weight")
    if full is not None and "illumination.normals.whole.2.weight" in fresh:
        rank = len(fresh["illumination.normals.whole.1.weight"])
        u, s, v = torch.linalg.svd(full.float(), full_matrices=False)
        weights["illumination.normals.whole.1.weight"] = s[:rank, None].sqrt() * v[:rank]
        weights["illumination.normals.whole.2.weight"] = u[:, :rank] * s[:rank].sqrt()
        weights["illumination.normals.whole.2.bias"] = lift["light.normals.whole.1.bias"]
    return weights


def _part(name: str, x: torch.Tensor, shape: torch.Size) -> torch.Tensor:
    """Return the part of a LightNet tensor that the chain's layer has."""
    if name.startswith("illumination.head."):
        return x[-shape[0] :]  # irradiance comes first
    if name == "illumination.sphere.first.0.0.weight":
        photo, irradiance, weight, *rest = x.split([12, 12, 4, 3, 3, 9, 4, 3], dim=1)
        coarse_photo, coarse_irradiance, features, _, directions = rest
        return torch.cat([photo + irradiance, weight, coarse_photo + coarse_irradiance, features, directions], dim=1)
    if name.startswith("illumination.sphere.seen.") and name.endswith(".0.weight"):
        own = x.shape[0]
        before, photo, irradiance, rest = x.split([own, 3, 3, x.shape[1] - own - 6], dim=1)
        return torch.cat([before, photo + irradiance, rest], dim=1)
    return x[tuple(slice(n) for n in shape)]
