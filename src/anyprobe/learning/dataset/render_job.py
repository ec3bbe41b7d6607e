"""A rendered dataset: dataset.json, its shards, and the rendering of missing shards."""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe import __version__
from anyprobe.errors import InputError, OutputError
from anyprobe.files.atomic import held
from anyprobe.learning.dataset import shards
from anyprobe.learning.dataset.asset_store import PROCEDURAL_VERSION
from anyprobe.learning.dataset.process_pools import run_local
from anyprobe.learning.dataset.recipe import RECIPE_VERSION
from anyprobe.learning.dataset.samples import CONDITIONS, DATASET_FORMAT, StoreRenderer, decode_part, same


def render_again(job: RenderJob, task: tuple[int, tuple[int, ...]], report: Callable[[int], None]) -> str:
    """Render pairs of a shard again, by number in the dataset; return what differs, empty if nothing."""
    shard, numbers = task
    renderer = _renderer(job)
    stored = dict(shards.read_samples(shards.tar_path(job.folder, shard)))
    for count, number in enumerate(numbers, 1):
        sample = renderer.sample(renderer.recipe(number))
        if sample.key not in stored:
            return f"pair {number} ({sample.key}) is not in it"
        for name, data in sample.parts.items():
            old = stored[sample.key].get(name, b"")
            if not same(name, old, data):
                return f"{sample.key}.{name} differs when rendered again{_first_difference(name, old, data)}"
        report(count)
    return ""


def _first_difference(name: str, old: bytes, new: bytes) -> str:
    if name != "json":
        return ""
    a, b = decode_part(name, old), decode_part(name, new)
    keys = [key for key in {**a, **b} if a.get(key) != b.get(key)]
    return f" ({', '.join(keys[:3])})"


def differing_pairs(
    folder: Path,
    data: Path | None,
    make: Make,
    shards_to_check: Sequence[int],
    count: int,
    *,
    workers: int,
    log: Callable[[str], None],
) -> dict[int, str]:
    """Render `count` random pairs of some shards again; return what differs, by shard."""
    job = _job(folder, data, make)
    tasks = choose_pairs(job.plan, shards_to_check, count)
    results = run_local(partial(render_again, job), tasks, lambda task, n: None, workers=workers, log=log)
    return {shard: difference for (shard, _), difference in results.items() if difference}


