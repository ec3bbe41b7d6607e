"""Recipes: the twenty bytes that a pair is rendered from, and the recipes of test sets."""

from __future__ import annotations

import hashlib
import os
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore

RECIPE_VERSION = 2
"""Version of recipes, raised whenever the same fields would give another pair."""
DRAWS = 1
"""Version of random scenes; a better renderer alone leaves it, as it shows the same scenes."""

VIEWPOINTS = 23
"""Number of camera positions on the upper hemisphere, as in the paper's Sect. 3.5."""
MATERIAL_CHOICES = 8
WORLD = 2
"""Conditions of photos with dataset.distributions and with flaws, as phones take them."""

CONDITIONS = ("clean", "world")
"""Names of the first two conditions, by number: clean as in the paper, or with flaws."""

_WORLD_CODE = 4
"""Conditions of WORLD as stored; 2 and 3 are of pairs that are not made any more."""

_LAYOUT = struct.Struct(">BB4s4sBBQ")


@dataclass(frozen=True, kw_only=True, slots=True)
class Recipe:
    """Recipe of one pair; the same recipe gives the same pair bit for bit on the CPU.

    map_id, shape_id: 8 hexadecimal digits, the assets' ids in an AssetStore.
    material: 0 to 7: bit 0 diffuse rather than specular, bit 1 metal, bit 2 a second draw of the two, or under WORLD
        bits 0 and 1 the kind of distributions.KINDS, bit 2 the brighter half of that kind.
    view: Fibonacci viewpoint, 0 to 22.
    conditions: 0 for the paper's clean photos, 1 for photos as the world gives them, WORLD for
        these with the world's materials, metering and white balance.
    seed: all else is drawn from it and from the fields above.
    """

    map_id: str
    shape_id: str
    material: int
    view: int
    conditions: int = 0
    seed: int

    def to_bytes(self) -> bytes:
        """Encode version, conditions, map, shape, material, view, seed; big-endian."""
        return _LAYOUT.pack(
            RECIPE_VERSION,
            _WORLD_CODE if self.conditions == WORLD else self.conditions,
            bytes.fromhex(self.map_id),
            bytes.fromhex(self.shape_id),
            self.material,
            self.view,
            self.seed,
        )

    def to_hex(self) -> str:
        """Encode the recipe as 40 hexadecimal digits."""
        return self.to_bytes().hex()

    @classmethod
    def from_hex(cls, text: str) -> Recipe:
        """Decode to_hex's digits; InputError for anything else."""
        try:
            version, code, map_id, shape_id, material, view, seed = _LAYOUT.unpack(bytes.fromhex(text))
        except (ValueError, struct.error) as error:
            raise InputError(
                f"expected {2 * _LAYOUT.size} hexadecimal digits, got {len(text)} characters",
                source=f"recipe {text[:48]!r}",
            ) from error
        if version != RECIPE_VERSION:
            raise InputError(
                f"expected version {RECIPE_VERSION}, got {version}; use the release that wrote it",
                source=f"recipe {text}",
            )
        if code not in (0, 1, _WORLD_CODE) or material >= MATERIAL_CHOICES or view >= VIEWPOINTS:
            raise InputError(
                f"expected conditions 0, 1 or {_WORLD_CODE}, material < {MATERIAL_CHOICES}, view < {VIEWPOINTS}, "
                f"got {code}, {material}, {view}",
                source=f"recipe {text}",
            )
        return cls(
            map_id=map_id.hex(),
            shape_id=shape_id.hex(),
            material=material,
            view=view,
            conditions=WORLD if code == _WORLD_CODE else code,
            seed=seed,
        )

    @property
    def key(self) -> str:
        """Name of the pair: 16 hexadecimal digits of the bytes' SHA-256."""
        return hashlib.sha256(self.to_bytes()).hexdigest()[:16]

    def rng(self) -> np.random.Generator:
        """Return a fresh generator of random numbers that depends on every field."""
        drawn_from = bytes([DRAWS]) + self.to_bytes()[1:]
        return np.random.default_rng(np.frombuffer(hashlib.sha256(drawn_from).digest(), np.uint32))


def digest(recipes: list[Recipe]) -> str:
    """Return the identity of a list of recipes: SHA-256 over them in order, 16 digits."""
    return hashlib.sha256(b"".join(recipe.to_bytes() for recipe in recipes)).hexdigest()[:16]


def balanced_recipes(store: AssetStore, count: int, seed: int = 2020, conditions: int = 0) -> list[Recipe]:
    """Draw a test set: in turn specular/diffuse, indoor/outdoor, every shape equally often; the rest at random.

    Only one kind of place if the maps have no other.
    """
    if not store.maps or not store.shapes:
        raise InputError(
            f"expected at least one map and one shape, got {len(store.maps)} and {len(store.shapes)}", source="test set"
        )
    ids, shapes = sorted(store.maps), sorted(store.shapes)
    by_place = {place: [i for i in ids if store.maps[i].indoor == place] or ids for place in (True, False)}
    recipes = []
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        places = by_place[bool(k // 2 % 2)]
        recipes.append(
            Recipe(
                map_id=places[rng.integers(len(places))],
                shape_id=shapes[k // 4 % len(shapes)],
                material=k % 2 + 2 * int(rng.random() < 0.4) + 4 * int(rng.integers(2)),
                view=int(rng.integers(VIEWPOINTS)),
                conditions=conditions,
                seed=int.from_bytes(hashlib.sha256(f"{seed} {k}".encode()).digest()[:8], "big"),
            )
        )
    return recipes


def require_assets(recipes: list[Recipe], store: AssetStore, source: str | os.PathLike[str], advice: str) -> None:
    """Raise InputError if maps or shapes of recipes are not in the store; source: the list; advice: what to do."""
    missing = [f"map {key}" for key in dict.fromkeys(one.map_id for one in recipes) if key not in store.maps]
    missing += [f"shape {key}" for key in dict.fromkeys(one.shape_id for one in recipes) if key not in store.shapes]
    if missing:
        others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise InputError(
            f"expected all maps and shapes that its recipes name, got no {missing[0]}{others}; {advice}", source=source
        )


def read_recipes(path: str | os.PathLike[str]) -> list[Recipe]:
    """Read recipes, one a line after a first line `# <digest>`; InputError if the digest differs."""
    try:
        lines = Path(path).read_text(encoding="ascii").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("expected a text file of recipes, one per line, got an unreadable one", source=path) from error
    recipes = [Recipe.from_hex(line.strip()) for line in lines[1:] if line.strip()]
    if lines[0] != f"# {digest(recipes)}":
        raise InputError(
            f"expected the first line '# {digest(recipes)}', got {lines[0][:40]!r}; the list was edited or cut short",
            source=path,
        )
    return recipes
