"""`anyprobe match` on real photos: a table of the first maps and their kinds, and pages to look at.

    python -m research.real_photos.matched FOLDER... --maps DATA/hdri -o runs/matched

Photos with a mask NAME_mask.png beside them, or the one that lights.csv names. Each is shown over the first map's
panorama, with spheres in the light of the estimate and of the first map. What kind of place the photos show, by eye,
is in kinds.csv (in, out, or either); the panoramas' kind is their manifests' own where those have it.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from PIL import Image

from anyprobe.cli.app import main as run_command
from anyprobe.cli.match import match_doubts
from anyprobe.core.response import response
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.files.atomic import atomic_path
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.environment import reduced
from anyprobe.maps.radiance import read_radiance
from anyprobe.match.library import Library, open_library
from anyprobe.match.ranking import MatchedMap, log_odds, shading_apart
from anyprobe.render.spheres import sphere_images
from research.real_photos.folders import masked_photos
from research.real_photos.sheet import ROW, Tile, strip, write_pages

KINDS = Path(__file__).parent / "kinds.csv"
WORDS = {True: "out", False: "in"}
BRIGHT = 0.7
"""Radiance of the bright side of a row's matte spheres."""


def kinds_by_eye() -> dict[str, str]:
    """Return what kind of place each photo shows, by FOLDER/FILE."""
    with KINDS.open(newline="", encoding="utf-8") as stream:
        return {row["photo"]: row["kind"] for row in csv.DictReader(stream)}


def kinds_of_maps(folder: Path) -> dict[str, str]:
    """Return the kind of each map, by its file's stem, as the manifests in a folder have it."""
    found = {}
    for path in folder.rglob("manifest.csv"):
        with path.open(newline="", encoding="utf-8-sig") as stream:
            for row in csv.DictReader(stream):
                found[Path(row["file"]).stem] = WORDS[row.get("category") == "outdoor"]
    return found


def row_of(
    name: str, paths: tuple[Path, Path], estimator: Estimator, library: Library, kinds: dict[str, str]
) -> tuple[dict[str, Any], Image.Image]:
    """Return one photo's line of the table, and of the sheet."""
    photo = load_photo(paths[0], mask=paths[1])
    light = estimator.from_photo(photo)
    first = light.match(library, best=1)[0]
    doubts, placed = match_doubts(light, first), first.radiance(256)
    row = {
        "photo": name,
        "by_eye": kinds_by_eye().get(name, "either"),
        "judged": WORDS[light.outdoors > 0.5],
        "map": first.name,
        "map_kind": kinds.get(Path(first.name).name, "unknown"),
        "map_judged": WORDS[bool(log_odds(library.lights[first.index][None])[0] > 0)],
        "apart": round(shading_apart(placed, light.radiance), 2),
        "warnings": [doubt.code for doubt in doubts],
    }
    said = ", ".join(row["warnings"]) or "no warning"
    kinds_said = f"{row['by_eye']}, judged {row['judged']}; {first.name}: {row['map_kind']}"
    tiles: list[Tile] = [
        (Path(name).stem, photo.rgb),
        *spheres_of(light.radiance, "estimate"),
        *spheres_of(placed, f"first panorama, {row['apart']:.2f} stops apart"),
        as_it_is(first, f"{kinds_said}; {said}"),
    ]
    return row, strip([tiles])


def spheres_of(radiance: np.ndarray, caption: str) -> list[Tile]:
    """Return the three spheres under a map, at an exposure that shows them."""
    spheres = sphere_images(radiance, ROW)
    level = float(np.percentile(spheres["diffuse"].max(axis=-1), 90))
    gain = BRIGHT / max(level, 1e-6)
    return [(caption if name == "diffuse" else "", response(one * gain)) for name, one in spheres.items()]


def as_it_is(first: MatchedMap, caption: str) -> Tile:
    """Return a matched panorama in its own frame."""
    source = reduced(read_radiance(first.path), ROW)
    return caption, response(source * (0.25 / max(float(np.median(source)), 1e-6)))


def main(
    *folders: Annotated[Path, Parameter(help="Folders of photos with masks.")],
    maps: Annotated[Path, Parameter(help="Folder of panoramas.")],
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for page_0.jpg, ... and matched.json.")],
    model: Annotated[str, Parameter(help="Bundled model or folder.")] = DEFAULT_MODEL,
) -> None:
    """Print the table and draw the pages."""
    library, kinds, estimator = open_library(maps), kinds_of_maps(maps), Estimator(model, threads=1)
    rows, drawn = [], []
    for name, paths in masked_photos(folders).items():
        row, line = row_of(name, paths, estimator, library, kinds)
        rows.append(row)
        drawn.append(line)
        print(
            "{photo} | {by_eye} | {judged} | {map} | {map_kind} | {map_judged} | {apart}".format(**row), row["warnings"]
        )
    out.mkdir(parents=True, exist_ok=True)
    with atomic_path(out / "matched.json") as temporary:
        temporary.write_text(json.dumps({**counts(rows), "photos": rows}, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(counts(rows)))
    for path in write_pages(drawn, out):
        print(path)


def counts(rows: list[dict[str, Any]]) -> dict[str, int]:
    """Count photos whose kind is clear by eye: judged wrong, and given a first map of the other kind."""
    clear = [row for row in rows if row["by_eye"] in WORDS.values()]
    other = [row for row in clear if row["map_kind"] not in (row["by_eye"], "unknown")]
    return {
        "photos": len(rows),
        "judged_wrong": sum(row["judged"] not in (row["by_eye"], "unknown") for row in clear),
        "map_of_other_kind": len(other),
        "outdoors_for_indoors": sum(row["by_eye"] == "in" for row in other),
        "outdoors_for_indoors_unsaid": sum(
            row["by_eye"] == "in" and "match-kind" not in row["warnings"] for row in other
        ),
        "first_does_not_fit": sum("match-fit" in row["warnings"] for row in rows),
    }


if __name__ == "__main__":
    run_command(main)
