"""A pair as named bytes, as a shard stores it, and its renderer."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from anyprobe.errors import InputError
from anyprobe.learning.dataset.asset_store import load_asset_store
from anyprobe.learning.dataset.pair import MapPair, Pair, is_too_thin, render_map_pair, render_pair
from anyprobe.learning.dataset.recipe import Recipe, full_plan
from anyprobe.pictures.images import png_bytes

CONDITIONS = ("clean", "world")

DATASET_FORMAT = 2
"""Version of the format of datasets; others are refused."""
NORMALS = "normals.png"
SAMPLE_ARRAYS = {
    "object": {
        "photo.png": ((128, 128, 4), "uint8"),
        "irradiance.png": ((128, 128, 3), "uint8"),
        NORMALS: ((128, 128, 3), "uint8"),
    },
    "map": {"ldr.png": ((64, 128, 3), "uint8"), "ln_radiance.npy": ((64, 128, 3), "float16")},
}
"""Shape and type of each array of a sample, by kind; json stands beside them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Sample:
    """A pair's name, its parts (photo.png and so on) in order, and the groups that it counts towards."""

    key: str
    parts: dict[str, bytes]
    groups: tuple[str, ...] = ()


_Report = Callable[[str], None] | None


class StoreRenderer:
    """Renderer of all combinations of a folder's assets and of procedural ones."""

    def __init__(self, settings: Mapping, data: Path | None, report: _Report = None) -> None:
        self.kind = settings["kind"]
        self.store = load_asset_store(
            data,
            settings["split"],
            commercial_only=settings["commercial_only"],
            procedural_maps=settings["procedural_maps"],
            procedural_shapes=settings["procedural_shapes"],
            with_shapes=self.kind == "object",
            report=report,
        )
        if self.kind == "object":
            self._leave_out_lines(report)
        conditions = CONDITIONS.index(settings["conditions"])
        self.plan = full_plan(self.store, self.kind, conditions, settings["seed"])
        self.count = self.plan.count
        self.maps = _asset_entries(self.store.maps)
        self.shapes = _asset_entries(self.store.shapes) if self.kind == "object" else []

    def _leave_out_lines(self, report: _Report) -> None:
        """Drop the shapes that photos would not show."""
        for shape in [asset for asset in self.store.shapes.values() if is_too_thin(asset.mesh)]:
            del self.store.shapes[shape.id]
            if report is not None:
                report(f"{shape.name}: expected a shape that photos can show, got one thinner than a pixel; left out")

    def recipe(self, index: int) -> Recipe:
        """Return recipe number `index` of the plan."""
        return self.plan.recipe(index)

    def sample(self, recipe: Recipe) -> Sample:
        """Render and encode a recipe's pair."""
        if recipe.kind == "object":
            return encode_pair(render_pair(recipe, self.store))
        return encode_map_pair(render_map_pair(recipe, self.store))


def encode_pair(pair: Pair) -> Sample:
    """Encode an object's pair: photo.png (RGBA), irradiance.png, normals.png and json."""
    fields = {
        "shape_id": pair.recipe.shape_id,
        "shape": pair.shape_name,
        "specular": bool(pair.specular),
        "alpha": float(pair.material.alpha),
        "f0": _numbers(pair.material.f0),
        "albedo": _numbers(pair.material.albedo),
        "tan_half": float(pair.tan_half),
    }
    return Sample(
        key=pair.recipe.key,
        parts={
            "photo.png": png_bytes(pair.photo),
            "irradiance.png": png_bytes(pair.irradiance),
            NORMALS: png_bytes(encode_normals(pair.normals)),
            "json": _json(pair, fields),
        },
        groups=("specular" if pair.specular else "diffuse", _location(pair)),
    )


def encode_normals(normals: np.ndarray) -> np.ndarray:
    """Encode unit normals [S, S, 3], zero off the object, as uint8: round(127 n) + 128, and 0 off the object."""
    inside = normals.any(axis=-1, keepdims=True)
    return np.where(inside, np.round(127.0 * normals) + 128.0, 0.0).astype(np.uint8)


def decode_normals(image: np.ndarray) -> np.ndarray:
    """Decode normals to [S, S, 3] float32: unit to rounding of half a degree, zero off the object."""
    inside = image.any(axis=-1, keepdims=True)
    return np.where(inside, (image.astype(np.float32) - 128.0) / 127.0, 0.0).astype(np.float32)


def encode_map_pair(pair: MapPair) -> Sample:
    """Encode a map's pair: ldr.png, ln_radiance.npy and json."""
    array = io.BytesIO()
    np.save(array, np.ascontiguousarray(pair.ln_radiance, np.float16))
    return Sample(
        key=pair.recipe.key,
        parts={"ldr.png": png_bytes(pair.ldr), "ln_radiance.npy": array.getvalue(), "json": _json(pair, {})},
        groups=(_location(pair),),
    )


def decode_part(name: str, data: bytes) -> Any:
    """Decode a part by the end of its name; InputError if it is damaged."""
    try:
        if name.endswith(".npy"):
            return np.load(io.BytesIO(data), allow_pickle=False)
        if name.endswith(".png"):
            return np.asarray(Image.open(io.BytesIO(data), formats=["PNG"]))
        return json.loads(data)
    except (OSError, SyntaxError, ValueError, EOFError) as error:
        message = " ".join(str(error).split())[:80] or type(error).__name__
        raise InputError(
            f"expected a readable file, got a damaged one ({message}); render it again", source=name
        ) from error


def same(name: str, first: bytes, second: bytes) -> bool:
    """Return whether two parts hold the same values bit for bit, however they were compressed."""
    if first == second:
        return True
    a, b = decode_part(name, first), decode_part(name, second)
    if isinstance(a, dict) or isinstance(b, dict):
        return a == b
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def _json(pair: Pair | MapPair, extra: dict) -> bytes:
    recipe = pair.recipe
    fields = {
        "recipe": recipe.to_hex(),
        "kind": recipe.kind,
        "conditions": CONDITIONS[recipe.conditions],
        "map_id": recipe.map_id,
        "map": pair.map_name,
        "indoor": bool(pair.indoor),
        "view": recipe.view,
        "map_from_camera": _numbers(pair.map_from_camera),
        "gain": _numbers(pair.gain),
    }
    return json.dumps({**fields, **extra}, allow_nan=False).encode()


def _numbers(values) -> list[float]:
    return np.asarray(values, np.float64).tolist()


def _location(pair: Pair | MapPair) -> str:
    return "indoor" if pair.indoor else "outdoor"


def _asset_entries(assets: Mapping) -> list[dict[str, str]]:
    """Return the entries of maps or shapes in dataset.json."""
    return [{"id": i, "name": assets[i].name, "licence": assets[i].licence} for i in sorted(assets)]
