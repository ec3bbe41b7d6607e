"""What the shipped networks answer on kept pairs, and the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.response import inverse_response
from anyprobe.estimate.runtime import Models, Outputs
from anyprobe.estimate.surroundings import DARK_BESIDE, GoesOn, use_surroundings


@dataclass(frozen=True, kw_only=True, slots=True)
class PairEstimate:
    """Maps [64, 128, 3] in the crop's frame of one photo.

    family: number of layouts.FAMILIES. is_cut_out: whether the object alone is known. beside: mean display luminance
    beside the object over the object's, 0 of a cut-out. alone: as of a cut-out; whole: of the whole photo, what
    is seen not yet in it. seen: surroundings [64, 128, 4]. own: mean radiance [3] of the object in the photo.
    expected: of the answer that ships, with light sources spread over all places where they may be.
    """

    family: int
    is_cut_out: bool
    beside: float
    alone: np.ndarray
    whole: np.ndarray
    seen: np.ndarray
    truth: np.ndarray
    own: np.ndarray
    expected: np.ndarray | None = None

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
            inside = crop[..., 3] > 0.5
            beside = (context[..., 4] > 0.5) & (context[..., 3] < 0.02)
            level, shown = 0.0, crop[inside][:, :3] / crop[inside][:, 3:]
            if beside.any() and inside.any():
                level = float(luminance(context[beside][:, :3]).mean() / max(luminance(shown).mean(), 1e-3))
            tan_half, around = float(part["tan_half"][k]), part["surroundings"][k].transpose(1, 2, 0) / np.float32(255)
            alone = models(crop, tan_half)
            is_cut_out = not context[..., 4].any()
            whole = alone if is_cut_out else models(crop, tan_half, surroundings=around, context=context)
            yield PairEstimate(
                family=int(part["family"][k]),
                is_cut_out=is_cut_out,
                beside=level,
                alone=alone.radiance,
                whole=whole.radiance,
                expected=(alone if is_cut_out or level < DARK_BESIDE else whole).expected,
                seen=around,
                own=inverse_response(shown).mean(axis=0) if inside.any() else np.full(3, np.nan),
                truth=np.exp(part["truth"][k].astype(np.float32)).transpose(1, 2, 0),
            )
