"""python -m research.masks: how well objects are found without a prompt, by a click and by a box, in photos and in
rendered scenes, by our network and by other segmenters, and which masks come with a warning."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.progress import track
from rich.table import Table

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.errors import InputError
from anyprobe.masks.networks import load_network
from research.masks.cases import Case, photo_cases
from research.masks.scoring import PROMPTS, Row, figures, score, warned
from research.masks.sheet import draw_sheet
from research.results import commit, write_result


def masks(
    *,
    photos: Annotated[
        list[Path] | None, Parameter(help="Folder of photos NAME.* with NAME_mask.png beside them; repeatable.")
    ] = None,
    data: Annotated[
        Path | None, Parameter(help="Folder with hdri/train and meshes/train, of whose left-out assets scenes are.")
    ] = None,
    scenes: Annotated[int, Parameter(help="Scenes to render."), bounded(1)] = 60,
    seed: Annotated[int, Parameter(help="Seed of the rendered scenes.")] = 7,
    segmenter: Annotated[
        list[str] | None, Parameter(help="Another network beside the default, as NAME:FILE; repeatable.")
    ] = None,
    before: Annotated[Path | None, Parameter(help="masks.json of an earlier version, shown beside.")] = None,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for masks.json and the contact sheets.")] = Path(
        "runs/masks"
    ),
) -> None:
    """Print IoU by object, its means and medians, and how many of the bad and good masks come with a warning."""
    sets: dict[str, list[Case]] = {folder.name: list(photo_cases(folder)) for folder in photos or []}
    if data is not None:
        from anyprobe_train.world.batch import World
        from research.masks.scenes import rendered_cases

        world = World.open(data, Path("runs/world"), "left-out")
        sets["scenes"] = list(rendered_cases(world, scenes, seed))
    if not any(sets.values()):
        raise InputError("research.masks: expected --photos DIR or --data DIR with something in it, got nothing")
    ways = {"anyprobe": None} | {name: load_network(name) for name in segmenter or []}
    rows: dict[str, list[Row]] = {}
    for group, cases in sets.items():
        rows[group] = []
        for case in track(cases, group, console=Console(stderr=True)):
            rows[group] += [score(case, prompt, name, way) for name, way in ways.items() for prompt in PROMPTS]
        draw_sheet(out / f"{group}.jpg", cases, [row for row in rows[group] if row.segmenter == "anyprobe"])
    stored = {group: [row.as_dict() for row in found] for group, found in rows.items()}
    write_result(out / "masks.json", {"commit": commit(), "seed": seed, "rows": stored})
    for group, found in rows.items():
        show(group, found, _earlier(before, group))
    if len(rows) > 1:
        show_totals("all sets", [row for found in rows.values() for row in found])
    print(out)


def show(group: str, rows: list[Row], earlier: dict[tuple[str, str], float]) -> None:
    """IoU by object and prompt, beside the earlier version's, then the figures of all, and the warnings."""
    console = Console(highlight=False, width=150)
    columns = list(dict.fromkeys((row.segmenter, row.prompt) for row in rows))
    table = Table("object", *(f"{name} {prompt}" for name, prompt in columns), title=group, title_justify="left")
    for name in dict.fromkeys(row.group for row in rows):
        cells = []
        for segmenter, prompt in columns:
            mine = [row for row in rows if (row.group, row.segmenter, row.prompt) == (name, segmenter, prompt)]
            mean = sum(row.iou for row in mine) / len(mine)
            was = earlier.get((name, prompt)) if segmenter == "anyprobe" else None
            mark = "!" if any(row.warning for row in mine) else ""
            cells.append(f"{mean:.2f}{mark}" + ("" if was is None else f" ({was:.2f})"))
        table.add_row(name, *cells)
    console.print(table)
    show_totals(group, rows)


def show_totals(group: str, rows: list[Row]) -> None:
    """The figures of all, by segmenter and prompt, and the warnings."""
    console = Console(highlight=False, width=150)
    for segmenter, prompt in dict.fromkeys((row.segmenter, row.prompt) for row in rows):
        chosen = [row for row in rows if (row.segmenter, row.prompt) == (segmenter, prompt)]
        console.print(f"{group}, {segmenter} {prompt}: {figures(chosen)}; {warned(chosen)}")
    console.print(f"{group}, anyprobe: {warned([row for row in rows if row.segmenter == 'anyprobe'])}")


def _earlier(path: Path | None, group: str) -> dict[tuple[str, str], float]:
    """Mean IoU by object and prompt, of a file that this command wrote."""
    if path is None:
        return {}
    import json

    found: dict[tuple[str, str], list[float]] = {}
    for row in json.loads(path.read_text(encoding="utf-8"))["rows"].get(group, []):
        if row["segmenter"] == "anyprobe":
            found.setdefault((row["group"], row["prompt"]), []).append(row["iou"])
    return {key: sum(values) / len(values) for key, values in found.items()}


if __name__ == "__main__":
    run_command(masks)
