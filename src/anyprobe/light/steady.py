"""A filter for a sequence of values, still while they are still and quick when they change: two exponential averages.

`fast` follows every value y; `steady` is the output and follows `fast`. The length of steady's memory depends on the
distance between the two, in units of the noise that the values themselves show. For one value, dt seconds after the
last (|.| is the caller's distance, a(T) = 1 - exp(-dt / T)):

    age    += dt
    noise  += a(min(noise_s, age)) (min(|y - last| / sqrt 2, 3 noise) - noise)
    lead    = a(min(fast_s, memory + dt))
    fast   += lead (y - fast)
    spread  = |fast - steady| / (noise sqrt(lead / (2 - lead)))
    motion  = clip((spread - calm) / (moved - calm), 0, 1)
    memory  = min(memory + dt, still_s) ^ (1 - motion) moving_s ^ motion
    motion > let_go: stale = stale_fast = 1
    stale  > forgotten: memory stays as it was
    stale_fast -= lead stale_fast
    steady += a(memory) (fast - steady), stale likewise

White noise leaves noise sqrt(lead / (2 - lead)) in `fast`: spread is about 1 while nothing moves. Drift is separated
from noise even where each step is below the noise, because it adds up in fast - steady. After a move the memory grows
with the time since: steady is then close to the plain mean of the values after it. A growing memory forgets only as
1 / t, so it does not grow while steady holds more than `forgotten` of the values before a clear move (its share stale).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from anyprobe.core.contract import contract

FILTER: dict[str, Any] = contract("filter")
"""Time constants [s], memories after a long rest and while it moves among them; the least noise; spreads at which the
gain begins to rise and has risen fully; motion above which all values before are to be forgotten, and the share of them
that may remain."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Steady:
    """State of the filter.

    steady, fast, last: output, leading average, last value. noise: None before the second value.
    memory_s: time constant of steady. age_s: time since the start.
    stale, stale_fast: share of values from before the last clear move in steady and in fast.
    motion: 0 while nothing moves, at the last value.
    """

    steady: np.ndarray
    fast: np.ndarray
    last: np.ndarray
    noise: float | None = None
    memory_s: float = 0.0
    age_s: float = 0.0
    stale: float = 0.0
    stale_fast: float = 0.0
    motion: float = 0.0


def begin_filter(y: np.ndarray) -> Steady:
    """Start a filter at its first value."""
    return Steady(steady=y, fast=y, last=y)


def advance(
    state: Steady,
    y: np.ndarray,
    dt_s: float,
    apart: Callable[[np.ndarray, np.ndarray], float],
    c: Mapping[str, Any] = FILTER,
) -> Steady:
    """Return the state after one more value; pure.

    apart: distance |one - other|. c: numbers as of FILTER.
    """
    age = state.age_s + dt_s
    noise = difference = apart(y, state.last) / np.sqrt(2.0)
    if state.noise is not None:
        most = 3.0 * max(state.noise, c["least_noise"])
        noise = state.noise + gain(dt_s, min(c["noise_s"], age)) * (min(difference, most) - state.noise)
    lead = gain(dt_s, min(c["fast_s"], state.memory_s + dt_s))
    fast = toward(state.fast, y, lead)
    spread = apart(fast, state.steady) / (max(noise, c["least_noise"]) * np.sqrt(lead / (2.0 - lead)))
    motion = min(max((spread - c["calm"]) / (c["moved"] - c["calm"]), 0.0), 1.0)
    memory = min(state.memory_s + dt_s, c["still_s"]) ** (1.0 - motion) * c["moving_s"] ** motion
    stale, stale_fast = (1.0, 1.0) if motion > c["let_go"] else (state.stale, state.stale_fast)
    if stale > c["forgotten"]:
        memory = min(memory, max(state.memory_s, c["moving_s"]))
    share = gain(dt_s, memory)
    stale_fast -= lead * stale_fast
    return Steady(
        steady=toward(state.steady, fast, share),
        fast=fast,
        last=y,
        noise=float(noise),
        memory_s=float(memory),
        age_s=age,
        stale=stale + share * (stale_fast - stale),
        stale_fast=stale_fast,
        motion=float(motion),
    )


def gain(dt_s: float, time_s: float) -> float:
    """Return a(T), the fraction of the way covered in dt seconds."""
    return float(-np.expm1(-dt_s / time_s))


def toward(from_: np.ndarray, to: np.ndarray, share: float) -> np.ndarray:
    """Interpolate between the two; share 0 is from_."""
    return from_ + from_.dtype.type(share) * (to - from_)
