"""Lights of a video, kept still on a still scene and quick where the light changes.

Two exponential averages of y = ln(L + 0.01): `fast` follows every frame, `steady` is what
is shown and chases `fast`. Above white y goes on as a straight line: small light sources that frames place
side by side keep their power, which averages of the logarithm would lose. How long steady's memory reaches
depends on how far apart the two are, in units of the noise that the frames themselves show. One frame y, dt
seconds after the last (|.| is the root mean square over the sphere and the three channels of differences of
ln(L + 0.01), a(T) = 1 - exp(-dt / T)):

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

from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.light.environment import check_radiance

if TYPE_CHECKING:
    from jaxtyping import Float

FILTER = contract("filter")
OFFSET: float = FILTER["offset"]
"""Added before the logarithm: what is much darker hardly lights anything, and black stays black."""
SLOPE = np.float32(1.0 + OFFSET)
WHITE = np.log(SLOPE)
"""y of L = 1; from there on dL = SLOPE dy."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Smoothing:
    """Time constants in seconds, levels of y in natural-log units (0.1 is 10 %).

    still_s, moving_s: memory of what is shown, when nothing moved for long and while the light moves.
    fast_s: of the average that leads. noise_s: of the noise level.
    least_noise: noise is never taken for smaller. cut_level: a frame further off is another scene.
    calm, moved: spreads where the gain begins to rise and where it is all risen.
    let_go: motion above which all that was before is to be forgotten. forgotten: share of it that is let be.
    """

    still_s: float = FILTER["still_s"]
    moving_s: float = FILTER["moving_s"]
    fast_s: float = FILTER["fast_s"]
    noise_s: float = FILTER["noise_s"]
    least_noise: float = FILTER["least_noise"]
    cut_level: float = FILTER["cut_level"]
    calm: float = FILTER["calm"]
    moved: float = FILTER["moved"]
    let_go: float = FILTER["let_go"]
    forgotten: float = FILTER["forgotten"]


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
        return np.maximum(np.exp(np.minimum(self.steady, WHITE)) - OFFSET, 0.0) + SLOPE * _above_white(self.steady)


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
    y = encode(check_radiance(radiance, "frame's light"))
    if state is None:
        return FilterState(steady=y, fast=y, last=y)
    if not (np.isfinite(dt_s) and dt_s > 0):
        raise ValueError(f"expected dt_s > 0, got {dt_s}")
    if _apart(y, state.fast) > c.cut_level:
        return FilterState(steady=y, fast=y, last=y) if state.held else replace(state, held=True)
    age = state.age_s + dt_s
    noise = difference = _apart(y, state.last) / np.sqrt(2.0)
    if state.noise is not None:
        most = 3.0 * max(state.noise, c.least_noise)
        noise = state.noise + _gain(dt_s, min(c.noise_s, age)) * (min(difference, most) - state.noise)
    lead = _gain(dt_s, min(c.fast_s, state.memory_s + dt_s))
    fast = state.fast + np.float32(lead) * (y - state.fast)
    spread = _apart(fast, state.steady) / (max(noise, c.least_noise) * np.sqrt(lead / (2.0 - lead)))
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


def encode(radiance: np.ndarray) -> np.ndarray:
    """y of L."""
    return np.log(np.minimum(radiance, 1.0) + np.float32(OFFSET)) + np.maximum(radiance - 1.0, 0.0) / SLOPE


def _above_white(y: np.ndarray) -> np.ndarray:
    return np.maximum(y - WHITE, 0.0)


def _logarithm(y: np.ndarray) -> np.ndarray:
    """ln(L + OFFSET)."""
    return np.minimum(y, WHITE) + np.log1p(_above_white(y))


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """Root mean square over the sphere and the channels of the difference of ln(L + OFFSET), of two y [H, 2H, 3]."""
    difference = _logarithm(one) - _logarithm(other)
    weights = pixel_solid_angles(difference.shape[0])[:, 0].astype(np.float64)
    rows = np.square(difference, dtype=np.float64).mean(axis=(1, 2))
    return float(np.sqrt(rows @ weights / weights.sum()))
