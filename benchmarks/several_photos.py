"""What more photos of the same object add: one light of 1, 2, 4 and 8 photos whose cameras' poses are known.

    python benchmarks/several_photos.py [--data DATA] [--left-out] [--places 40] [--arc 360] [--json]

Each place has a map, a shape and a material; the camera goes round the object, evenly over --arc degrees, with its
exposure and white balance locked. DATA: held-out maps and shapes of DATA/hdri/test and DATA/meshes/test, or with
--left-out the training assets that no shipped weights learn from; without --data all are our own. docs/known.md has
the figures.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y, world_from_camera
from anyprobe.dataset.camera import draw_shot, exposure, take_photo
from anyprobe.dataset.mask_errors import disturb_mask
from anyprobe.dataset.material import draw_alpha, draw_material
from anyprobe.dataset.pair import shade_surface
from anyprobe.dataset.stock import Stock, load_left_out, load_stock
from anyprobe.evaluate.protocol import score
from anyprobe.infer.estimate import Estimator
from anyprobe.infer.photo import Photo
from anyprobe.infer.several import fuse_lights
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.render.surface import frame_object, see

MOST = 8
COUNTS = (1, 2, 4, 8)
SHOWN = (
    "ldr_rmse",
    "ldr_ssim",
    "ln_hdr_rmse",
    "angle_diffuse_deg",
    "si_rmse_diffuse",
    "main_light_deg",
    "flux_stops",
)


def photograph(
    stock: Stock, rng: np.random.Generator, arc_deg: float
) -> tuple[np.ndarray, list[Photo], list[np.ndarray]]:
    """The map in the first camera's frame and exposure units, the photos of one place, and map_from_camera of each."""
    asset = list(stock.maps.values())[rng.integers(len(stock.maps))]
    shape = list(stock.shapes.values())[rng.integers(len(stock.shapes))]
    material = draw_material(rng, draw_alpha(rng))
    yaw, map_yaw = rng.uniform(0, 2 * np.pi, 2)
    elevation, fov_deg = rng.uniform(0.05, 0.6), rng.uniform(15.0, 40.0)
    shot, step = draw_shot(rng), np.radians(arc_deg) / (MOST if arc_deg == 360 else MOST - 1)
    photos, turns, gain, truth = [], [], None, None
    for k in range(MOST):
        camera = frame_object(shape.mesh, world_from_camera(yaw + k * step, elevation), fov_deg=fov_deg)
        surface = see(shape.mesh, camera)
        turns.append(rotation_y(map_yaw) @ camera.world_from_camera)
        reflected = shade_surface(stock.pyramid(asset.id), surface, turns[-1], material.alpha).radiance(
            material
        )
        if gain is None:
            light = shrink(rotate(asset.radiance, turns[0].T), MAP_HEIGHT)
            scene = float(np.exp(np.log(np.maximum(luminance(light), 1e-4)).mean()))
            gain = exposure(shot, float(luminance(reflected).mean()), scene)
            truth = np.maximum(light, 0.0) * np.asarray(gain * shot.white_balance, np.float32)
        picture = np.zeros((*surface.mask.shape, 3), np.float32)
        picture[surface.mask] = reflected * gain
        display = take_photo(shot, picture, surface.mask, None, rng)
        photos.append(
            Photo(
                rgb=display.astype(np.float32) / 255,
                mask=disturb_mask(surface.mask, rng).astype(np.float32),
                long_fov_deg=float(np.degrees(2 * np.arctan(camera.tan_half))),
                fov_source="given",
                name=f"{asset.name} {shape.name} {k}",
                warnings=(),
            )
        )
    return truth, photos, turns


def measure(stock: Stock, places: int, arc_deg: float, estimator: Estimator) -> Iterator[dict]:
    """One line a place and number of photos."""
    rng = np.random.default_rng(15)
    for place in range(places):
        truth, photos, turns = photograph(stock, rng, arc_deg)
        lights = [estimator.from_photo(photo) for photo in photos]
        for count in COUNTS:
            last = MOST if arc_deg == 360 else MOST - 1
            chosen = sorted(
                {round(k * last / max(count if arc_deg == 360 else count - 1, 1)) for k in range(count)}
            )
            fused = fuse_lights([lights[k] for k in chosen], [turns[k] for k in chosen])
            yield {"place": place, "photos": count, **score(fused.radiance, truth)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder with hdri and meshes")
    parser.add_argument(
        "--left-out", action="store_true", help="training assets that no shipped weights learn from"
    )
    parser.add_argument("--places", type=int, default=40)
    parser.add_argument("--arc", type=float, default=360.0, help="degrees that the camera goes round")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    options = parser.parse_args()
    if options.left_out:
        stock = load_left_out(options.data)
    else:
        own = 0 if options.data else 12
        stock = load_stock(
            options.data,
            "test",
            extra=False,
            commercial_only=False,
            procedural_maps=own,
            procedural_shapes=own,
        )
    lines = []
    for line in measure(stock, options.places, options.arc, Estimator()):
        lines.append(line)
        if options.json:
            print(json.dumps(line), flush=True)
    for count in COUNTS:
        rows = [line for line in lines if line["photos"] == count]
        means = {name: float(np.mean([row[name] for row in rows if name in row])) for name in SHOWN}
        medians = {
            name: float(np.median([row[name] for row in rows])) for name in ("main_light_deg", "flux_stops")
        }
        print(
            json.dumps(
                {"photos": count, "places": len(rows)}
                | {name: round(value, 4) for name, value in means.items()}
                | {f"{name}_median": round(value, 4) for name, value in medians.items()}
            ),
            flush=True,
        )


if __name__ == "__main__":
    main()
