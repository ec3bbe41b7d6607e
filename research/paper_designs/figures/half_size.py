"""The half-size designs as the repository's history keeps them, what they make of photos, and the frozen pairs.

Commit e8f1e10 trained them side by side on 160,000 pairs: photos of 64 x 64, maps of 32 x 64 (`anyprobe-train run
designs` there, 100 minutes of two cores). All see the irradiance image of the network that shipped then.
"""

from __future__ import annotations

import csv
import io
import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import torch
from torch.nn import functional as F

from anyprobe.core.frames import reflect
from anyprobe.core.latlong import direction_to_uv
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import Models
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.reconstruct import reconstruct
from anyprobe.render.surface import pixel_rays
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import allows_commercial_use, load_maps, load_shapes
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.dataset.recipe import read_recipes
from anyprobe_train.evaluate.methods import Estimate
from anyprobe_train.evaluate.scoring import FROZEN
from research.kept_pairs import kept_pairs
from research.paper_designs.figures.half_nets import SIZE, half_size_nets
from research.paper_designs.judge import spread_mirror, unwrap_sphere

ROOT = Path(__file__).parents[3]
COMMIT = "e8f1e10"
CHECKPOINT, LOG = "training/designs/checkpoint.pt", "training/designs/log.csv"
SPHERES, RELIT = "docs/results/fig13.json", "docs/results/fig14.json"
"""Scores of all 1,000 frozen pairs."""
IRRADIANCE = "src/anyprobe/weights/paper/irradiance.onnx"
SHIPPED = "paper, as shipped"
DESIGNS = {"ours": "Ours", "georgoulis": "Georgoulis et al.", "meka": "Meka et al."}
"""What the paper's Figs. 12 to 14 compare, as the kept files name it, and its title."""
METHODS = (*DESIGNS.values(), SHIPPED)
"""The same, and what ships as `paper`."""
NOTE = (
    "Ours and both rivals: half-size networks, photos of 64 x 64, maps of 32 x 64, after 160,000 pairs; the paper's "
    "are of 128 x 128 after 14 to 25 million. Their order is not decided at this scale."
)


def kept_file(path: str) -> bytes:
    """A file of COMMIT.

    Raises:
        InputError: this is no clone, or one without its history.
    """
    found = subprocess.run(["git", "-C", str(ROOT), "show", f"{COMMIT}:{path}"], capture_output=True, check=False)
    if found.returncode:
        raise InputError(
            f"expected it in commit {COMMIT} of this clone's history, got none; git fetch --unshallow", source=path
        )
    return found.stdout


def kept_scores(path: str) -> dict[str, Any]:
    """Groups of a results file: of each, pairs, rows by design, and how far designs are ahead of others."""
    return json.loads(kept_file(path))["groups"]


def kept_losses() -> dict[str, np.ndarray]:
    """The training log's columns by name, [rows]."""
    rows = list(csv.DictReader(io.StringIO(kept_file(LOG).decode("utf-8"))))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


class HalfSize:
    """Estimates of METHODS."""

    def __init__(self) -> None:
        state = torch.load(io.BytesIO(kept_file(CHECKPOINT)), weights_only=True)["nets"]
        self._nets = half_size_nets()
        self._nets.load_state_dict({key: value for key, value in state.items() if key.split(".")[0] in self._nets})
        self._nets.eval().requires_grad_(False)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        self._irradiance = onnxruntime.InferenceSession(kept_file(IRRADIANCE), options)
        self._shipped = Models("paper", threads=1)

    @torch.no_grad()
    def __call__(self, crop: np.ndarray, tan_half: float, normals: np.ndarray) -> dict[str, Estimate]:
        """Estimate by method.

        Args:
            crop: [128, 128, 4], display RGB times mask, and mask.
            tan_half: tangent of half the angle that the crop takes in.
            normals: [64, 64, 3] in the crop's frame, for Meka et al.: unit, zero off the object.
        """
        photo = _tensor(crop)
        (seen,) = self._irradiance.run(None, {"input": photo.numpy()})
        image = torch.cat([torch.from_numpy(seen).clip(0, 1), photo[:, 3:]], dim=1)
        small, n = F.avg_pool2d(photo, 2), _tensor(normals)
        ldr = _picture(_grown(self._nets["ours"](F.avg_pool2d(image, 2))))
        ln = _picture(_grown(self._nets["hdr"](F.avg_pool2d(_tensor(ldr), 2))))
        sphere = unwrap_sphere(self._nets["georgoulis"](small), MAP_HEIGHT)
        mirror = self._nets["meka"](torch.cat([small, n], dim=1))
        uv = torch.from_numpy(direction_to_uv(reflect(pixel_rays(tan_half, SIZE), normals)))[None]
        there = (n.square().sum(dim=1, keepdim=True) > 0) & (small[:, 3:] > 0.5)
        grey = spread_mirror(mirror, uv, there.float(), MAP_HEIGHT)
        shipped = self._shipped(crop, tan_half)
        return {
            "Ours": Estimate(ldr=ldr, radiance=reconstruct(ldr, ln).astype(np.float32)),
            "Georgoulis et al.": Estimate(ldr=_picture(sphere)),
            "Meka et al.": Estimate(ldr=_picture(grey)),
            SHIPPED: Estimate(ldr=shipped.ldr.clip(0, 1), radiance=shipped.radiance),
        }


def shown_pairs(data: Path, rows: int, kept: Path | None = None) -> Iterator[Pair]:
    """The first frozen pairs, `rows` of each side of the paper's border, each under another map, whose map and shape
    have a licence under which a picture of them may be published. kept: folder that keeps them, once rendered."""
    store, seen, left = AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test")), set(), {}
    for recipe in read_recipes(FROZEN):
        licences = store.map(recipe.map_id).licence, store.shape(recipe.shape_id).licence
        if recipe.map_id in seen or not all(map(allows_commercial_use, licences)):
            continue
        (pair,) = kept_pairs([recipe], store, kept)
        if left.setdefault(pair.specular, rows):
            left[pair.specular] -= 1
            seen.add(recipe.map_id)
            yield pair
        if len(left) == 2 and not any(left.values()):
            return


def _tensor(picture: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(picture, np.float32)).permute(2, 0, 1)[None]


def _picture(maps: torch.Tensor) -> np.ndarray:
    return np.ascontiguousarray(maps[0].permute(1, 2, 0).numpy())


def _grown(maps: torch.Tensor) -> torch.Tensor:
    """Maps of MAP_HEIGHT rows [1, C, 64, 128], interpolated across the seam."""
    times = MAP_HEIGHT // maps.shape[2]
    wide = torch.cat([maps[..., -1:], maps, maps[..., :1]], dim=3)
    return F.interpolate(wide, scale_factor=float(times), mode="bilinear")[..., times:-times]
