"""Lights of a video, kept still on a still scene and quick where the light changes.

Two exponential averages of y = ln(L + 0.01): `fast` follows every frame, `steady` is what
is shown and chases `fast`. How long steady's memory reaches depends on how far apart the two are, in
units of the noise that the frames themselves show. One frame y, dt seconds after the last (|.| is the
root mean square over the sphere and the three channels, a(T) = 1 - exp(-dt / T)):

    |y - fast| > cut_level: hold this frame back; the second in a row starts anew. Else
    age    += dt
    noise  += a(min(noise_s, age)) (min(|y - last| / sqrt 2, 3 noise) - noise)
    lead    = a(min(fast_s, memory + dt))
    fast   += lead (y - fast)
    spread  = |fast - steady| / (noise sqrt(lead / (2 - lead)))
    motion  = clip((spread - calm) / (moved - calm), 0, 1)
    memory  = min(memory + dt, still_s) ^ (1 - motion) moving_s ^ motion
    motion > let_go: stale = stale_fast = 1
    stale  > forgotten: memory is no longer than it was
    stale_fast -= lead stale_fast
    steady += a(memory) (fast - steady), stale likewise

White noise of the frames leaves noise sqrt(lead / (2 - lead)) in `fast`: spread is about 1 while nothing
moves. Drift is separated from noise even where each frame's step is below the noise, because it adds up
in fast - steady. After a move the memory grows with the time since: steady is then about the plain
mean of what came after. A growing memory forgets only as 1 / t, so it does not grow while more of
what was before a clear move is left in steady (the share stale) than is let be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.light.environment import check_radiance

if TYPE_CHECKING:
    from jaxtyping import Float

OFFSET = 0.01
"""Added before the logarithm: what is much darker hardly lights anything, and black stays black."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Smoothing:
    """Time constants in seconds, levels of y in natural-log units (0.1 is 10 %).

    still_s, moving_s: memory of what is shown, when nothing moved for long and while the light moves.
    fast_s: of the average that leads. noise_s: of the noise level.
    least_noise: noise is never taken for smaller. cut_level: a frame further off is another scene.
    calm, moved: spreads where the gain begins to rise and where it is all risen.
    let_go: motion above which all that was before is to be forgotten. forgotten: share of it that is let be.
    """

    still_s: float = 3.0
    moving_s: float = 0.02
    fast_s: float = 0.035
    noise_s: float = 1.0
    least_noise: float = 0.01
    cut_level: float = 1.2
    calm: float = 2.0
    moved: float = 4.5
    let_go: float = 0.5
    forgotten: float = 0.05


@dataclass(frozen=True, kw_only=True, slots=True)
class FilterState:
    """What one frame hands to the next.

    steady, fast, last: [H, 2H, 3] float32, y of what is shown, of the leading average, of the
        last frame. noise: root mean square noise of a frame's y, None before the second frame.
    memory_s: time constant of steady. age_s: since the start or the last cut.
    stale, stale_fast: share of what was before the last clear move in steady and in fast.
    held: whether the last frame was held back. spread: of the last frame; about 1 on a still scene.
    """

    steady: np.ndarray
    fast: np.ndarray
    last: np.ndarray
    noise: float | None = None
    memory_s: float = 0.0
    age_s: float = 0.0
    stale: float = 0.0
    stale_fast: float = 0.0
    held: bool = False
    spread: float = 0.0

    @property
    def radiance(self) -> Float[np.ndarray, "H 2*H 3"]:
        """The light to show, [H, 2H, 3] linear."""
        return np.maximum(np.exp(self.steady) - OFFSET, 0.0)


def step(
    state: FilterState | None, radiance: Float[np.ndarray, "H 2*H 3"], dt_s: float, smoothing: Smoothing | None = None
) -> FilterState:
    """The state after one more frame; pure.

    Args:
        state: of the last frame, None for the first.
        radiance: [H, 2H, 3] of this frame, all frames in one frame of reference and one size.
        dt_s: seconds since the last frame, > 0; may differ from frame to frame.
    """
    c = smoothing or Smoothing()
    y = np.log(check_radiance(radiance, "frame's light") + np.float32(OFFSET))
    if state is None:
        return FilterState(steady=y, fast=y, last=y)
    if not (np.isfinite(dt_s) and dt_s > 0):
        raise ValueError(f"expected dt_s > 0, got {dt_s}")
    if _rms(y - state.fast) > c.cut_level:
        return FilterState(steady=y, fast=y, last=y) if state.held else replace(state, held=True)
    age = state.age_s + dt_s
    noise = difference = _rms(y - state.last) / np.sqrt(2.0)
    if state.noise is not None:
        most = 3.0 * max(state.noise, c.least_noise)
        noise = state.noise + _gain(dt_s, min(c.noise_s, age)) * (min(difference, most) - state.noise)
    lead = _gain(dt_s, min(c.fast_s, state.memory_s + dt_s))
    fast = state.fast + np.float32(lead) * (y - state.fast)
    spread = _rms(fast - state.steady) / (max(noise, c.least_noise) * np.sqrt(lead / (2.0 - lead)))
    motion = min(max((spread - c.calm) / (c.moved - c.calm), 0.0), 1.0)
    memory = min(state.memory_s + dt_s, c.still_s) ** (1.0 - motion) * c.moving_s**motion
    stale, stale_fast = (1.0, 1.0) if motion > c.let_go else (state.stale, state.stale_fast)
    if stale > c.forgotten:
        memory = min(memory, max(state.memory_s, c.moving_s))
    share = _gain(dt_s, memory)
    stale_fast -= lead * stale_fast
    return FilterState(
        steady=state.steady + np.float32(share) * (fast - state.steady),
        fast=fast,
        last=y,
        noise=noise,
        memory_s=memory,
        age_s=age,
        stale=stale + share * (stale_fast - stale),
        stale_fast=stale_fast,
        spread=spread,
    )


def _gain(dt_s: float, time_s: float) -> float:
    return float(-np.expm1(-dt_s / time_s))


def _rms(difference: np.ndarray) -> float:
    """Root mean square over the sphere and the channels of [H, 2H, 3]."""
    weights = pixel_solid_angles(difference.shape[0])[:, 0].astype(np.float64)
    rows = np.square(difference, dtype=np.float64).mean(axis=(1, 2))
    return float(np.sqrt(rows @ weights / weights.sum()))
