"""Kept pairs of research.scenes, and the batches that are drawn from them: other light, noise, left for right."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.response import MEAN_CURVE
from anyprobe.errors import InputError
from anyprobe_train.nets.light_net import display
from anyprobe_train.whole_network.source_profiles import source_colors, source_profiles

LEVEL_SPREAD, TINT_SPREAD = 0.25, 0.12
"""Standard deviations of ln of the light that a pair has more of, all of it and each channel, each time it is seen."""
USED = ("image", "context", "tan_half", "surroundings", "truth", "up", "family")
"""Arrays of research.scenes.pairs.Known that are learned from."""
WHITE = 0.98
"""Display value from which on a pixel of a photo is clipped: less light does not make it less."""
NOISE = 0.03
"""Largest standard deviation of display values that pairs are seen with."""
FLIPPED, SIGNED = ("photo", "context", "surroundings", "truth"), ("up", "given_up")
"""Arrays of a batch that change in a mirror: left and right, or the sign of x."""


class Pairs:
    """Kept pairs in the memory of a device, 195 KB each."""

    def __init__(self, folder: Path, most: int = 0, device: str = "cpu") -> None:
        """Read a folder's files in the order of their names, at least `most` pairs; InputError where there are none."""
        self.folder, self.device = folder, torch.device(device)
        files = sorted(folder.glob("*.npz"))
        if not files:
            raise InputError(f"{folder}: expected pairs, found none; make them with python -m research.scenes pairs")
        parts: list[dict[str, torch.Tensor]] = []
        seen, count = hashlib.sha256(), 0
        for path in files:
            with np.load(path, allow_pickle=False) as stored:
                part = {name: torch.from_numpy(stored[name]).to(self.device) for name in USED}
            part["profiles"], part["colors"] = _profiles(part["truth"])
            parts.append(part)
            count += len(part["up"])
            seen.update(f"{path.name} {len(part['up'])} ".encode())
            if 0 < most <= count:
                break
        self._files = len(parts)
        self._arrays = {name: torch.cat([part.pop(name) for part in parts]) for name in tuple(parts[0])}
        self.identity = f"{count} pairs {seen.hexdigest()[:8]}"
        """Which pairs these are: how many, and a digest of their files' names and lengths."""

    def __len__(self) -> int:
        return len(self._arrays["up"])

    def grown(self) -> Pairs:
        """Return the pairs with files that were added to the folder meanwhile."""
        same = len(list(self.folder.glob("*.npz"))) == self._files
        return self if same else Pairs(self.folder, device=self.device.type)

    def rows(self, start: int, stop: int) -> dict[str, torch.Tensor]:
        """Return pairs in order, as they are, as PhotoNet takes them."""
        return self._batch(torch.arange(start, min(stop, len(self)), device=self.device))

    def batch(
        self, rng: np.random.Generator, count: int, given_up: float, panoramas: float = 0.0
    ) -> dict[str, torch.Tensor]:
        """Return a random batch, as PhotoNet takes it.

        given_up, panoramas: shares of the pairs that are told which way is up, and that know a part of the map instead
            of the photo around the object.
        """
        batch = self._batch(self._on(rng.integers(len(self), size=count)))
        ln_gain = self._on(rng.normal(0.0, LEVEL_SPREAD, (count, 1)) + rng.normal(0.0, TINT_SPREAD, (count, 3))).float()
        gain = ln_gain[:, :, None, None]
        noise = self._on(rng.uniform(0.0, NOISE, (count, 1, 1, 1))).float()
        generator = torch.Generator(self.device).manual_seed(int(rng.integers(2**62)))
        for name in ("photo", "context", "surroundings"):
            batch[name] = _seen(batch[name], gain, noise, generator)
        batch["truth"] = batch["truth"] + gain
        batch["given_up"] = batch["up"] * self._on(rng.random((count, 1)) < given_up).float()
        batch = with_panoramas(batch, rng, panoramas)
        return mirrored_pairs(batch, self._on(rng.random(count) < 0.5))

    def _batch(self, index: torch.Tensor) -> dict[str, torch.Tensor]:
        of = {name: values[index] for name, values in self._arrays.items()}
        photo, context = ((of[name].float() / 255).permute(0, 3, 1, 2) for name in ("image", "context"))
        return {
            "photo": photo,
            "context": context,
            "tan_half": of["tan_half"][:, None].float(),
            "surroundings": of["surroundings"].float() / 255,
            "truth": of["truth"].float(),
            "profiles": of["profiles"],
            "colors": of["colors"],
            "up": of["up"].float(),
            "given_up": torch.zeros(len(index), 3, device=self.device),
            "family": of["family"],
        }

    def _on(self, values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values).to(self.device)


