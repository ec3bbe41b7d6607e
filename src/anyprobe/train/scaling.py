"""Scaling (noun): the same tiny designs after 64,000 and 640,000 pairs, so that it can be told what pairs change.

Each run has a whole schedule of its own. `world_*` has cameras and materials as they come, `laboratory_*` one camera
and eight materials (dataset.laboratory); photos are clean and masks exact in both.
"""

from __future__ import annotations

from dataclasses import replace

from anyprobe.train.config import RunConfig, designs


def world_64k() -> RunConfig:
    """64,000 pairs."""
    return _tiny("world_64k", 1_000)


def world_640k() -> RunConfig:
    """640,000 pairs."""
    return _tiny("world_640k", 10_000)


def laboratory_64k() -> RunConfig:
    """64,000 pairs."""
    return _tiny("laboratory_64k", 1_000, laboratory=True)


def laboratory_640k() -> RunConfig:
    """640,000 pairs."""
    return _tiny("laboratory_640k", 10_000, laboratory=True)


def world_64k_fixed() -> RunConfig:
    """As `world_64k` but for its end, which is as the paper has it: a learning rate that stays, once it has risen, and
    maps that sharpen to the last step."""
    return _fixed(world_64k())


def world_64k_fixed_again() -> RunConfig:
    """The same on other pairs: where the learning rate stays, where a run ends is a matter of chance."""
    return _again(world_64k_fixed())


def laboratory_64k_fixed() -> RunConfig:
    """`laboratory_64k` with the end of `world_64k_fixed`."""
    return _fixed(laboratory_64k())


def laboratory_64k_fixed_again() -> RunConfig:
    """The same on other pairs."""
    return _again(laboratory_64k_fixed())


SCALING = (
    world_64k,
    world_640k,
    world_64k_fixed,
    world_64k_fixed_again,
    laboratory_64k,
    laboratory_640k,
    laboratory_64k_fixed,
    laboratory_64k_fixed_again,
)


def _fixed(run: RunConfig) -> RunConfig:
    return replace(run, name=f"{run.name}_fixed", cooldown=0.0, gradual_share=1.0)


def _again(run: RunConfig) -> RunConfig:
    return replace(run, name=f"{run.name}_again", pairs=replace(run.pairs, seed=run.pairs.seed + 1))


def _tiny(name: str, steps: int, laboratory: bool = False) -> RunConfig:
    pairs = replace(
        designs().pairs, batch=64, seed=53, reuse=24, conditions=0, laboratory=laboratory, every=4
    )
    return replace(designs(), name=name, model="tiny_designs", steps=steps, pairs=pairs)
