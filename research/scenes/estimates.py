"""What the shipped networks answer on kept pairs, and the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.estimate.runtime import WHOLE, WHOLE_INPUTS, Models, Outputs
from anyprobe.estimate.surroundings import DARK_BESIDE, GoesOn, use_surroundings


@dataclass(frozen=True, kw_only=True, slots=True)
class PairEstimate:
    """Maps [64, 128, 3] in the crop's frame of one photo.

    family: number of layouts.FAMILIES. is_cut_out: whether the object alone is known. beside: mean display luminance
    beside the object over the object's, 0 of a cut-out. alone: what the object alone says; whole: the whole photo, what
    is seen not yet in it. seen: surroundings [64, 128, 4].
    """

    family: int
    is_cut_out: bool
    beside: float
    alone: np.ndarray
    whole: np.ndarray
    seen: np.ndarray
    truth: np.ndarray

    def shipped(self, goes_on: GoesOn | None = None) -> np.ndarray:
        """Return the map that the estimator answers with."""
        if self.is_cut_out or self.beside < DARK_BESIDE:
            return self.alone
        guess = Outputs(radiance=self.whole, irradiance=self.whole, ldr=self.whole, ln_radiance=self.whole)
        return use_surroundings(guess, self.seen, goes_on=goes_on or GoesOn()).radiance


def estimates_of(files: Sequence[Path], models: Models) -> Iterator[PairEstimate]:
    """Yield the answers to the pairs of files of research.scenes.pairs."""
    for path in files:
        with np.load(path) as stored:
            part = {name: stored[name] for name in stored.files}
        for k in range(len(part["up"])):
            context, crop = (part[name][k] / np.float32(255) for name in ("context", "image"))
            lift, around = (part[name][k][None].astype(np.float32) for name in ("lift", "surroundings"))
            inside = crop[..., 3] > 0.5
            beside = (context[..., 4] > 0.5) & (context[..., 3] < 0.02)
            level = 0.0
            if beside.any() and inside.any():
                own = luminance(crop[inside][:, :3] / crop[inside][:, 3:]).mean()
                level = float(luminance(context[beside][:, :3]).mean() / max(own, 1e-3))
            given = {
                "context": context.transpose(2, 0, 1)[None],
                "tan_half": part["tan_half"][k].reshape(1, 1),
                "alone_expected": lift[:, :3],
                "alone_radiance": lift[:, 3:6],
                "alone_confidence": lift[:, 6:],
                "posterior": part["posterior"][k][None],
                "surroundings": around / 255,
                "up": np.zeros((1, 3), np.float32),
            }
            drawn, *_ = models._run[WHOLE](*(given[name] for name in WHOLE_INPUTS))
            yield PairEstimate(
                family=int(part["family"][k]),
                is_cut_out=not context[..., 4].any(),
                beside=level,
                alone=_map(lift[0, 3:6]),
                whole=_map(drawn[0]),
                seen=around[0].transpose(1, 2, 0) / 255,
                truth=_map(part["truth"][k].astype(np.float32)),
            )


def _map(ln_radiance: np.ndarray) -> np.ndarray:
    return np.exp(ln_radiance).transpose(1, 2, 0)