def choose_pairs(plan: Mapping, shards: Sequence[int], count: int) -> list[tuple[int, tuple[int, ...]]]:
    """Choose `count` random pairs of some shards, or all if there are fewer: (shard, numbers of its pairs)."""
    numbers = [number for shard in shards for number in shard_range(plan, shard)]
    chosen = sorted(np.random.default_rng().permutation(numbers)[:count].tolist())
    return [(shard, tuple(group)) for shard, group in groupby(chosen, lambda number: number // plan["shard_size"])]


NAME = "dataset.json"
SETTINGS: dict[str, Any] = {
    "kind": "object",
    "split": "train",
    "conditions": "clean",
    "seed": 2020,
    "pairs": None,
    "shard_size": 500,
    "procedural_maps": 0,
    "procedural_shapes": 0,
    "commercial_only": False,
}
"""Settings of a dataset and their defaults; pairs None means all."""

WORDS = {"kind": ("object", "map"), "split": ("train", "test"), "conditions": CONDITIONS}
"""Allowed values of the settings that are words."""

PROCEDURAL = 32
"""Number of procedural maps, and of shapes, without a folder of assets."""

BYTES_PER_PAIR = {"object": 45_000, "map": 60_000}
"""Expected size of a pair by kind [bytes], until a shard is there to measure."""

Make = Callable[..., StoreRenderer]
"""A function make(settings, data) that opens the renderer; importable by name, as workers call it too."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RenderJob:
    """One dataset: its folder, how to open its renderer, and its folder of assets."""

    folder: Path
    data: Path | None
    make: Make

    @property
    def plan(self) -> dict:
        """Content of dataset.json."""
        return read_plan(self.folder)

    def missing(self) -> list[int]:
        """Return the shards that are absent, or not of the size that their index states."""
        return [shard for shard in range(num_shards(self.plan)) if not shards.is_done(self.folder, shard)]


def _job(folder: Path, data: Path | None, make: Make) -> RenderJob:
    data = None if data is None else Path(os.path.abspath(data))
    return RenderJob(folder=Path(os.path.abspath(folder)), data=data, make=make)


@lru_cache(maxsize=1)
def _renderer(job: RenderJob) -> StoreRenderer:
    """Return the renderer, opened once per process; InputError if its assets are not the dataset's."""
    # what is left out of a folder of assets was reported when the dataset was started
    return _open(job, job.plan, report=lambda line: None)


def _open(job: RenderJob, plan: Mapping, **options) -> StoreRenderer:
    """Open the renderer of a plan; InputError if it is not over the plan's assets."""
    if job.data is None and plan["procedural_maps"] < len(plan["maps"]):
        raise InputError("expected the folder of assets that the dataset was started with, got none", subject="data")
    renderer = job.make({name: plan[name] for name in SETTINGS}, job.data, **options)
    _same_assets(job.folder, plan, renderer)
    return renderer


def num_shards(plan: Mapping) -> int:
    """Return the number of shards of a plan."""
    return -(-plan["pairs"] // plan["shard_size"])


def shard_range(plan: Mapping, shard: int) -> range:
    """Return the recipe numbers of a shard."""
    return range(shard * plan["shard_size"], min((shard + 1) * plan["shard_size"], plan["pairs"]))


def read_plan(folder: Path) -> dict:
    """Read dataset.json of a folder; InputError if it is absent or damaged."""
    path = folder / NAME
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
        if plan["format"] != DATASET_FORMAT:
            raise InputError(
                f"expected format {DATASET_FORMAT}, got {plan['format']}; use another version", source=path
            )
        _check_plan(plan)
    except FileNotFoundError as error:
        raise InputError(
            f"expected a rendered dataset, got a folder without {NAME}; check the path", source=folder
        ) from error
    except (OSError, ValueError, TypeError, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"expected the plan of a dataset, got a damaged file ({error})", source=path) from error
    return plan


def _check_plan(plan: Mapping) -> None:
    """Raise ValueError, KeyError or TypeError if a plan lacks anything that is read later."""
    for name, default in SETTINGS.items():
        expected = int if default is None else type(default)
        if type(plan[name]) is not expected or plan[name] not in WORDS.get(name, (plan[name],)):
            raise ValueError(f"{name.replace('_', ' ')} {plan[name]!r}")
    if min(plan["pairs"], plan["shard_size"]) < 1:
        raise ValueError(f"{plan['pairs']} pairs, {plan['shard_size']} a shard")
    for asset in (*plan["maps"], *plan["shapes"]):
        if not {"id", "name"} <= set(asset):
            raise ValueError(f"the asset {asset!r}")


def begin(
    folder: Path, chosen: Mapping[str, object], data: Path | None, make: Make, *, resume: bool, **options
) -> RenderJob:
    """Write dataset.json of a new dataset, or check that an old one can be continued.

    chosen: the settings that the caller gave; others are the old dataset's, or as in SETTINGS.
    options go to make in this process.

    Raises:
        InputError: something lies in the folder, or the dataset was made by other settings or assets.
    """
    job = _job(folder, data, make)
    folder, data = job.folder, job.data
    if resume:
        old = read_plan(folder)
        for name, value in chosen.items():
            if old[name] != value:
                raise InputError(
                    f"--resume expected {name.replace('_', ' ')} {old[name]}, as the dataset was "
                    f"started, got {value}; give the same or another folder",
                    source=folder.name,
                )
        check_versions(folder, old)
        _open(job, old, **options)
        return job
    _refuse_occupied(folder)
    procedural = {} if data is not None else {"procedural_maps": PROCEDURAL, "procedural_shapes": PROCEDURAL}
    if chosen.get("kind") == "map":
        procedural["procedural_shapes"] = 0
    settings = {**SETTINGS, **procedural, **chosen}
    renderer = make(settings, data, **options)
    pairs = renderer.count if settings["pairs"] is None else settings["pairs"]
    if not 1 <= pairs <= renderer.count:
        raise InputError(
            f"expected 1 to {renderer.count}, all pairs of {len(renderer.maps)} maps and "
            f"{len(renderer.shapes)} shapes, got {pairs}",
            subject="pairs",
        )
    plan = {**_versions(), **settings, "pairs": pairs, "maps": renderer.maps, "shapes": renderer.shapes}
    # loading the assets took a while: another process may have started a dataset here
    shards.write_durably(folder / NAME, json.dumps(plan, indent=1) + "\n", new=True)
    return job


def _versions() -> dict[str, object]:
    """Return the versions that change the pairs of the same settings."""
    return {
        "format": DATASET_FORMAT,
        "anyprobe_version": __version__,
        "recipe_version": RECIPE_VERSION,
        "procedural_version": PROCEDURAL_VERSION,
    }


def check_versions(folder: Path, plan: Mapping) -> None:
    """Raise InputError if the dataset is of another release, whose pairs differ for the same settings."""
    for name, value in _versions().items():
        if plan.get(name) != value:
            raise InputError(
                f"expected {name.replace('_', ' ')} {plan.get(name)}, as the dataset was started, "
                f"got {value}; use that release, or another folder",
                source=folder,
            )


def _same_assets(folder: Path, plan: Mapping, renderer: StoreRenderer) -> None:
    for kind, entries in (("map", renderer.maps), ("shape", renderer.shapes)):
        names = {entry["id"]: entry["name"] for entry in plan[f"{kind}s"]}
        got = {entry["id"]: entry["name"] for entry in entries}
        for key in sorted(names.keys() ^ got.keys()):
            name = names.get(key) or got[key]
            expected, found = (f"{kind} {key} ({name})", "none") if key in names else (f"no {kind} {key}", name)
            raise InputError(
                f"expected {expected}, as the dataset was started, got {found}; give the same assets or another folder",
                source=folder.name,
            )


def _refuse_occupied(folder: Path) -> None:
    if not folder.exists():
        return
    if (folder / NAME).exists():
        raise InputError(
            "expected a new folder, got a dataset; continue it with --resume, or choose another", source=folder
        )
    if not folder.is_dir():
        raise InputError("expected a new folder, got a file; choose another", source=folder)
    if any(path for path in folder.iterdir() if not shards.is_temporary(path)):
        raise InputError("expected a new or empty folder, got one with files; choose another", source=folder)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a dataset against a second writer, until the block or the process ends."""
    with held(folder / NAME, wait=False) as alone:
        if not alone:
            raise InputError(
                "expected one writer, but another process renders into it; wait for its end", source=folder.name
            )
        yield


def check_space(job: RenderJob, missing: Sequence[int]) -> int:
    """Return the bytes that the missing shards will need, judged by those present; OutputError if they do not fit."""
    plan = job.plan
    done = [shard for shard in range(num_shards(plan)) if shard not in set(missing)][:20]
    pair_bytes = float(BYTES_PER_PAIR[plan["kind"]])
    if done:
        paths = [shards.tar_path(job.folder, shard) for shard in done]
        pair_bytes = sum(p.stat().st_size for p in paths) / sum(len(shard_range(plan, s)) for s in done)
    needed = int(pair_bytes * sum(len(shard_range(plan, shard)) for shard in missing))
    free = shutil.disk_usage(job.folder).free
    if needed > free:
        raise OutputError(
            f"expected {needed / 1e9:.1f} GB of free space for {len(missing)} shards, "
            f"got {free / 1e9:.1f}; free some space, or ask for fewer --pairs in another folder",
            source=job.folder,
        )
    return needed


def render_shard(job: RenderJob, shard: int, report: Callable[[int], None]) -> None:
    """Render one shard; report(n) after each pair. Any process on any machine may call this."""
    renderer = _renderer(job)

    def samples():
        for count, index in enumerate(shard_range(job.plan, shard), 1):
            yield renderer.sample(renderer.recipe(index))
            report(count)

    shards.write_shard(job.folder, shard, samples())


def render_missing(job: RenderJob, engine: Callable, watch: Callable[[int, int], None]) -> None:
    """Render the missing shards with engine(work, tasks, watch): run_local or run_ray of process_pools.

    watch(shard, pairs done in it) reports the progress.
    """
    with locked(job.folder):
        shards.remove_temporaries(job.folder)
        missing = job.missing()
        check_space(job, missing)
        try:
            engine(partial(render_shard, job), missing, watch)
        finally:
            with suppress(OSError):
                shards.remove_temporaries(job.folder)
        left = job.missing()
    if left:
        raise OutputError(
            f"expected shard {left[0]} here after it was rendered, found none; "
            "every machine must see the folder under this path",
            source=job.folder,
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Status:
    """Progress of a dataset."""

    shards: int
    shards_done: int
    pairs: int
    pairs_done: int
    bytes: int
    groups: dict[str, int]
    missing: list[int]


def job_status(folder: Path) -> Status:
    """Count the finished shards and pairs, by their indices."""
    plan, pairs, size = read_plan(folder), 0, 0
    groups: Counter[str] = Counter()
    missing: list[int] = []
    for shard in range(num_shards(plan)):
        if not shards.is_done(folder, shard):
            missing.append(shard)
            continue
        index = shards.read_index(folder, shard)
        groups.update(index.groups)
        pairs, size = pairs + index.pairs, size + index.size
    return Status(
        shards=num_shards(plan),
        shards_done=num_shards(plan) - len(missing),
        pairs=plan["pairs"],
        pairs_done=pairs,
        bytes=size,
        groups=dict(groups),
        missing=missing,
    )
