"""anyprobe-train data polyhaven: free maps and models for training from their publisher.

anyprobe-train data test DIR: the files of the frozen test set, each from its own source."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn
from rich.table import Table

from anyprobe.cli.app import new_app, print_table
from anyprobe.cli.options import bounded
from anyprobe.errors import InputError
from anyprobe_train.assets import frozen_set, polyhaven
from anyprobe_train.assets.download import PAUSE_S, Client, ServerBusy

STATUSES = ("fetched", "complete", "kept", "failed", "not tried")

app = new_app("Download maps and shapes.", name="data")


@app.command(name="polyhaven")
def fetch(
    *,
    kind: Annotated[Literal["hdris", "models", "all"], Parameter(name="--type", help="Maps, models or both.")] = "all",
    category: Annotated[
        list[str] | None, Parameter(help="Only assets in this category; several times: in all of them.")
    ] = None,
    limit: Annotated[int, Parameter(metavar="N", help="Assets of each type; 0 for all."), bounded(0)] = 100,
    resolution: Annotated[str, Parameter(help="Width of the maps; training averages them to 512.")] = "1k",
    map_format: Annotated[Literal["hdr", "exr"], Parameter(name="--format", help="Format of the maps.")] = "hdr",
    to: Annotated[
        Path, Parameter(metavar="DIR", help="Folder for hdri/ and meshes/, as train --data reads it.")
    ] = Path("data"),
    split: Annotated[float, Parameter(help="Share of assets held out, in test/."), bounded(0, 1)] = 0.1,
    pause: Annotated[float, Parameter(help="Seconds between two requests."), bounded(0)] = 0.5,
    dry_run: Annotated[bool, Parameter(name="--dry-run", help="List the assets, fetch nothing.")] = False,
    api: Annotated[str | None, Parameter(help="Another address of the API.", show=False)] = None,
) -> None:
    """Fetch CC0 maps and models of polyhaven.com; run again to go on, what is complete is not asked for twice."""
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)
    description = TextColumn("{task.description}", markup=False)
    columns = (description, BarColumn(), DownloadColumn(), TransferSpeedColumn())
    with Progress(*columns, console=talk, transient=True, disable=not talk.is_terminal) as progress:
        client = Client(pause_s=pause, say=lambda text: progress.console.print(text, soft_wrap=True))
        api = api or polyhaven.API
        kinds = [one for one in polyhaven.FOLDERS if kind in (one, "all")]
        chosen: list[polyhaven.Asset] = []
        for one in kinds:
            listed = polyhaven.list_assets(client, one, api)
            try:
                matching = polyhaven.choose(listed, category or ())
            except InputError:
                if len(kinds) == 1 or (one == kinds[-1] and not chosen):
                    raise
                continue  # a category of maps only, or of models only
            chosen += matching[: limit or None]
            more = "" if len(matching) <= (limit or len(matching)) else "; --limit 0 for all"
            talk.print(f"{one}: {min(limit or len(matching), len(matching))} of {len(matching)}{more}")
        if dry_run:
            _list(chosen, split)
            return
        library = polyhaven.Library(to, client, api=api, resolution=resolution, map_format=map_format, test_share=split)
        outcomes, stopped = _fetch_all(library, chosen, progress)
    _report(outcomes, chosen, talk, to)
    for one in outcomes:
        if one.status == "failed":
            talk.print(f"anyprobe: {one.asset.slug}: {' '.join(one.error.splitlines())}", soft_wrap=True)
    if stopped:
        talk.print(f"anyprobe: {stopped}", soft_wrap=True)
    if stopped or any(one.status == "failed" for one in outcomes):
        sys.exit(2)


@app.command(name="test")
def fetch_test(
    to: Annotated[Path, Parameter(name="DIR", help="Folder for hdri/test and meshes/test.")],
    /,
    *,
    pause: Annotated[float, Parameter(help="Seconds between two requests."), bounded(0)] = PAUSE_S,
    host: Annotated[str, Parameter(help="Another address of the sources.", show=False)] = frozen_set.HOST,
) -> None:
    """Fetch what can be had of the frozen test set's maps and shapes; run again to go on."""
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)
    client = Client(pause_s=pause, say=lambda text: talk.print(text, soft_wrap=True))
    counts: Counter[str] = Counter()
    try:
        for one in frozen_set.fetch_all(frozen_set.frozen_files(), to, client, host):
            counts[one.status] += 1
            reason = f": {' '.join(one.error.splitlines())}" if one.error else ""
            if one.status == "cannot be had":
                reason = f": prepared by software that was not recorded, from {one.file_row.source}"
            talk.print(f"{one.file_row.file}: {one.status}{reason}", soft_wrap=True)
    except ServerBusy as error:
        talk.print(f"anyprobe: {error}", soft_wrap=True)
        sys.exit(2)
    talk.print(", ".join(f"{count} {status}" for status, count in counts.items()), soft_wrap=True)
    if counts["failed"]:
        sys.exit(2)
    print(to / frozen_set.RECIPES)


def _fetch_all(library: polyhaven.Library, chosen: list, progress: Progress) -> tuple[list, str]:
    """Every asset in turn; what happened to each, and why it stopped before the end, if it did."""
    outcomes: list[polyhaven.Outcome] = []
    for index, asset in enumerate(chosen, 1):
        place = f"{index}/{len(chosen)} {asset.slug}"
        task = progress.add_task(place, total=None)

        def watch(done: int, total: int | None, task=task) -> None:
            progress.update(task, completed=done, total=total)

        try:
            outcome = library.fetch(asset, watch)
        except ServerBusy as error:
            return outcomes, str(error)
        finally:
            progress.remove_task(task)
        outcomes.append(outcome)
        if progress.disable:
            progress.console.print(f"{place}: {outcome.status}", soft_wrap=True)
    return outcomes, ""


def _list(chosen: list, share: float) -> None:
    table = Table("asset", "type", "split", "category", "authors", box=None, pad_edge=False)
    for asset in chosen:
        table.add_row(asset.slug, asset.kind, polyhaven.split_of(asset.slug, share), asset.category, asset.authors)
    show = Console(markup=False, emoji=False, highlight=False)
    print_table(show, table)
    show.print(f"Nothing fetched. Powered by Poly Haven, {polyhaven.LICENCE}", soft_wrap=True)


def _report(outcomes: list, chosen: list, talk: Console, to: Path) -> None:
    """Print counts by type and split, and where the licences are written."""
    rows = [(one.asset.kind, one.split, one.status, one.num_bytes) for one in outcomes]
    rows += [(one.kind, "", "not tried", 0) for one in chosen[len(outcomes) :]]
    counts = Counter((kind, split, status) for kind, split, status, _ in rows)
    shown = [status for status in STATUSES if any(status == one[2] for one in rows)]
    table = Table("type", "split", *shown, "MB received", box=None, pad_edge=False)
    for kind, split in dict.fromkeys(sorted((one[0], one[1]) for one in rows)):
        received = sum(one[3] for one in rows if one[:2] == (kind, split)) / 1e6
        table.add_row(kind, split, *(str(counts[kind, split, status]) for status in shown), f"{received:.1f}")
    print_table(talk, table)
    kinds = dict.fromkeys(kind for kind, *_ in rows)
    manifests = ", ".join(str(to / polyhaven.FOLDERS[kind] / "manifest.csv") for kind in kinds)
    talk.print(f"Powered by Poly Haven (https://polyhaven.com), CC0; authors: {manifests}", soft_wrap=True)
