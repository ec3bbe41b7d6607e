"""What more photos of the same object add: one light of 1, 2, 4 and 8 photos whose cameras' poses are known.

    PYTHONPATH=. python benchmarks/several_photos.py [--data DATA] [--left-out] [--places 40] [--arc 360] [--room R]

Each place has a map, a shape and a material; the camera goes round the object, evenly over --arc degrees, with its
exposure and white balance locked. DATA: held-out maps and shapes of DATA/hdri/test and DATA/meshes/test, or with
--left-out the training assets that no shipped weights learn from; without --data all are our own. With --room the
photos show the light behind the object too, as walls so much farther than the camera, and three lights are compared:
of none of it given, of each photo given its own, and of all given what any shows. Figures: docs/how-to/inputs.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from places import draw_place

from anyprobe.errors import InputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.known import PhotoBackground
from anyprobe.estimate.multiview import fuse_lights
from anyprobe.estimate.photo import Photo, inputs_of
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.evaluate.scoring import score
from research.left_out import load_left_out

MOST = 8
COUNTS = (1, 2, 4, 8)
ALONE, OWN, GATHERED = "not given", "each its own", "merged"
SHOWN = (
    "ldr_rmse",
    "ldr_ssim",
    "ln_hdr_rmse",
    "angle_diffuse_deg",
    "si_rmse_diffuse",
    "dominant_light_deg",
    "total_power_stops",
)


def measure(store: AssetStore, places: int, arc_deg: float, room: float | None, estimator: Estimator) -> Iterator[dict]:
    """One line a place, number of photos and which surroundings are given."""
    rng, surroundings = np.random.default_rng(15), arc_deg == 360
    for number in range(places):
        place = draw_place(store, rng, MOST, arc_deg, room)
        lights = {ALONE: [estimator.from_photo(photo) for photo in place.photos]}
        given = [] if room is None else [seen(photo) for photo in place.photos]
        if given:
            lights[OWN] = [estimator.from_photo(photo) for photo in given]
        for count in COUNTS:
            chosen = (
                np.linspace(0, MOST if surroundings else MOST - 1, count, endpoint=not surroundings).round().astype(int)
            )
            poses = place.map_from_camera[chosen]
            fused = {name: fuse_lights([few[k] for k in chosen], poses) for name, few in lights.items()}
            if given:
                fused[GATHERED] = estimator.multiview([given[k] for k in chosen], poses)
            for name, light in fused.items():
                line = {"place": number, "photos": count, "surroundings": name}
                yield line | score(light.radiance, place.radiance)


def seen(photo: Photo) -> Photo:
    """The photo, given what it shows beside the object; as it is where that is all black."""
    try:
        inputs_of(replace(photo, surroundings=PhotoBackground()))
    except InputError:
        return photo
    return replace(photo, surroundings=PhotoBackground())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder with hdri and meshes")
    parser.add_argument("--left-out", action="store_true", help="training assets that no shipped weights learn from")
    parser.add_argument("--places", type=int, default=40)
    parser.add_argument("--arc", type=float, default=360.0, help="degrees that the camera goes round")
    parser.add_argument("--room", type=float, help="the camera's distance over the walls', below 1")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    options = parser.parse_args()
    if options.left_out:
        store = load_left_out(options.data)
    else:
        own = 0 if options.data else 12
        store = load_asset_store(
            options.data, "test", extra=False, commercial_only=False, procedural_maps=own, procedural_shapes=own
        )
    lines = []
    for line in measure(store, options.places, options.arc, options.room, Estimator()):
        lines.append(line)
        if options.json:
            print(json.dumps(line), flush=True)
    for count, given in product(COUNTS, dict.fromkeys(line["surroundings"] for line in lines)):
        rows = [line for line in lines if line["photos"] == count and line["surroundings"] == given]
        means = {name: float(np.mean([row[name] for row in rows if name in row])) for name in SHOWN}
        medians = {
            name: float(np.median([row[name] for row in rows])) for name in ("dominant_light_deg", "total_power_stops")
        }
        print(
            json.dumps(
                {"photos": count, "surroundings": given, "places": len(rows)}
                | {name: round(value, 4) for name, value in means.items()}
                | {f"{name}_median": round(value, 4) for name, value in medians.items()}
            ),
            flush=True,
        )


if __name__ == "__main__":
    main()
