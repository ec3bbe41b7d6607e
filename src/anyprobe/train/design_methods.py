"""The trained designs as methods that the evaluation can score."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.errors import ModelError
from anyprobe.evaluate.panel import Estimate, Method
from anyprobe.evaluate.unwrap import unwrap_ball, unwrap_mirror
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.reconstruct import reconstruct
from anyprobe.nets.design_nets import SIZE
from anyprobe.render.surface import pixel_rays
from anyprobe.train.checkpoint import read_checkpoint
from anyprobe.train.designs import DESIGNS, IMAGE
from anyprobe.train.frozen_irradiance import load_frozen_irradiance
from anyprobe.train.loop import load_nets, pairs_seen

RUN_OF = {"designs": "designs", "hdr": "hdr_curves"}
"""By model, the run that trains it."""


def read_run(checkpoint: Path) -> dict[str, int]:
    """What a results file says of the run: steps, pairs, seed, pairs of the irradiance network, and whether all were
    of the laboratory."""
    if not checkpoint.is_file():
        raise ModelError(
            f"{checkpoint}: expected the designs' checkpoint, found none; anyprobe train designs"
        )
    stored, config = _read(checkpoint, "designs")
    return {
        "steps": stored["step"],
        "of_steps": config["steps"],
        "pairs": pairs_seen(stored),
        "seed": config["pairs"]["seed"],
        "irradiance_pairs": load_frozen_irradiance()[1]
        + (pairs_seen(stored) if config.get("irradiance_learns") else 0),
        "laboratory": config["pairs"].get("laboratory", False),
    }


def read_hdr_run(checkpoint: Path) -> dict[str, Any]:
    """What a results file says of the run whose HDR network takes the place of the designs': name, steps, views."""
    stored, config = _read(checkpoint, "hdr")
    return {"hdr_run": config["name"], "hdr_steps": stored["step"], "hdr_pairs": pairs_seen(stored)}


