"""Plausible detail: the structure of a library's best match under the light of an estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.spelling import did_you_mean
from anyprobe.detail.blend import blend
from anyprobe.detail.kinds import OPEN_AIR
from anyprobe.errors import InputError
from anyprobe.light.environment import MAP_HEIGHT, check_radiance
from anyprobe.match.alignment import Match, find_level_match
from anyprobe.match.kind import own_prices, prices
from anyprobe.match.library import Library
from anyprobe.match.library_folder import open_library

DETAILS = ("none", "plausible")
SIZES = (64, 128, 256, 512)
"""Supported numbers of rows of a map with detail."""
ROWS = SIZES[-1]
OTHER_KIND = 10.0
"""Penalty of a place of another kind, in units of match.alignment.Match.distance: there must be no other to take it."""


def check_detail(detail: str) -> bool:
    """Return whether detail is requested; InputError where the word is none of DETAILS."""
    if detail not in DETAILS:
        raise InputError(
            f"expected one of {', '.join(DETAILS)}, got {detail!r}{did_you_mean(detail, DETAILS)}", subject="detail"
        )
    return detail != DETAILS[0]


def check_rows(rows: int, sizes: Sequence[int] = SIZES) -> None:
    """Raise InputError if a map with detail, or another of these sizes, cannot have so many rows."""
    if rows not in sizes:
        raise InputError(
            f"expected one of {', '.join(map(str, sizes))} rows, got {rows}; choose another", subject="size"
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Detailed:
    """A map with detail: radiance [rows, 2 rows, 3]; name of the candidate; seed as given; the library's warnings."""

    radiance: np.ndarray
    name: str
    seed: int
    warnings: tuple[str, ...] = ()

    def info(self) -> dict[str, str | int]:
        """Entries for a sidecar."""
        return {"kind": "plausible", "from": self.name, "seed": self.seed}


def add_detail(
    radiance: np.ndarray,
    confidence: np.ndarray | None = None,
    *,
    library: Library | str | Path | None = None,
    rows: int = ROWS,
    seed: int = 0,
    seen: np.ndarray | None = None,
    kind: str | None = None,
    is_backdrop: bool | None = None,
    level_from_map: np.ndarray | None = None,
) -> Detailed:
    """Add the detail of a real place to an estimate's map; the same input gives the same bits.

    Args:
        radiance: [H, 2H, 3] linear, in the photo's exposure units.
        confidence: [H, 2H] in [0, 1]: weight of each direction in the choice.
        library: result of open_library, or a folder of .exr and .hdr maps; None: our own rooms, streets and studios.
        rows: one of SIZES.
        seed: 0 picks the best candidate, 1 the next, and so on.
        seen: [rows, 2 rows, 4 or 5] known surroundings, see detail.blend.
        kind: of the place, one of detail.kinds; None: unknown.
        is_backdrop: whether the photo shows one colour, or nothing, beside its object, as in a studio; None: unknown.
        level_from_map: [3, 3] rotation to a frame whose +Y is up in the place; None: +Y is up in the map.
    Raises:
        InvalidEnvironment, InputError: bad arguments, in one line that says what to do.
    """
    check_rows(rows)
    if seed < 0:
        raise InputError(f"expected 0 or more, got {seed}; 0 takes the best match", subject="seed")
    radiance = check_radiance(radiance, "estimate")
    if len(radiance) < MAP_HEIGHT:
        raise InputError(
            f"expected at least {MAP_HEIGHT} rows, got {len(radiance)}; take the map as it was estimated",
            subject="estimate",
        )
    library = library if isinstance(library, Library) else open_library(library)
    turn = np.eye(3) if level_from_map is None else level_from_map
    match = find_place(radiance, confidence, library, turn, kind=kind, is_backdrop=is_backdrop, seed=seed)
    detailed = blend(radiance, library.candidate(match.index), match.candidate_from_estimate, match.ln_gain, rows, seen)
    return Detailed(radiance=detailed, name=match.name, seed=seed, warnings=library.warnings)


def find_place(
    radiance: np.ndarray,
    confidence: np.ndarray | None,
    library: Library,
    level_from_map: np.ndarray,
    *,
    kind: str | None,
    is_backdrop: bool | None = None,
    seed: int = 0,
) -> Match:
    """Find the place of a library that an estimate [H, 2H, 3] may be of; arguments as of add_detail."""
    outdoors = None if kind is None else kind == OPEN_AIR
    asked = prices(outdoors, library, OTHER_KIND) + own_prices(library, OTHER_KIND, is_backdrop)
    return find_level_match(radiance, confidence, library, level_from_map, seed, asked)
