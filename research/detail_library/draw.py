"""Make the library that anyprobe.detail comes with, of rooms, gardens, streets and studios of our own:

    python -m research.detail_library.draw src/anyprobe/match/own.zip

The same seed gives the same maps on the same machine; about ten minutes of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from anyprobe.match.library import OPEN_AIR_NAME, STREET_NAME, STUDIO_NAME, encode, write_library
from research.detail_library.outdoors import detailed_outdoor
from research.detail_library.rooms import detailed_room, detailed_studio

KINDS = {
    "room": (detailed_room, 24),
    f"{OPEN_AIR_NAME}-park": (partial(detailed_outdoor, kind="park"), 6),
    f"{OPEN_AIR_NAME}-land": (partial(detailed_outdoor, kind="land"), 4),
    STREET_NAME: (partial(detailed_outdoor, kind="street"), 4),
    STUDIO_NAME: (detailed_studio, 6),
}
"""What is drawn, and how many of each."""
SEED = 28
ROWS = 256


def main() -> None:
    """Draw all maps and write the file."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("path", type=Path)
    arguments.add_argument("--processes", type=int, default=2)
    options = arguments.parse_args()
    write_library(options.path, _maps(options.processes))


def _maps(processes: int) -> Iterator[tuple[str, bytes]]:
    names = [(kind, number) for kind, (_, count) in KINDS.items() for number in range(count)]
    with ProcessPoolExecutor(processes) as pool:
        for (kind, number), picture in zip(names, pool.map(_draw, names), strict=True):
            yield f"{kind}-{number}", picture


def _draw(name: tuple[str, int]) -> bytes:
    kind, number = name
    return encode(KINDS[kind][0](np.random.default_rng((SEED, list(KINDS).index(kind), number)), ROWS))


if __name__ == "__main__":
    main()
