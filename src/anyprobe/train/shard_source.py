"""Batches from a rendered dataset (`anyprobe data render`), local or a cluster's output, in the place of pairs made on
the fly."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from anyprobe.core.response import response
from anyprobe.dataset.asset_store import AssetStore
from anyprobe.dataset.pair import LN_RANGE
from anyprobe.dataset.pairs import Batch, PairConfig
from anyprobe.dataset.render_job import SETTINGS, num_shards, read_plan
from anyprobe.dataset.samples import NORMALS, StoreRenderer, decode, decode_normals
from anyprobe.dataset.shards import ShardIndex, is_done, read_index, tar_path
from anyprobe.errors import InputError
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.scatter.materials import MATERIAL_INPUTS

KEPT_LIGHTS = 4096
"""Turned maps that are kept: pairs of one map and view share theirs."""


class ShardSource:
    """Batches of a dataset's finished shards; batch k depends on the seed and k alone, as of pairs made on the fly.

    Every epoch has its own order of all pairs; the last ones that fill no batch are left out.
    """

    def __init__(self, folder: Path, data: Path | None, config: PairConfig, device: str = "cpu") -> None:
        """folder: of `anyprobe data render`; data: the assets it was rendered from, None where all were procedural.

        Raises:
            InputError: no dataset of objects, none of its shards finished, fewer pairs than a batch, or other assets.
        """
        plan = read_plan(folder)
        if plan["kind"] != "object":
            raise InputError(f"--shards {folder}: expected a dataset of objects, got one of {plan['kind']}s")
        if data is None and plan["procedural_maps"] < len(plan["maps"]):
            raise InputError(
                f"--shards {folder}: expected --data too, the assets it was rendered from, got none"
            )
        self.folder, self.config, self.device = folder, config, device
        self.form = plan["format"]
        done = [shard for shard in range(num_shards(plan)) if is_done(folder, shard)]
        self.indices: dict[int, ShardIndex] = {shard: read_index(folder, shard) for shard in done}
        self.keys = [(shard, key) for shard, index in self.indices.items() for key in index.parts]
        if len(self.keys) < config.batch:
            raise InputError(
                f"--shards {folder}: expected at least {config.batch} finished pairs, got {len(self.keys)}; "
                "render more with anyprobe data render --resume"
            )
        self.store: AssetStore = StoreRenderer({name: plan[name] for name in SETTINGS}, data).store
        missing = {one["id"] for one in plan["maps"]} - self.store.maps.keys()
        if missing:
            raise InputError(
                f"--shards {folder}: expected the maps it was rendered from in --data, {len(missing)} of "
                f"{len(plan['maps'])} are not there"
            )
        self._light = lru_cache(maxsize=KEPT_LIGHTS)(self._turned_map)

    @property
    def identity(self) -> str:
        """Which pairs these are: how many, and 8 hex digits of SHA-256 over their keys."""
        digits = hashlib.sha256(" ".join(key for _, key in self.keys).encode()).hexdigest()[:8]
        return f"{len(self.keys)} rendered pairs ({digits})"

    def batch(self, step: int) -> Batch:
        """The pairs of step number `step`."""
        size = self.config.batch
        epoch, place = divmod(step, len(self.keys) // size)
        order = np.random.default_rng((self.config.seed, 3, epoch)).permutation(len(self.keys))
        chosen = [self.keys[k] for k in order[place * size : (place + 1) * size]]
        rows = [self._pair(*one) for one in chosen]
        arrays = {name: torch.from_numpy(np.stack([row[name] for row in rows])) for name in rows[0]}
        nothing = {
            "given_normals_rotation": torch.zeros(size, 3, 3),
            "surroundings": torch.zeros(size, 4, MAP_HEIGHT, 2 * MAP_HEIGHT),
            "material": torch.zeros(size, MATERIAL_INPUTS),
            "given_material": torch.zeros(size, MATERIAL_INPUTS),
        }
        return Batch(**arrays, **nothing).to(self.device)

    def _pair(self, shard: int, key: str) -> dict[str, np.ndarray]:
        """The arrays of Batch, channels first."""
        parts = {}
        with tar_path(self.folder, shard).open("rb") as stream:
            for name, (offset, size) in self.indices[shard].parts[key].items():
                stream.seek(offset)
                parts[name] = decode(name, stream.read(size))
        fields = parts["json"]
        light = self._light(fields["map_id"], json.dumps(fields["map_from_camera"]))
        radiance = light * np.asarray(fields["gain"], np.float32)
        low, high = LN_RANGE
        normals = decode_normals(parts[NORMALS]) if self.form > 1 else np.zeros((128, 128, 3), np.float32)
        images: dict[str, Any] = {
            "photo": parts["photo.png"] / np.float32(255),
            "irradiance": parts["irradiance.png"] / np.float32(255),
            "ldr": response(radiance),
            "ln_radiance": np.log(np.clip(radiance, 1e-6, None)).clip(low, high),
            "normals": normals,
        }
        rows = {
            name: np.ascontiguousarray(value.transpose(2, 0, 1), np.float32) for name, value in images.items()
        }
        return rows | {name: np.float32(fields[name]) for name in ("alpha", "tan_half")}

    def _turned_map(self, map_id: str, map_from_camera: str) -> np.ndarray:
        """A map in a pair's camera frame, [64, 128, 3]."""
        turn = np.array(json.loads(map_from_camera))
        return np.asarray(shrink(rotate(self.store.map(map_id).radiance, turn.T), MAP_HEIGHT), np.float32)