def mirrored_pairs(batch: dict[str, torch.Tensor], some: torch.Tensor) -> dict[str, torch.Tensor]:
    """Return a batch of which left and right are exchanged in some [N] pairs."""
    flipped = {name: torch.where(some[:, None, None, None], batch[name].flip(3), batch[name]) for name in FLIPPED}
    signs = torch.where(some[:, None], batch["up"].new_tensor([-1.0, 1.0, 1.0]), batch["up"].new_ones(3))
    return {**batch, **flipped, **{name: batch[name] * signs for name in SIGNED}}


def with_panoramas(batch: dict[str, torch.Tensor], rng: np.random.Generator, share: float) -> dict[str, torch.Tensor]:
    """Return the batch with some photos of which only a part of the map is known, as from a panorama."""
    truth = batch["truth"]
    some = torch.from_numpy(rng.random(len(truth)) < share).to(truth.device)
    rows, columns = truth.shape[2:]
    turn, width = rng.integers(columns), rng.integers(columns // 4, columns)
    low, high = rng.uniform(0, 0.5), rng.uniform(0.5, 1)
    known = truth.new_zeros(1, 1, rows, columns)
    known[:, :, int(low * rows) : int(high * rows), :width] = 1.0
    known = known.roll(int(turn), dims=3).expand(len(some), -1, -1, -1)
    panorama = torch.cat([display(truth).clip(max=1.0) * known, known], dim=1)
    where = some[:, None, None, None]
    context = torch.where(where, torch.zeros_like(batch["context"]), batch["context"])
    return {**batch, "surroundings": torch.where(where, panorama, batch["surroundings"]), "context": context}


def _seen(
    picture: torch.Tensor, ln_gain: torch.Tensor, noise: torch.Tensor, generator: torch.Generator
) -> torch.Tensor:
    """Return a picture [N, 4 or 5, H, W], the last channel its cover, in more light and with a camera's noise."""
    bright = brighter(picture, ln_gain)
    cover = bright[:, -1:]
    colors = (bright[:, :3] + noise * cover * _grain(bright[:, :3], generator)) * (cover > 0)
    return torch.cat([colors, bright[:, 3:]], dim=1).clip(0.0, 1.0)


def _grain(like: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Noise of pixels and of spots of four, of the same shape."""
    sides = (side // 4 for side in like.shape[2:])
    spots = torch.randn((*like.shape[:2], *sides), generator=generator, device=like.device)
    wide = F.interpolate(spots, size=like.shape[2:], mode="bilinear")
    return 0.7 * (torch.randn(like.shape, generator=generator, device=like.device) + wide)


def brighter(picture: torch.Tensor, ln_gain: torch.Tensor) -> torch.Tensor:
    """Display values [N, 3 and more, H, W] of ln_gain [N, 3, 1, 1] more light; of premultiplied ones about.

    What is clipped stays clipped.
    """
    n, sigma = MEAN_CURVE.exponent, MEAN_CURVE.sigma
    ratio = (picture[:, :3] / (1 + sigma)).clip(max=0.999)
    ln = torch.log(ratio * sigma / (1 - ratio) + 1e-9) / n
    shown = torch.where(picture[:, :3] >= WHITE, picture[:, :3], display(ln + ln_gain))
    return torch.cat([shown.clip(max=1.0), picture[:, 3:]], dim=1)


def _profiles(truth: torch.Tensor, at_once: int = 32) -> tuple[torch.Tensor, torch.Tensor]:
    """Return source_profiles of ln maps [N, 3, H, 2H], and the sources' colours."""
    luminance, profiles, colors = torch.tensor(REC709, device=truth.device), [], []
    for start in range(0, len(truth), at_once):
        radiance = torch.exp(truth[start : start + at_once].float())
        places, shares = source_profiles(torch.einsum("c,nchw->nhw", luminance, radiance))
        profiles.append(shares)
        colors.append(source_colors(radiance, places, luminance))
    return torch.cat(profiles), torch.cat(colors)
