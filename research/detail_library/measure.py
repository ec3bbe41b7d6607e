"""Maps with plausible detail beside the plain estimate and the truth, on test pairs.

    python -m research.detail_library.measure DATA                          # our own library
    python -m research.detail_library.measure DATA --library DATA/hdri/train --mirrors
    python -m research.detail_library.measure --pairs 10 --sheet docs/detail.jpg  # scenes no library has

DATA holds hdri/test and meshes/test; the pairs are those of `anyprobe-train evaluate`. Times are of the processor,
all threads together.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from PIL import Image

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import to_bytes
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.detail.plausible import add_detail
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import Models
from anyprobe.files.objects import draw_under
from anyprobe.light.environment import reduced, rotate
from anyprobe.light.filtering import irradiance_map
from anyprobe.light.harmonics import project
from anyprobe.match.alignment import find_matches
from anyprobe.match.library import Library, encode, write_library
from anyprobe.match.library_folder import open_library
from anyprobe_train.dataset.asset_store import AssetStore, own_shape
from anyprobe_train.dataset.catalog import MapAsset, load_maps, load_shapes, normalize_map
from anyprobe_train.dataset.pair import Pair, render_pair
from anyprobe_train.dataset.recipe import balanced_recipes
from research.detail_library.outdoors import detailed_outdoor
from research.detail_library.rooms import detailed_room

PAIRS, SEED = 200, 2020
ORDERS = (8, 10, 12, 16, 24, 31, 48, 63)
"""Orders whose powers are printed."""
OWN_ROWS = 128
TILE = 120
"""Pixels of a sheet's sphere."""


@lru_cache(maxsize=2)
def legendre(height: int, orders: int) -> list[np.ndarray]:
    """Normalised associated Legendre functions at the rows, for each m [orders, height]."""
    theta = (np.arange(height) + 0.5) * np.pi / height
    x, s = np.cos(theta), np.sin(theta)
    found, diagonal = [], np.full(height, np.sqrt(1 / (4 * np.pi)))
    for m in range(orders):
        p = np.zeros((orders, height))
        p[m] = diagonal
        if m + 1 < orders:
            p[m + 1] = np.sqrt(2 * m + 3) * x * diagonal
        for l in range(m + 2, orders):
            a = np.sqrt((4 * l * l - 1) / (l * l - m * m))
            b = np.sqrt(((l - 1) ** 2 - m * m) / (4 * (l - 1) ** 2 - 1))
            p[l] = a * (x * p[l - 1] - b * p[l - 2])
        found.append(p)
        diagonal = diagonal * s * np.sqrt((2 * m + 3) / (2 * m + 2))
    return found


def spectrum(display: np.ndarray, orders: int = 64) -> np.ndarray:
    """Power of each order of [H, 2H, 3]: their sum is the mean square over the sphere (and the channels)."""
    height = len(display)
    rows = 2 * height * pixel_solid_angles(height)[:, 0] / (2 * np.pi)
    power = np.zeros(orders)
    for channel in np.moveaxis(display, -1, 0):
        waves = np.fft.rfft(channel, axis=1) * (np.pi / height)
        for m, p in enumerate(legendre(height, orders)):
            power += (1 if m == 0 else 2) * np.abs(p @ (rows * waves[:, m])) ** 2
    return power / (4 * np.pi * display.shape[-1])


def edge_ratios(display: np.ndarray) -> tuple[float, float]:
    """Mean step of display values [H, 2H, 3] across the seam over that between all neighbouring columns; across the
    poles over that between all neighbouring rows."""
    columns = np.abs(np.diff(display, axis=1, append=display[:, :1])).mean(axis=(0, 2))
    across = [np.abs(row - np.roll(row, len(display), axis=0)).mean() for row in (display[0], display[-1])]
    return float(columns[-1] / columns.mean()), float(np.mean(across) / np.abs(np.diff(display, axis=0)).mean())


def test_store(data: Path) -> AssetStore:
    """Test maps and shapes of a folder."""
    return AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test"))


def own_store(count: int = 10) -> AssetStore:
    """Scenes of our own that are not in our library, rooms and out of doors by turns, and shapes."""
    maps = []
    for number in range(count):
        draw = (detailed_room, detailed_outdoor)[number % 2]
        radiance = draw(np.random.default_rng((SEED, number)), OWN_ROWS)
        maps.append(
            MapAsset(
                name=f"scene-{number}",
                id=f"{number:08x}",
                licence="own",
                indoor=number % 2 == 0,
                radiance=normalize_map(radiance),
            )
        )
    return AssetStore(maps, [own_shape(SEED, number) for number in range(count)])


@dataclass(frozen=True, kw_only=True, slots=True)
class Compared:
    """Plain estimate, detailed map and the truth at full size of a pair."""

    pair: Pair
    plain: np.ndarray
    detailed: np.ndarray
    truth: np.ndarray
    name: str
    seconds: float


def compared(store: AssetStore, count: int, library: Library) -> Iterator[Compared]:
    """Pairs of a store, estimated by the shipped model and detailed by a library."""
    models = Models()
    for recipe in balanced_recipes(store, count, SEED):
        pair = render_pair(recipe, store)
        found = models(pair.crop, pair.tan_half)
        start = time.process_time()
        detailed = add_detail(found.radiance, found.confidence, library=library)
        yield Compared(
            pair=pair,
            plain=found.radiance,
            detailed=detailed.radiance,
            truth=np.maximum(rotate(store.map(recipe.map_id).radiance, pair.map_from_camera.T) * pair.gain, 0.0),
            name=detailed.name,
            seconds=time.process_time() - start,
        )


