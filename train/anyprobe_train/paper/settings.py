"""Sizes of a whole reproduction: full, in a quarter and a 24th of the steps, in ten minutes, and in one for tests."""

from dataclasses import dataclass

from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """Sizes of one reproduction.

    side, rows: of photos [side, side] and of maps [rows, 2 rows]. width, code: of the networks.
    rings: of normals from the eye's direction to the silhouette; there are four times as many around it.
    light_rows: of the maps that light the objects.
    own_maps: procedural ones that join the measured ones. most: of measured maps, and of shapes, of a folder.
    share: of each piece's steps (pieces.PIECES). batch: pairs a step.
    scored, table_pairs: pairs of each kind that are scored as a run goes, and for Table 1.
    log_every, score_every: steps.
    """

    side: int = 128
    rows: int = 64
    width: int = 32
    code: int = 320
    rings: int = 48
    light_rows: int = 64
    own_maps: int = 200
    most: int | None = None
    share: float = 1.0
    batch: int = 16
    scored: int = 300
    table_pairs: int = 1000
    log_every: int = 500
    score_every: int = 1000


SETTINGS = {
    "full": Setting(),
    "quarter": Setting(share=0.25),
    "short": Setting(share=1 / 24),
    "small": Setting(
        side=64, rows=32, width=12, code=64, rings=24, own_maps=8, most=16, share=0.004, scored=64,
        table_pairs=200, log_every=50, score_every=200,
    ),
    "tiny": Setting(
        side=32, rows=16, width=4, code=16, rings=8, light_rows=32, own_maps=3, most=2, share=0.0001, batch=4, scored=8,
        table_pairs=16, log_every=2, score_every=4,
    ),
}  # fmt: skip
"""full: what is to be published. quarter: a quarter of its steps (`ours` ships). short: a 24th. small: everything
within ten minutes of two cores. tiny: within a minute."""


def setting_named(name: str) -> Setting:
    """Return one of SETTINGS; InputError lists them."""
    if name not in SETTINGS:
        text = f"expected one of {', '.join(SETTINGS)}, got {name!r}{did_you_mean(name, list(SETTINGS))}"
        raise InputError(text, subject="setting")
    return SETTINGS[name]
