"""Named runs: each is a function that returns the frozen configuration of one training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from anyprobe.dataset.pairs import PairConfig
from anyprobe.dataset.surfaces import SurfaceConfig
from anyprobe.train.lift import LiftConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class LightConfig:
    """Which maps light the pairs.

    real: those of the data folder, with commercial_only as far as their licence allows it.
    procedural: how many of our own are added; variants: how many made of all these.
    """

    real: bool = True
    commercial_only: bool = True
    procedural: int = 60
    variants: int = 0
    seed: int = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class RunConfig:
    """The training of one model on pairs made as it goes.

    name: of the run's folder.
    model: "paper", the chain of three networks, "lift", the one that lifts pixels to the map, "normals",
        the part of it that guesses normals, or "designs", every design of the paper's Table 1 and two rivals
        at half size;
        truth_share, gradual and hdr_share concern the first, lift the second, truth_share and
        hdr_share the third.
    truth_share: share of a batch in which the illumination net sees the true irradiance,
        the rest sees the irradiance net's.
    gradual: whether the LDR targets sharpen as in Eq. 6.
    hdr_share: share of a batch that the HDR net learns from, half true LDR maps, half estimated.
    cooldown: last share of the steps in which the learning rate falls to zero.
    """

    name: str
    steps: int
    model: str = "paper"
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 200
    cooldown: float = 0.25
    seed: int = 0
    truth_share: float = 0.25
    hdr_share: float = 0.5
    gradual: bool = True
    lift: LiftConfig = field(default_factory=LiftConfig)
    pairs: PairConfig = field(default_factory=PairConfig)
    surfaces: SurfaceConfig = field(default_factory=SurfaceConfig)
    light: LightConfig = field(default_factory=LightConfig)


def paper() -> RunConfig:
    """The paper's chain (Sect. 3.2-3.4). It trains its networks one after another; here one pass serves all."""
    return RunConfig(name="paper", steps=10_000, pairs=PairConfig(seed=11))


def lift() -> RunConfig:
    """The model that ships: lifts what each pixel shows to where its light came from."""
    return RunConfig(
        name="lift",
        model="lift",
        steps=900,
        warmup=100,
        cooldown=0.8,
        lift=LiftConfig(normals=3.0),
        pairs=PairConfig(seed=73, cut_out=0.2, told=0.3, around=0.7),
        surfaces=SurfaceConfig(
            views=12,
            own_views=1,
            procedural=600,
            figures=1400,
            stretch=0.2,
            tilt_deg=20.0,
            bend=0.4,
            relief=0.55,
            seed=21,
        ),
        light=LightConfig(procedural=200, variants=600, seed=12),
    )


def normals() -> RunConfig:
    """The normals of `lift`, learned alone before it."""
    return RunConfig(
        name="normals",
        model="normals",
        steps=8_000,
        learning_rate=1.5e-3,
        warmup=100,
        cooldown=0.8,
        pairs=PairConfig(seed=71, cut_out=0.2),
        surfaces=lift().surfaces,
        light=lift().light,
    )


def shapes_trial() -> RunConfig:
    """The same from more and other shapes: machined parts, surfaces joined and given other shapes."""
    return replace(
        normals(),
        name="shapes_trial",
        steps=2_500,
        pairs=replace(normals().pairs, seed=82, joined=0.3, reshaped=0.7),
        surfaces=replace(normals().surfaces, parts=800),
    )


def lift_trial() -> RunConfig:
    """A short run of it, of as many pairs as light_real."""
    return replace(
        lift(),
        name="lift_trial",
        steps=600,
        warmup=50,
        cooldown=0.5,
        pairs=replace(lift().pairs, seed=59, around=0.0),
        surfaces=replace(lift().surfaces, views=9, figures=400, bend=0.0, relief=0.0, seed=4),
        light=replace(lift().light, seed=8),
    )


def code_trial() -> RunConfig:
    """The same without lifting: everything passes through one vector."""
    return _lift_trial("code_trial", lifting=False)


def anchors_trial() -> RunConfig:
    """The same with a loss of how far light must be carried to where it is."""
    return _lift_trial("anchors_trial", anchors=0.2)


def still_trial() -> RunConfig:
    """The same with a loss of what changes from a frame to the next."""
    return _lift_trial("still_trial", stillness=0.3)


def _lift_trial(name: str, **losses) -> RunConfig:
    return replace(lift_trial(), name=name, lift=replace(lift_trial().lift, **losses))


def designs() -> RunConfig:
    """The paper's designs and two rivals, each on the same pairs, to be compared (docs/results.md)."""
    return RunConfig(
        name="designs",
        model="designs",
        steps=3_000,
        learning_rate=2e-3,
        warmup=100,
        cooldown=0.5,
        pairs=PairConfig(seed=41, batch=16),
        light=LightConfig(variants=90),
    )


def light_real() -> RunConfig:
    """A short run on real maps only; with the three below it measures what other maps add."""
    return _light_trial("light_real", LightConfig(procedural=0))


def light_own() -> RunConfig:
    """A short run on maps of our own only."""
    return _light_trial("light_own", LightConfig(real=False, procedural=200))


def light_both() -> RunConfig:
    """A short run on real maps and our own."""
    return _light_trial("light_both", LightConfig(procedural=200))


def light_variants() -> RunConfig:
    """A short run on real maps and light made of them."""
    return _light_trial("light_variants", LightConfig(procedural=0, variants=200))


def _light_trial(name: str, light: LightConfig) -> RunConfig:
    return replace(paper(), name=name, steps=600, warmup=50, light=light)


RUNS = {
    run.__name__: run
    for run in (
        paper,
        lift,
        normals,
        shapes_trial,
        lift_trial,
        code_trial,
        anchors_trial,
        still_trial,
        designs,
        light_real,
        light_own,
        light_both,
        light_variants,
    )
}


def smoke(config: RunConfig, steps: int = 20) -> RunConfig:
    """The same run made small: a dry run for any machine."""
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
