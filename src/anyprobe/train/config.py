"""Named runs: each is a function that returns the frozen configuration of one training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from anyprobe.dataset.pairs import PairConfig
from anyprobe.dataset.surfaces import SurfaceConfig
from anyprobe.train.gradual import GRADUAL_SHARE
from anyprobe.train.lift import LiftConfig


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
    """The training of one model on pairs made as it goes.

    name: of the run's folder.
    model: "paper", the chain of three networks, "lift", the one that lifts pixels to the map, "normals",
        the part of it that guesses normals, "designs", every design of the paper's Table 1 and two rivals
        at half size, "tiny_designs", some of them at a quarter, or "hdr", the designs' HDR network alone,
        which sees views of maps in the place of pairs;
        truth_share, gradual, gradual_share and hdr_share concern the first, lift the second, truth_share,
        gradual_share and hdr_share the designs.
    truth_share: share of a batch in which the illumination net sees the true irradiance,
        the rest sees the irradiance net's.
    gradual: whether the LDR targets sharpen as in Eq. 6; gradual_share: of the steps that this takes, the others
        after them see the maps themselves.
    irradiance_learns: whether the irradiance network of the designs, the shipped one at first, goes on learning
        beside them; else it stays as it is.
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
    irradiance_learns: bool = False
    hdr_share: float = 0.5
    gradual: bool = True
    gradual_share: float = GRADUAL_SHARE
    lift: LiftConfig = field(default_factory=LiftConfig)
    pairs: PairConfig = field(default_factory=PairConfig)
    surfaces: SurfaceConfig = field(default_factory=SurfaceConfig)
    light: LightConfig = field(default_factory=LightConfig)


def paper() -> RunConfig:
    """The paper's chain (Sect. 3.2-3.4). It trains its networks one after another; here one pass serves all."""
    return RunConfig(name="paper", steps=10_000, pairs=PairConfig(seed=11))


def lift() -> RunConfig:
    """The model that ships, as it goes on: lifts what each pixel shows to where its light came from.

    What ships has not learned with gathered surroundings and painted objects yet; its model card has its runs.
    """
    return RunConfig(
        name="lift",
        model="lift",
        steps=4_400,
        warmup=100,
        cooldown=0.8,
        lift=LiftConfig(normals=3.0),
        pairs=PairConfig(
            seed=101,
            cut_out=0.2,
            told=0.3,
            around=0.7,
            gathered=0.4,
            joined=0.3,
            reshaped=0.4,
            textured=0.15,
            two_materials=0.1,
        ),
        surfaces=SurfaceConfig(
            views=12,
            own_views=1,
            procedural=600,
            figures=1400,
            parts=800,
            stretch=0.2,
            tilt_deg=20.0,
            bend=0.4,
            relief=0.55,
            seed=21,
        ),
        light=LightConfig(procedural=200, variants=600, seed=18),
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
        surfaces=replace(lift().surfaces, parts=0),
        light=replace(lift().light, seed=12),
    )


def designs() -> RunConfig:
    """The paper's designs and two rivals, each on the same pairs, to be compared (docs/results.md)."""
    return RunConfig(
        name="designs",
        model="designs",
        steps=10_000,
        learning_rate=2e-3,
        warmup=100,
        cooldown=0.5,
        pairs=PairConfig(seed=43, batch=16),
        surfaces=lift().surfaces,
        light=replace(lift().light, seed=16),
    )


def designs_laboratory() -> RunConfig:
    """The same with one camera, exact masks and eight materials; the irradiance network learns these too."""
    return replace(
        designs(),
        name="designs_laboratory",
        steps=5_000,
        irradiance_learns=True,
        pairs=PairConfig(seed=47, batch=16, conditions=0, laboratory=True),
    )


def hdr_curves() -> RunConfig:
    """The HDR network of `designs` alone, as the paper trains it (Sect. 3.4-3.5): on true maps, which are those of
    `designs`, through cameras of random curve."""
    return replace(
        designs(),
        name="hdr_curves",
        model="hdr",
        steps=2_500,
        pairs=PairConfig(seed=61, batch=64, reuse=5, group=64, pool=4, conditions=0),
    )