def _read(checkpoint: Path, wanted: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """A checkpoint and its configuration; ModelError if it is of another model."""
    stored = read_checkpoint(checkpoint)
    config = json.loads(stored["config"])
    model = config.get("model", "paper")
    if model != wanted:
        raise ModelError(f"{checkpoint}: expected a run of {RUN_OF[wanted]}, got one of {model}")
    return stored, config


class DesignMethods:
    """Every design of a checkpoint, by name, each a Method."""

    def __init__(self, checkpoint: Path, hdr: Path | None = None) -> None:
        """hdr: checkpoint of a run of hdr_curves, whose HDR network then serves all designs, not their own."""
        self.run: dict[str, Any] = read_run(checkpoint)
        self.nets = load_nets(checkpoint)
        if hdr is not None:
            self.run |= read_hdr_run(hdr)
            self.nets["hdr"] = load_nets(hdr)["hdr"]
        self.has_own_irradiance = IMAGE in self.nets
        self.irradiance = self.nets[IMAGE] if self.has_own_irradiance else load_frozen_irradiance()[0]
        self._of: Pair | None = None
        self._irradiance = torch.zeros(0)

    def methods(self) -> dict[str, Method]:
        """direct, irradiance, ours, the second seeds, ideal, georgoulis, meka."""
        result: dict[str, Method] = {name: self._design(name) for name in DESIGNS}
        return result | {"ideal": self.ideal, "georgoulis": self.georgoulis, "meka": self.meka}

    def mixed(self, name: str, pair: Pair, share: float) -> tuple[np.ndarray, np.ndarray]:
        """A design given estimated irradiance with a share of the truth: the mixture, and its LDR map."""
        mask = _tensor(pair.crop)[:, 3:]
        truth = _tensor(pair.irradiance.astype(np.float32) / 255.0) * mask
        seen = torch.lerp(self._estimated_irradiance(pair), truth, share)
        return seen[0].permute(1, 2, 0).numpy(), self._map(name, torch.cat([seen, mask], dim=1))

    def _design(self, name: str) -> Callable[[Pair], Estimate]:
        design = DESIGNS[name]

        def method(pair: Pair) -> Estimate:
            photo = _tensor(pair.crop)
            estimate = None
            if design.sees_irradiance:
                seen = self._estimated_irradiance(pair)
                estimate = seen[0].permute(1, 2, 0).numpy()
                photo = torch.cat([seen, photo[:, 3:]], dim=1)
            ldr = self._map(name, photo)
            return Estimate(ldr=ldr, radiance=self._radiance(ldr), irradiance=estimate)

        return method

    def ideal(self, pair: Pair) -> Estimate:
        """The networks of "ours", each given the truth: its LDR map is from the true irradiance, its
        radiance from the true LDR map. The irradiance image is the estimated one."""
        irradiance = pair.irradiance.astype(np.float32) / 255.0 * pair.crop[..., 3:]
        ldr = self._map("ours", _tensor(np.concatenate([irradiance, pair.crop[..., 3:]], axis=-1)))
        true_ldr = response(pair.radiance)
        estimate = self._estimated_irradiance(pair)[0].permute(1, 2, 0).numpy()
        return Estimate(ldr=ldr, radiance=self._radiance(true_ldr), irradiance=estimate)

    @torch.no_grad()
    def georgoulis(self, pair: Pair) -> Estimate:
        """The ball it draws, unwrapped; display values only."""
        ball = self.nets["georgoulis"](F.avg_pool2d(_tensor(pair.crop), 2))
        return Estimate(ldr=unwrap_ball(ball[0].permute(1, 2, 0).numpy()))

    @torch.no_grad()
    def meka(self, pair: Pair) -> Estimate:
        """The grey mirror image, unwrapped by the true normals; display values only, three equal channels."""
        normals = F.avg_pool2d(_tensor(pair.normals), 2)
        length = normals.square().sum(dim=1, keepdim=True).sqrt()
        normals = torch.where(length > 0.5, normals / length.clip(min=1e-6), 0.0)
        photo = F.avg_pool2d(_tensor(pair.crop), 2)
        mirror = self.nets["meka"](torch.cat([photo, normals], dim=1))[0, 0].numpy()
        mask = (length[0, 0] > 0.5).numpy() & (photo[0, 3] > 0.5).numpy()
        wo = pixel_rays(pair.tan_half, SIZE)
        n = normals[0].permute(1, 2, 0).numpy()
        grey = unwrap_mirror(mirror[mask][:, None], n[mask], wo[mask])
        return Estimate(ldr=np.repeat(grey, 3, axis=2))

    @torch.no_grad()
    def _estimated_irradiance(self, pair: Pair) -> torch.Tensor:
        """[1, 3, 128, 128]; kept for the next design of the same pair."""
        if self._of is not pair:
            self._of, self._irradiance = pair, self.irradiance(_tensor(pair.crop)).clip(0, 1)
        return self._irradiance

    @torch.no_grad()
    def _map(self, name: str, image: torch.Tensor) -> np.ndarray:
        """LDR map [64, 128, 3] of an image [1, 4, 128, 128]."""
        return _grow(self.nets[name](F.avg_pool2d(image, 2)))

    @torch.no_grad()
    def _radiance(self, ldr: np.ndarray) -> np.ndarray:
        """Eq. 7-8 with the HDR network, [64, 128, 3]."""
        ln = _grow(self.nets["hdr"](F.avg_pool2d(_tensor(ldr), 2)))
        return reconstruct(ldr, ln).astype(np.float32)


def _tensor(picture: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(picture, np.float32)).permute(2, 0, 1)[None]


def _grow(maps: torch.Tensor) -> np.ndarray:
    """[1, C, 32, 64] -> [64, 128, C], interpolated across the seam."""
    wide = torch.cat([maps[..., -1:], maps, maps[..., :1]], dim=3)
    grown = F.interpolate(
        wide, scale_factor=MAP_HEIGHT // maps.shape[2], mode="bilinear", align_corners=False
    )
    edge = MAP_HEIGHT // maps.shape[2]
    return np.ascontiguousarray(grown[0, :, :, edge:-edge].permute(1, 2, 0).numpy())
