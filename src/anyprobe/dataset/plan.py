"""Which recipes a dataset has, in a fixed order."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from math import gcd

import numpy as np

from anyprobe.dataset.asset_store import AssetStore
from anyprobe.dataset.recipe import EXPOSURES, MATERIALS, VIEWPOINTS, WORLD, Recipe
from anyprobe.errors import InputError


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """Every combination of maps, shapes, materials and views once, well mixed.

    The first N recipes are a fair sample: specular and diffuse alternate, and the rest
    walks through all combinations in steps near the golden section of their number.
    """

    kind: str
    map_ids: tuple[str, ...]
    shape_ids: tuple[str, ...]
    conditions: int
    seed: int

    @property
    def count(self) -> int:
        """The paper's: shapes x maps x 8 materials x 23 views, or maps x 23 views x 5 exposures."""
        if self.kind == "map":
            return len(self.map_ids) * VIEWPOINTS * EXPOSURES
        return len(self.shape_ids) * len(self.map_ids) * MATERIALS * VIEWPOINTS

    def recipe(self, index: int) -> Recipe:
        """Recipe number index, 0 to count - 1."""
        if not 0 <= index < self.count:
            raise IndexError(f"expected an index below {self.count}, got {index}")
        radices = (len(self.map_ids), VIEWPOINTS)
        if self.kind == "map":
            (place, view, exposure) = _digits(_shuffled(index, self.count, self.seed), (*radices, EXPOSURES))
            return self._recipe(index, place, 0, exposure, view)
        half = _shuffled(index // 2, self.count // 2, self.seed)
        place, view, shape, material = _digits(half, (*radices, len(self.shape_ids), MATERIALS // 2))
        return self._recipe(index, place, shape, 2 * material + index % 2, view)

    def _recipe(self, index: int, place: int, shape: int, material: int, view: int) -> Recipe:
        name = {"shape_id": self.shape_ids[shape]} if self.kind == "object" else {}
        return Recipe(
            kind=self.kind,
            map_id=self.map_ids[place],
            material=material,
            view=view,
            conditions=self.conditions,
            seed=_seed(self.seed, index),
            **name,
        )


def full_plan(store: AssetStore, kind: str = "object", conditions: int = 0, seed: int = 2020) -> Plan:
    """The whole dataset over a stock."""
    if not store.maps or (kind == "object" and not store.shapes):
        raise InputError(
            f"dataset: expected at least one map and one shape, got {len(store.maps)} and {len(store.shapes)}"
        )
    return Plan(
        kind=kind,
        map_ids=tuple(sorted(store.maps)),
        shape_ids=tuple(sorted(store.shapes)),
        conditions=conditions,
        seed=seed,
    )


def balanced_recipes(store: AssetStore, count: int, seed: int = 2020, conditions: int = 0) -> list[Recipe]:
    """A test set: in turn specular/diffuse, indoor/outdoor, every shape alike; the rest at random.

    Only one kind of place if the maps have no other.
    """
    by_place, shapes = _places_and_shapes(store)
    recipes = []
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        places = by_place[bool(k // 2 % 2)]
        recipes.append(
            Recipe(
                kind="object",
                map_id=places[rng.integers(len(places))],
                shape_id=shapes[k // 4 % len(shapes)],
                material=k % 2 + 2 * int(rng.random() < 0.4) + 4 * int(rng.integers(2)),
                view=int(rng.integers(VIEWPOINTS)),
                conditions=conditions,
                seed=_seed(seed, k),
            )
        )
    return recipes


def world_recipes(store: AssetStore, count: int, seed: int) -> list[Recipe]:
    """A test set under the world's priors: in turn the kinds of priors.KINDS, the darker and the brighter half of
    each, indoor/outdoor, every shape alike; the rest at random."""
    by_place, shapes = _places_and_shapes(store)
    recipes = []
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        places = by_place[bool(k // MATERIALS % 2)]
        recipes.append(
            Recipe(
                kind="object",
                map_id=places[rng.integers(len(places))],
                shape_id=shapes[(k // (2 * MATERIALS) + k) % len(shapes)],
                material=k % MATERIALS,
                view=int(rng.integers(VIEWPOINTS)),
                conditions=WORLD,
                seed=_seed(seed, k),
            )
        )
    return recipes


def _places_and_shapes(store: AssetStore) -> tuple[dict[bool, list[str]], list[str]]:
    """Ids of the maps, by whether they are indoor, all where there are none such, and of the shapes."""
    if not store.maps or not store.shapes:
        raise InputError(
            f"test set: expected at least one map and one shape, got {len(store.maps)} and {len(store.shapes)}"
        )
    ids = sorted(store.maps)
    by_place = {place: [i for i in ids if store.maps[i].indoor == place] or ids for place in (True, False)}
    return by_place, sorted(store.shapes)


def _seed(seed: int, index: int) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed} {index}".encode()).digest()[:8], "big")


def _shuffled(index: int, count: int, seed: int) -> int:
    """A permutation of range(count): steps coprime with count, near its golden section."""
    step = max(1, int(count * 0.6180339887))
    while gcd(step, count) != 1:
        step += 1
    return (index * step + seed) % count


def _digits(value: int, radices: tuple[int, ...]) -> list[int]:
    """Mixed-radix digits of value, most significant first."""
    digits = []
    for radix in reversed(radices):
        value, digit = divmod(value, radix)
        digits.append(digit)
    return digits[::-1]
