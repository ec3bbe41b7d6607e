"""anyprobe data render, status and verify: the dataset as shards on disk."""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.cli.options import with_bundles
from anyprobe.notices import give

data = typer.Typer(help="Render and check training pairs on disk.", no_args_is_help=True, rich_markup_mode=None)

Conditions = Literal["clean", "world"]
"""Conditions of photos: clean as in the paper, or as phones take them; see dataset.samples.CONDITIONS."""

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the dataset.")]
Assets = Annotated[
    Path | None, typer.Option(metavar="FOLDER", help="Folder with hdri/ and meshes/; default: procedural assets.")
]


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanOptions:
    """Settings of a new dataset (dataset.render_job.SETTINGS); None stands for the old dataset's, or the default."""

    split: Annotated[Literal["train", "test"] | None, typer.Option(help="Assets to use; default: train.")] = None
    kind: Annotated[
        Literal["object", "map"] | None, typer.Option(help="Pairs of objects (default), or maps for the HDR network.")
    ] = None
    conditions: Annotated[
        Conditions | None, typer.Option(help="clean (default), or world: as phones take them, see docs/how-to/data.md.")
    ] = None
    pairs: Annotated[int | None, typer.Option(min=1, metavar="N", help="Render the first N; default: all.")] = None
    shard_size: Annotated[int | None, typer.Option(min=1, metavar="N", help="Pairs per shard; default: 500.")] = None
    seed: Annotated[int | None, typer.Option(min=0, help="Random seed of the plan; default: 2020.")] = None
    procedural_maps: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Procedural maps; default: 32 without --data, 0 with it.")
    ] = None
    procedural_shapes: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Procedural shapes; default: 32 without --data, 0 with it.")
    ] = None
    commercial_only: Annotated[
        bool,
        typer.Option(
            "--commercial-only",
            help="Leave out assets whose licence in manifest.csv forbids commercial use or is unknown.",
        ),
    ] = False


@data.command()
@with_bundles
def render(
    folder: Folder,
    plan: PlanOptions,
    data: Assets = None,
    workers: Annotated[int, typer.Option(min=1, metavar="N", help="Processes on this machine.")] = 2,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a dataset; settings not given are taken from it.")
    ] = False,
    engine: Annotated[
        Literal["local", "ray"], typer.Option(help="local: processes on this machine; ray: a Ray cluster.")
    ] = "local",
    address: Annotated[str | None, typer.Option(help="Address of the Ray cluster; default: a new one here.")] = None,
) -> None:
    """Render training pairs into shards. WebDataset can read them; finished ones are kept whatever happens."""
    from anyprobe.errors import InputError
    from anyprobe.learning.dataset import render_job

    if address is not None and engine != "ray":
        raise InputError("expected a Ray cluster, got the local engine", subject="address", remedy=give(engine="ray"))
    settings = {name: value for name, value in asdict(plan).items() if value is not None and value is not False}
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    report = partial(console.print, soft_wrap=True)
    job = render_job.begin(folder, settings, data, _make(), resume=resume, report=report)
    before = render_job.job_status(job.folder)
    report(f"{folder}: {before.pairs} pairs in {before.shards} shards, {before.shards_done} of them done")
    start = time.monotonic()
    try:
        with _progress(console) as progress:
            watch = _Watch(progress, before)
            run = _engine(engine, address, workers, partial(progress.console.print, soft_wrap=True), job)
            render_job.render_missing(job, run, watch)
    except KeyboardInterrupt:
        current = render_job.job_status(job.folder)
        assets = "" if data is None else f" --data {shlex.quote(str(data))}"
        report(
            f"anyprobe: stopped with {current.shards_done} of {current.shards} shards done; resume with "
            f"anyprobe data render {shlex.quote(str(folder))}{assets} --resume"
        )
        raise
    seconds = time.monotonic() - start
    current = render_job.job_status(job.folder)
    num_rendered = current.pairs_done - before.pairs_done
    report(
        f"{folder}: complete, {current.bytes / 1e6:.1f} MB; {num_rendered} pairs in {_clock(seconds)}, "
        f"{num_rendered / max(seconds, 1e-9):.1f} a second"
    )


def _make() -> Callable:
    from anyprobe.learning.dataset.samples import StoreRenderer

    return StoreRenderer


