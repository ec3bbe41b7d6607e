"""How far training's lookups are from paths, without and with what objects hide from themselves (dataset.occlusion).

python -m research.world.self_shadowing --data DATA [--scenes 40]
python -m research.world.self_shadowing --data DATA --kept runs/world    # instead, what shadows cost the shipped model

Objects of the left-out part of the world test set, painted ones left out, by Mitsuba (64 paths a pixel, whose noise
counts as error) and by dataset.batch_shading.shade_batch: the same mesh, camera, map and material. Radiance through
the mean camera curve, exposed to a mean of .2 by paths. Times are of the processor, not of the clock.
"""

from __future__ import annotations

import argparse
import time
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y
from anyprobe.core.response import response
from anyprobe.estimate.runtime import Models
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.environment import rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe_train.dataset.batch_shading import pixel_wo, shade_batch
from anyprobe_train.dataset.distributions import KINDS
from anyprobe_train.dataset.lighting import Illuminator
from anyprobe_train.dataset.occlusion import hidden_cells
from anyprobe_train.dataset.pair import _draw, _look, is_painted, render_pair
from anyprobe_train.evaluate.methods import run_with_hints
from anyprobe_train.evaluate.metrics import direction_error_deg
from anyprobe_train.evaluate.path_traced import trace_mesh
from research.limits.figures import figures
from research.world.pairs import recipes_of, store_of, world_pairs

TIMES: dict[str, list[float]] = {"hidden cells, once a surface": [], "lookups": [], "with shadows": []}


def compare(recipe, store, illuminators) -> dict[str, np.ndarray]:
    """Display values on the object, [P, 3] each: by paths, by lookups, by lookups with hidden cells."""
    shape, rng = store.shape(recipe.shape_id), recipe.rng()
    world_from_camera, fov_deg, material, map_yaw, _ = _draw(recipe, rng)
    camera, surface = _look(shape.mesh, world_from_camera, fov_deg, shape.name)
    yaw = rotation_y(map_yaw)
    surroundings = rotate(store.map(recipe.map_id).radiance, yaw.T)
    traced = trace_mesh(shape.mesh, camera, surroundings, material, num_paths=64)[surface.mask][:, :3]
    if recipe.map_id not in illuminators:
        illuminators[recipe.map_id] = Illuminator([store.map(recipe.map_id).radiance], compiled=False)
    lit = illuminators[recipe.map_id].light(0, yaw @ camera.world_from_camera, material.alpha, 0)
    normals = np.zeros((*surface.mask.shape, 3), np.float32)
    normals[surface.mask] = surface.normals
    normals = torch.from_numpy(normals).permute(2, 0, 1)[None]
    wo = pixel_wo(torch.tensor([surface.tan_half]).reshape(1, 1, 1, 1), normals.shape[-1])
    started = time.process_time()
    hidden = torch.from_numpy(hidden_cells(surface))[None]
    TIMES["hidden cells, once a surface"].append(time.process_time() - started)
    result = {"paths": traced}
    for name, cells in {"lookups": None, "with shadows": hidden}.items():
        started = time.process_time()
        picture, _ = shade_batch([lit], [material], normals, wo, hidden=cells)
        TIMES[name].append(time.process_time() - started)
        result[name] = picture[0].permute(1, 2, 0).numpy()[surface.mask]
    gain = 0.2 / luminance(traced).mean()
    return {name: value * gain for name, value in result.items()}


def cost(data: Path, kept: Path, scenes: int) -> None:
    """Print the shipped model's figures on the test part by paths, and on the same scenes without shadows."""
    store, models = store_of(data, "test"), Models(DEFAULT_MODEL)
    rows = {"normals estimated": set(), "normals given": {"normals"}}
    errors: dict[tuple[str, str], list] = {}
    plain = (pair for pair in world_pairs(data, "test", kept) if not is_painted(pair.recipe))
    for traced in islice(plain, scenes):
        for way, pair in {"paths": traced, "no shadows": render_pair(traced.recipe, store)}.items():
            for row, given in rows.items():
                estimate = run_with_hints(models, pair, given).radiance
                one = figures(estimate, pair.radiance)
                main = [find_dominant_light(radiance).direction for radiance in (estimate, pair.radiance)]
                errors.setdefault((row, way), []).append(
                    (one["rmse"], one["ssim"], one["gain_rmse"], one["power"], direction_error_deg(*main))
                )
    for (row, way), found in errors.items():
        a = np.array(found)
        print(
            f"{row:18} {way:11} {len(a)} pairs: RMSE {a[:, 0].mean():.4f}, SSIM {a[:, 1].mean():.4f}, after gain "
            f"{a[:, 2].mean():.4f}, power {np.median(a[:, 3]):+.2f} stops, dominant light {np.median(a[:, 4]):.1f} deg"
        )


def main() -> None:
    """Print RMSE of display values and the mean luminance against paths, in stops, for each kind of material."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--kept", type=Path)
    given = parser.parse_args()
    if given.kept is not None:
        cost(given.data, given.kept, given.scenes)
        return
    store, illuminators, rows = store_of(given.data, "left-out"), {}, []
    recipes = [recipe for recipe in recipes_of("left-out") if not is_painted(recipe)][: given.scenes]
    for recipe in recipes:
        seen = compare(recipe, store, illuminators)
        for name in ("lookups", "with shadows"):
            error = np.sqrt(np.mean((response(seen[name]) - response(seen["paths"])) ** 2))
            stops = np.log2(luminance(seen[name]).mean() / luminance(seen["paths"]).mean())
            rows.append((KINDS[recipe.material % 4], name, error, stops))
        print(recipe.key, *rows[-2:], flush=True)
    for kind in (*KINDS[:3], None):
        for name in ("lookups", "with shadows"):
            some = np.array([row[2:] for row in rows if row[1] == name and kind in (None, row[0])])
            print(f"{kind or 'all':8} {name:13} RMSE {some[:, 0].mean():.4f}  mean {some[:, 1].mean():+.3f} stops")

    for name, seconds in TIMES.items():
        print(f"{name}: {1000 * np.median(seconds):.1f} ms")


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