def figures_of(one: Compared) -> dict[str, Any]:
    """Of one pair."""
    truth, plain, detailed = one.pair.radiance, one.plain, one.detailed
    small = reduced(detailed, len(plain))
    harmonics = [project(radiance) for radiance in (plain, detailed)]
    white = [irradiance_map(radiance) for radiance in (plain, small)]
    seam, poles = edge_ratios(response(detailed))
    return {
        "sh9": float(np.linalg.norm(harmonics[1] - harmonics[0]) / np.linalg.norm(harmonics[0])),
        "white": float(np.sqrt(((white[1] - white[0]) ** 2).mean() / (white[0] ** 2).mean())),
        "rmse_plain": _rmse(plain, truth),
        "rmse_detailed": _rmse(small, truth),
        "spectra": [spectrum(response(radiance)) for radiance in (plain, small, truth)],
        "seam": seam,
        "poles": poles,
        "seconds": one.seconds,
    }


def _rmse(radiance: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(((response(radiance) - response(truth)) ** 2).mean()))


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Means, largest values and ratios over pairs."""
    column = {name: np.array([one[name] for one in found]) for name in found[0]}
    plain, detailed, real = column["spectra"].mean(axis=0)
    before, after = column["rmse_plain"].mean(), column["rmse_detailed"].mean()
    return {
        "pairs": len(found),
        "sh9_change_max": column["sh9"].max(),
        "white_sphere_change_max": column["white"].max(),
        "ldr_rmse_plain": before,
        "ldr_rmse_detailed": after,
        "ldr_rmse_change": after / before - 1,
        "power_over_real": {order: detailed[order] / real[order] for order in ORDERS},
        "power_over_real_plain": {order: plain[order] / real[order] for order in ORDERS},
        "real_power_8_to_63": real[8:].sum(),
        "seam": column["seam"].mean(),
        "poles": column["poles"].mean(),
        "processor_ms_median": 1e3 * np.median(column["seconds"]),
        "processor_ms_first": 1e3 * column["seconds"][0],
    }


def placed_mirrors(maps: list, count: int = 20) -> dict[str, Any]:
    """A held-out map among all of a folder's: found, and turned by how many degrees too far, from a mirror's photo."""
    estimator, rng, errors = Estimator(threads=1), np.random.default_rng(SEED), []
    chosen = maps[:: max(1, len(maps) // count)][:count]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "maps.zip"
        write_library(path, ((asset.name, encode(asset.radiance)) for asset in maps))
        library = open_library(path)
        for asset in chosen:
            map_from_camera = world_from_camera(rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0, 40)))
            radiance = rotate(asset.radiance, map_from_camera.T)
            gain = 0.35 / np.exp(np.log(np.maximum(radiance.mean(axis=-1), 1e-4)).mean())
            sphere = draw_under(radiance * np.float32(gain), "sphere", "chrome", size=256)
            photo = to_bytes(np.dstack([response(sphere[..., :3]), sphere[..., 3]]))
            light = estimator(photo, fov_deg=30.0, normals="sphere", material="chrome")
            match = find_matches(light.radiance, light.confidence, library, rank=0)[0]
            turn = match.candidate_from_estimate @ map_from_camera.T
            angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
            errors.append(float(angle) if match.name == asset.name else np.inf)
    found = np.array(errors)
    return {
        "maps": len(maps),
        "photos": len(found),
        "found": int(np.isfinite(found).sum()),
        "within_10_deg": int((found <= 10).sum()),
        "median_deg": float(np.median(found[np.isfinite(found)])),
    }


def sheet(rows: list[Compared]) -> np.ndarray:
    """Photo; chrome spheres and maps of the plain estimate, with detail, and of the truth: [H, W, 3] uint8."""
    lines = []
    for one in rows:
        maps = (one.plain, one.detailed, one.truth)
        spheres = [
            _display(draw_under(radiance, "sphere", "chrome", size=2 * TILE)[..., :3], TILE) for radiance in maps
        ]
        lines.append(
            np.concatenate(
                [_display_bytes(one.pair.photo[..., :3], TILE), *spheres]
                + [_display(radiance, 2 * TILE) for radiance in maps],
                axis=1,
            )
        )
    return np.concatenate(lines)


def _display(radiance: np.ndarray, width: int) -> np.ndarray:
    return _display_bytes(to_bytes(response(radiance)), width)


def _display_bytes(picture: np.ndarray, width: int) -> np.ndarray:
    return np.asarray(Image.fromarray(picture).resize((width, TILE), Image.Resampling.LANCZOS))


def main(
    data: Annotated[Path | None, typer.Argument(help="Folder with hdri/test and meshes/test.")] = None,
    library: Annotated[Path | None, typer.Option(help="Folder of maps; else our own.")] = None,
    pairs: Annotated[int, typer.Option(min=1)] = PAIRS,
    sheet_path: Annotated[Path | None, typer.Option("--sheet", help="Picture of ten pairs.")] = None,
    mirrors: Annotated[bool, typer.Option("--mirrors", help="Also look for maps among their like.")] = False,
) -> None:
    """Print one JSON object."""
    store = own_store() if data is None else test_store(data)
    found, shown = [], []
    for number, one in enumerate(compared(store, pairs, open_library(library))):
        found.append(figures_of(one))
        if number % max(1, pairs // 10) == 0:
            shown.append(one)
    result = summary(found)
    if mirrors:
        result["mirrors"] = placed_mirrors(list(store.maps.values()))
    print(json.dumps(result, indent=1, default=float))
    if sheet_path is not None:
        Image.fromarray(sheet(shown[:10])).save(sheet_path, quality=85)


if __name__ == "__main__":
    run_command(lambda: typer.run(main))
