"""Named runs: each is a function that returns the frozen configuration of one network's training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from anyprobe.dataset.pairs import PairConfig
from anyprobe.dataset.surfaces import SurfaceConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class LightConfig:
    """Which maps light the pairs: real ones the licence allows, and so many of our own."""

    commercial_only: bool = True
    procedural: int = 60
    seed: int = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class RunConfig:
    """One network's training.

    stage: irradiance, illumination or hdr.
    source: what the illumination net sees: "photo", "estimate" (the irradiance net's
        output) or "truth"; truth_share of the pairs see the true irradiance anyway.
    gradual: whether targets sharpen as in Eq. 6.
    cooldown: last share of the steps in which the learning rate falls to zero.
    """

    stage: str
    steps: int
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 200
    cooldown: float = 0.25
    seed: int = 0
    source: str = "estimate"
    truth_share: float = 0.25
    gradual: bool = True
    pairs: PairConfig = field(default_factory=PairConfig)
    surfaces: SurfaceConfig = field(default_factory=SurfaceConfig)
    light: LightConfig = field(default_factory=LightConfig)


def irradiance() -> RunConfig:
    """Paper Sect. 3.2: photo -> importance-weighted irradiance."""
    return RunConfig(stage="irradiance", steps=3200, pairs=PairConfig(seed=11))


def illumination() -> RunConfig:
    """Paper Sect. 3.3: estimated irradiance -> LDR map, targets sharpening over 11 epochs."""
    return RunConfig(stage="illumination", steps=6600, pairs=PairConfig(seed=12))


def hdr() -> RunConfig:
    """Paper Sect. 3.4: LDR map -> ln radiance."""
    return RunConfig(stage="hdr", steps=1000, pairs=PairConfig(seed=13))


RUNS = {run.__name__: run for run in (irradiance, illumination, hdr)}


def smoke(config: RunConfig, steps: int = 20) -> RunConfig:
    """The same run made small: a dry run for any machine."""
    return replace(
        config,
        steps=steps,
        warmup=2,
        pairs=replace(config.pairs, batch=4, group=2, pool=2),
        surfaces=replace(config.surfaces, views=1, procedural=3),
        light=replace(config.light, procedural=3),
    )
