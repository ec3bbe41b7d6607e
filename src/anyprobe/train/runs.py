"""Every named run, and any of them made small."""

from __future__ import annotations

from dataclasses import replace

from anyprobe.train.config import RunConfig, designs, designs_laboratory, hdr_curves, lift, normals, paper
from anyprobe.train.scaling import SCALING
from anyprobe.train.trials import TRIALS, shapes_trial

RUNS = {
    run.__name__: run
    for run in (
        paper,
        lift,
        normals,
        designs,
        designs_laboratory,
        hdr_curves,
        *TRIALS,
        shapes_trial,
        *SCALING,
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
