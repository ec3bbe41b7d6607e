"""The twenty bytes that a pair is rendered from, and its name."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass

import numpy as np

from anyprobe.errors import InputError

VERSION = 2
"""Raised whenever the same fields would give another pair."""
DRAWS = 1
"""Raised whenever other scenes would be drawn; a better renderer alone shows the same ones anew."""

KINDS = ("object", "map")
NO_SHAPE = "00000000"
VIEWPOINTS = 23
"""Camera positions on the upper hemisphere, as in the paper's Sect. 3.5."""
MATERIALS = 8
EXPOSURES = 5
WORLD = 2
"""Conditions of photos with the priors of dataset.priors, flawed as the world gives them."""

_LAYOUT = struct.Struct(">BB4s4sBBQ")


@dataclass(frozen=True, kw_only=True, slots=True)
class Recipe:
    """What one pair is made of; the same recipe gives the same pair bit for bit on the CPU.

    kind: "object" for photo and irradiance, "map" for an LDR map and its ln radiance.
    map_id, shape_id: 8 hexadecimal digits, the assets' names in a Stock.
    material: for objects 0 to 7: bit 0 diffuse rather than specular, bit 1 metal, bit 2 a
        second draw of the two, or under WORLD bits 0 and 1 the kind of priors.KINDS, bit 2 the
        brighter half of that kind; for maps the exposure's number, 0 to 4.
    view: Fibonacci viewpoint, 0 to 22.
    conditions: 0 for the paper's clean photos, 1 for photos as the world gives them, WORLD (objects
        alone) for these with the world's materials, metering and white balance.
    seed: all else is drawn from it and from the fields above.
    """

    kind: str
    map_id: str
    shape_id: str = NO_SHAPE
    material: int
    view: int
    conditions: int = 0
    seed: int

    def to_bytes(self) -> bytes:
        """Version, kind and conditions, map, shape, material, view, seed; big-endian."""
        return _LAYOUT.pack(
            VERSION,
            2 * KINDS.index(self.kind) + (4 if self.conditions == WORLD else self.conditions),
            bytes.fromhex(self.map_id),
            bytes.fromhex(self.shape_id),
            self.material,
            self.view,
            self.seed,
        )

    def to_hex(self) -> str:
        """40 hexadecimal digits."""
        return self.to_bytes().hex()

    @classmethod
    def from_hex(cls, text: str) -> Recipe:
        """Inverse of to_hex; raises InputError on anything else."""
        try:
            version, flags, map_id, shape_id, material, view, seed = _LAYOUT.unpack(bytes.fromhex(text))
        except (ValueError, struct.error) as error:
            raise InputError(
                f"recipe {text[:48]!r}: expected {2 * _LAYOUT.size} hexadecimal digits, got {len(text)} characters"
            ) from error
        if version != VERSION:
            raise InputError(
                f"recipe {text}: expected version {VERSION}, got {version}; use the release that wrote it"
            )
        kind = flags // 2 % 2
        count = EXPOSURES if kind else MATERIALS
        if flags > 4 or material >= count or view >= VIEWPOINTS:
            raise InputError(
                f"recipe {text}: expected kind < 2, material < {count}, view < {VIEWPOINTS}, "
                f"got {kind if flags < 5 else flags // 2}, {material}, {view}"
            )
        return cls(
            kind=KINDS[kind],
            map_id=map_id.hex(),
            shape_id=shape_id.hex(),
            material=material,
            view=view,
            conditions=WORLD if flags == 4 else flags % 2,
            seed=seed,
        )

    @property
    def key(self) -> str:
        """The pair's name: 16 hexadecimal digits of the bytes' SHA-256."""
        return hashlib.sha256(self.to_bytes()).hexdigest()[:16]

    def rng(self) -> np.random.Generator:
        """A fresh stream of random numbers that depends on every field."""
        drawn_from = bytes([DRAWS]) + self.to_bytes()[1:]
        return np.random.default_rng(np.frombuffer(hashlib.sha256(drawn_from).digest(), np.uint32))


def digest(recipes: list[Recipe]) -> str:
    """The identity of a whole set: SHA-256 over the recipes in order, 16 digits."""
    return hashlib.sha256(b"".join(recipe.to_bytes() for recipe in recipes)).hexdigest()[:16]
