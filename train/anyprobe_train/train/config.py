"""Named runs: each is a function that returns the frozen configuration of one training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from anyprobe_train.dataset.pair_source import PairConfig
from anyprobe_train.dataset.surfaces import SurfaceConfig
from anyprobe_train.train.lift import LiftConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class LightConfig:
    """Which maps light the pairs.

    real: those of the data folder, with commercial_only as far as their licence allows it; extra: those of
        hdri/train_extra too.
    procedural: how many of our own are added; variants: how many made of all these.
    """

    real: bool = True
    extra: bool = True
    commercial_only: bool = True
    procedural: int = 60
    variants: int = 0
    seed: int = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class RunConfig:
    """Configuration of a training run; its pairs are rendered as it goes.

    name: the run's folder.
    model: "lift", the one that lifts pixels to the environment map, whose losses `lift` weighs, or "normals", the part
        of it that estimates normals.
    cooldown: last share of the steps in which the learning rate falls to zero.
    """

    name: str
    steps: int
    model: str = "lift"
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 200
    cooldown: float = 0.25
    seed: int = 0
    lift: LiftConfig = field(default_factory=LiftConfig)
    pairs: PairConfig = field(default_factory=PairConfig)
    surfaces: SurfaceConfig = field(default_factory=SurfaceConfig)
    light: LightConfig = field(default_factory=LightConfig)


def lift() -> RunConfig:
    """Return the run of the model that ships, as it is continued: it lifts each pixel to where its light came from."""
    return RunConfig(
        name="lift",
        model="lift",
        steps=1_300,
        learning_rate=6e-4,
        warmup=100,
        cooldown=0.8,
        lift=LiftConfig(normals=3.0),
        pairs=PairConfig(
            seed=131,
            world=0.6,
            cut_out=0.2,
            given_normals=0.3,
            given_material=0.3,
            surroundings=0.5,
            merged_surroundings=0.4,
            joined=0.3,
            shape_augment=0.4,
            textured=0.15,
            two_materials=0.1,
        ),
        surfaces=SurfaceConfig(
            views=4,
            own_views=1,
            procedural=120,
            figures=280,
            parts=160,
            stretch=0.2,
            tilt_deg=20.0,
            bend=0.4,
            relief=0.55,
            shadows=True,
            seed=21,
        ),
        light=LightConfig(procedural=200, variants=600, seed=31),
    )


def normals() -> RunConfig:
    """Return the run of the normals of `lift`, learned alone before it."""
    return RunConfig(
        name="normals",
        model="normals",
        steps=8_000,
        learning_rate=1.5e-3,
        warmup=100,
        cooldown=0.8,
        pairs=PairConfig(seed=71, cut_out=0.2),
        surfaces=replace(lift().surfaces, parts=0, shadows=False),
        light=replace(lift().light, seed=12),
    )


RUNS = {run.__name__: run for run in (lift, normals)}
"""Runs of `anyprobe-train run`."""


def smoke(config: RunConfig, steps: int = 20) -> RunConfig:
    """Return the same run made small, for a dry run on any machine."""
    return replace(
        config,
        name=f"{config.name}-dry",
        steps=steps,
        warmup=2,
        pairs=replace(config.pairs, batch=4, group=2, pool=2),
        surfaces=replace(
            config.surfaces,
            views=1,
            procedural=3,
            figures=min(config.surfaces.figures, 3),
            parts=min(config.surfaces.parts, 3),
        ),
        light=replace(config.light, procedural=3, variants=min(config.light.variants, 3)),
    )
