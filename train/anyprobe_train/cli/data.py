"""anyprobe-train data polyhaven: free maps and models for training from their publisher.

anyprobe-train data test DIR: the files of the frozen test set, each from its own source."""

import sys
from collections import Counter
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from anyprobe.cli.app import new_app
from anyprobe.cli.options import bounded
from anyprobe.errors import AnyprobeError, InputError
from anyprobe_train.assets import frozen_set, polyhaven
from anyprobe_train.assets.download import PAUSE_S, Client, Fetch, ServerBusy

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
    client = Client(pause_s=pause, say=lambda text: talk.print(text, soft_wrap=True))
    api = api or polyhaven.API
    kinds = [one for one in polyhaven.FOLDERS if kind in (one, "all")]
    chosen: list[polyhaven.Asset] = []
    words: Counter[str] = Counter()
    for one in kinds:
        listed = polyhaven.list_assets(client, one, api)
        words.update(word for asset in listed for word in asset.words)
        matching = polyhaven.choose(listed, category or ())
        some = matching[: limit or None]
        chosen += some
        more = "; --limit 0 for all" if len(some) < len(matching) else ""
        talk.print(f"{one}: {len(some)} of {len(matching)}{more}")
    if not chosen:
        known = ", ".join(word for word, _ in words.most_common(20))
        text = f"nothing is in all of: {', '.join(category or ())}; the largest are {known}"
        raise InputError(text, subject="category")
    if dry_run:
        for asset in chosen:
            part = polyhaven.split_of(asset.slug, split)
            print(asset.slug, asset.kind, part, asset.category, asset.authors, sep=" | ")
        print(f"Nothing fetched. Powered by Poly Haven, {polyhaven.LICENCE}")
        return
    library = polyhaven.Library(to, client, api=api, resolution=resolution, map_format=map_format, test_share=split)
    is_whole = _report(((one.slug, partial(library.fetch, one)) for one in chosen), len(chosen), talk)
    manifests = ", ".join(str(to / polyhaven.FOLDERS[one] / "manifest.csv") for one in kinds)
    talk.print(f"Powered by Poly Haven (https://polyhaven.com), CC0; authors: {manifests}", soft_wrap=True)
    if not is_whole:
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
    files = frozen_set.frozen_files()
    if not _report(frozen_set.fetch_all(files, to, client, host), len(files), talk):
        sys.exit(2)
    print(to / frozen_set.RECIPES)


def _report(files: Iterable[Fetch], count: int, talk: Console) -> bool:
    """Fetch so many files, say what becomes of each, and in the end of all; return whether none failed or was left."""
    counts: Counter[str] = Counter()
    for number, (name, fetch) in enumerate(files, 1):
        try:
            outcome = fetch()
            counts[outcome.partition(":")[0]] += 1
            talk.print(f"{number}/{count} {name}: {outcome}", soft_wrap=True)
        except ServerBusy as error:
            talk.print(f"anyprobe: {error}", soft_wrap=True)
            counts["not tried"] = count - counts.total()
            break
        except AnyprobeError as error:
            counts["failed"] += 1
            talk.print(f"anyprobe: {name}: {' '.join(str(error).splitlines())}", soft_wrap=True)
    talk.print(", ".join(f"{some} {status}" for status, some in counts.items()), soft_wrap=True)
    return not counts["failed"] and "not tried" not in counts
