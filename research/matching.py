"""`anyprobe match` on held-out maps: photos lit by maps of a library, which of its maps is found, and what that gains.

    python -m research.matching DATA              # 100 photos by the 30 test maps, among them and 109 of training
    python -m research.matching DATA --left-out   # by the maps that no shipped weights learn from: to choose by

Each photo is judged three times: the object alone, with the camera's pitch given, and with the background that a photo
CONTEXT_SCALE times as wide as the object's crop shows, which the estimate then has too. Also a vase relit by the
estimate, by the map ranked first, by the photo's own map as it was placed, and by the best of the others, as from a
library of other places.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.estimate.refine import shown_of
from anyprobe.estimate.runtime import Models
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.match.likeness import Shown, best_places, gain_of, light_of
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import MapAsset, load_maps, load_shapes
from anyprobe_train.dataset.pair import Pair, render_pair
from anyprobe_train.dataset.recipe import balanced_recipes
from anyprobe_train.evaluate.methods import run_with_hints
from research.compare.figures import relight_scores
from research.left_out import load_left_out

PHOTOS, SEED, MAPS = 100, 46, 139
NEAR_DEG = 15.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Library:
    """Maps by name, their means, and what they are compared by [N, 32, 64, 3]."""

    names: list[str]
    maps: list[np.ndarray]
    levels: list[float]
    lights: np.ndarray


def library_of(assets: list[MapAsset]) -> Library:
    """Of so many maps, one a name."""
    chosen = list({asset.name: asset for asset in assets}.values())[:MAPS]
    return Library(
        names=[asset.name for asset in chosen],
        maps=[reduced(asset.radiance, 2 * MAP_HEIGHT) for asset in chosen],
        levels=[light_of(asset.radiance)[1] for asset in chosen],
        lights=np.stack([light_of(asset.radiance)[0] for asset in chosen]),
    )


def held_out(data: Path) -> tuple[AssetStore, Library]:
    """Test maps and shapes, and a library of all test and training maps."""
    store = AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test"))
    return store, library_of([*store.maps.values(), *load_maps(data / "hdri" / "train")])


def left_out(data: Path) -> tuple[AssetStore, Library]:
    """Maps and shapes that no shipped weights learn from, and a library of these and others for training."""
    store = load_left_out(data)
    others = [asset for folder in ("train", "train_extra") for asset in load_maps(data / "hdri" / folder)]
    return store, library_of([*store.maps.values(), *others])


def turned_by(turn: np.ndarray, pair: Pair) -> tuple[float, float]:
    """How far a map is from where it was, in degrees: all in all, and about the vertical alone."""
    angle = np.degrees(np.arccos(np.clip((np.trace(turn @ pair.map_from_camera.T) - 1) / 2, -1, 1)))
    yaws = [np.arctan2(-one[2, 0], one[0, 0]) for one in (turn, pair.map_from_camera)]
    return float(angle), float(np.degrees(np.abs(np.angle(np.exp(1j * (yaws[0] - yaws[1]))))))


def placed(shown: Shown, estimate: np.ndarray, library: Library, turns: np.ndarray, index: int) -> np.ndarray:
    """A library's map [64, 128, 3] in the photo's frame and exposure."""
    turn = turns[index]
    mean = library.maps[index] / library.levels[index]
    turned = reduced(np.maximum(rotate(mean, turn.T), 0.0), MAP_HEIGHT)
    return (turned * gain_of(shown, estimate, library.lights[index], turn)).astype(np.float32)


def judged(store: AssetStore, library: Library, photos: int, conditions: int) -> Iterator[dict[str, Any]]:
    """Figures of each photo."""
    models = Models(threads=1)
    for recipe in balanced_recipes(store, photos, SEED, conditions):
        pair = render_pair(recipe, store)
        found, whole = run_with_hints(models, pair), run_with_hints(models, pair, {"surroundings"})
        shown, shown_whole = shown_of(found), shown_of(whole)
        if shown is None or shown_whole is None:
            yield {"shown": False}
            continue
        index = library.names.index(pair.map_name)
        row: dict[str, Any] = {"shown": True, "specular": pair.specular}
        pitch = float(np.degrees(np.arcsin(np.clip(pair.map_from_camera[1, 2], -1, 1))))
        cases = ((None, shown, found), (pitch, shown, found), (None, shown_whole, whole))
        for name, (given, seen, light) in zip(CASES, cases, strict=True):
            turns, misfits = best_places(seen, library.lights, given)
            angle, yaw = turned_by(turns[index], pair)
            first = placed(seen, light.radiance, library, turns, int(misfits.argmin()))
            others = np.where(np.arange(len(library.maps)) == index, np.inf, misfits)
            other, own = (placed(seen, light.radiance, library, turns, i) for i in (int(others.argmin()), index))
            maps = [pair.radiance, light.radiance, first, own, other]
            scores = [one["relight_rmse"] for one in relight_scores(maps)]
            rank = int((misfits < misfits[index]).sum())
            row[name] = {"rank": rank, "deg": angle, "yaw": yaw, "vase": dict(zip(VASES, scores, strict=True))}
        yield row


CASES = ("alone", "pitch given", "background shown")
VASES = ("estimate", "first map", "true map", "best other map")


def summary(rows: list[dict[str, Any]], name: str) -> dict[str, Any]:
    """Shares and means over photos; one without enough pixels counts as not found."""
    found = [row[name] for row in rows if row["shown"]]
    ranks = np.array([one["rank"] for one in found] + [MAPS] * (len(rows) - len(found)))
    first = [one for one in found if one["rank"] == 0]
    kinds = np.array([row["specular"] for row in rows if row["shown"]])
    own = ranks[: len(found)]
    return {
        "first": float((ranks == 0).mean()),
        "among_ten": float((ranks < 10).mean()),
        **{f"first_{kind}": float((own[chosen] == 0).mean()) for kind, chosen in (("shiny", kinds), ("dull", ~kinds))},
        "where_first_within_15_deg": float(np.mean([one["deg"] <= NEAR_DEG for one in first])),
        "where_first_within_15_deg_about_the_vertical": float(np.mean([one["yaw"] <= NEAR_DEG for one in first])),
        "where_first_median_deg": float(np.median([one["deg"] for one in first])),
        "vase_rmse": {kind: float(np.mean([one["vase"][kind] for one in found])) for kind in VASES},
    }


def main(
    data: Annotated[Path, Parameter(help="Folder with hdri/ and meshes/.")],
    /,
    *,
    left: Annotated[bool, Parameter(name="--left-out", help="Photos by maps that no weights learn from.")] = False,
    photos: Annotated[int, bounded(4)] = PHOTOS,
    conditions: Annotated[int, Parameter(help="0: clean photos; 1: as the world gives them.")] = 0,
) -> None:
    """Print one JSON object."""
    store, library = (left_out if left else held_out)(data)
    rows = []
    for row in judged(store, library, photos, conditions):
        rows.append(row)
        print(len(rows), *(row.get(name, {}).get("rank") for name in CASES), flush=True)
    result = {name: summary(rows, name) for name in CASES}
    print(json.dumps({"photos": len(rows), "maps": len(library.names), **result}, indent=1))


if __name__ == "__main__":
    run_command(main)
