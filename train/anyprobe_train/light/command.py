"""anyprobe-train run light: from maps and shapes to the trained light network."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from anyprobe.errors import InputError

if TYPE_CHECKING:
    from anyprobe_train.world.batch import LightBatch

SMALL_BATCH, FEW_VIEWS = 8, 2
"""Photos a step of a run that tests a machine, and files of views that it draws from."""


def train_light(
    data: Path | None,
    runs: Path,
    steps: int | None,
    dry_run: int | None,
    device: str,
    processes: int,
    start: Path | None,
) -> Path:
    """Train the light network; the checkpoint's path.

    dry_run: so many steps of SMALL_BATCH photos in a run of their own that begins anew. processes: how many make photos
    while this one learns. start: weights to go on from.

    Raises:
        InputError: no data, or a device that is not there.
    """
    import torch

    from anyprobe_train.light.left_out_light import left_out_scores
    from anyprobe_train.light.light_run import LightRunConfig, run_light
    from anyprobe_train.light.traced import SHARE, traced_photos, with_traced
    from anyprobe_train.world.batch import World, assets_of
    from anyprobe_train.world.feed import feed

    known = ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",)
    if device not in known:
        raise InputError(f"expected one of {', '.join(known)}", subject="device", source=device)
    if data is None or not all((data / name).is_dir() for name in ("hdri", "meshes")):
        text = "expected --data with hdri and meshes, got none; fetch them with anyprobe-train data"
        raise InputError(text, source=data)
    config, settings = LightRunConfig(), {}
    if steps is not None:
        config = replace(config, steps=steps)
    if dry_run is not None:
        config = replace(config, name="light-dry", steps=dry_run, batch=SMALL_BATCH)
        settings = {"first": FEW_VIEWS}
        (runs / config.name / "checkpoint.pt").unlink(missing_ok=True)
    cache = runs / "world"
    traced = traced_photos(runs / "traced")
    assets = assets_of(World.open(data, cache))
    assets += "" if traced is None else f", {len(traced.family)} path-traced photos"

    def batches(first: int) -> Iterator[LightBatch]:
        made = config.batch if traced is None else round((1 - SHARE) * config.batch)
        given = {"batch": made, **settings}
        photos = feed(data, cache, config.seed, workers=max(1, processes), step=first, **given)
        for step, batch in enumerate(photos, first):
            yield with_traced(batch, traced, config.batch, (config.seed, step))

    scored = None if dry_run is not None else left_out_scores(runs / "left_out", data, cache)
    return run_light(config, batches=batches, runs=runs, assets=assets, device=device, scored=scored, start=start)