def _engine(engine: str, address: str | None, workers: int, report: Callable, job) -> Callable:
    from anyprobe.learning.dataset import process_pools, shards

    if engine == "local":
        return partial(process_pools.run_local, workers=workers, log=report)
    return partial(
        process_pools.run_ray,
        address=address,
        workers=workers,
        log=report,
        finished=lambda shard: shards.read_index(job.folder, shard).pairs,
    )


def _clock(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
        speed_estimate_period=120,
    )


class _Watch:
    """Progress over all shards: a bar, or one line a minute where there is no terminal."""

    LINE_S = 60

    def __init__(self, progress: Progress, done) -> None:
        self.progress, self.total = progress, done.pairs
        self.before = self.now = done.pairs_done
        self.start = self.last_line = time.monotonic()
        self.counts: dict[int, int] = {}
        self.task = progress.add_task("rendering", total=done.pairs, completed=done.pairs_done, rate="")

    def __call__(self, shard: int, count: int) -> None:
        self.now += count - self.counts.get(shard, 0)
        self.counts[shard] = count
        now = time.monotonic()
        rate = (self.now - self.before) / max(now - self.start, 1e-9)
        self.progress.update(self.task, completed=self.now, rate=f"{rate:.1f} pairs/s")
        if self.progress.disable and now - self.last_line >= self.LINE_S and rate > 0:
            self.last_line = now
            left = _clock((self.total - self.now) / rate)
            self.progress.console.print(f"{self.now}/{self.total} pairs, {rate:.1f} pairs/s, {left} left")


@data.command()
def status(
    folder: Folder, as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False
) -> None:
    """Print how much of a dataset is rendered. Lists shards, pairs, bytes, and what is missing."""
    from anyprobe.learning.dataset import render_job

    progress = render_job.job_status(folder)
    if as_json:
        typer.echo(json.dumps(asdict(progress)))
        return
    typer.echo(f"shards {progress.shards_done} of {progress.shards}")
    typer.echo(f"pairs {progress.pairs_done} of {progress.pairs}, {progress.bytes / 1e6:.1f} MB")
    for names in (("specular", "diffuse"), ("indoor", "outdoor")):
        if any(name in progress.groups for name in names):
            typer.echo(", ".join(f"{name} {progress.groups.get(name, 0)}" for name in names))
    if progress.missing:
        typer.echo(
            f"missing shards {_ranges(progress.missing)}; render them with anyprobe data render {folder} --resume"
        )


def _ranges(numbers: list[int]) -> str:
    """Format sorted numbers as ranges: 1, 2, 3, 7 as "1-3, 7"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


@data.command()
def verify(
    folder: Folder,
    again: Annotated[int, typer.Option("--render", min=0, metavar="N", help="Also render N random pairs again.")] = 0,
    data: Assets = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="Delete bad shards; render --resume makes them again.")
    ] = False,
    workers: Annotated[int, typer.Option(min=1, metavar="N", help="Processes for --render.")] = 2,
) -> None:
    """Check every shard. Compares SHA-256, members, offsets and images, and with --render pairs rendered again."""
    from anyprobe.learning.dataset import render_job, shards

    plan = render_job.read_plan(folder)
    render_job.check_versions(folder, plan)  # another release's shards are no damaged ones
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    bad, present = {}, []
    with _progress(console) as progress:
        task = progress.add_task("verifying", total=render_job.num_shards(plan), rate="")
        for shard in progress.track(range(render_job.num_shards(plan)), task_id=task):
            if not shards.index_path(folder, shard).exists():
                continue
            present.append(shard)
            fault = shards.fault(folder, shard, plan["kind"], len(render_job.shard_range(plan, shard)))
            if fault:
                bad[shard] = fault
    if again:
        intact = [shard for shard in present if shard not in bad]
        bad |= render_job.differing_pairs(folder, data, _make(), intact, again, workers=workers, log=console.print)
    for shard, fault in sorted(bad.items()):
        typer.echo(f"{shards.tar_path(folder, shard).name}: {fault}")
        if repair:
            shards.remove_shard(folder, shard)
    num_missing = render_job.num_shards(plan) - len(present)
    typer.echo(f"{len(present) - len(bad)} shards good, {len(bad)} bad, {num_missing} not rendered yet")
    if bad:
        action = "deleted" if repair else "delete them, or pass --repair"
        typer.echo(f"bad shards: {action}; then anyprobe data render {folder} --resume renders them again")
        raise typer.Exit(2)
