"""What the methods of result files are called on a page."""

from __future__ import annotations

NAMES = {
    "irradiance_2": "irradiance, second seed",
    "ours_2": "ours, second seed",
    "georgoulis": "Georgoulis et al., direct, retrained",
    "meka": "Meka et al., retrained, true normals",
    "lift_normals": "lift, true normals",
    "lift_spread": "lift, lamps spread",
    "mean map": "mean map (no network)",
    "chrome ball": "chrome ball (no network)",
}


def named(design: str) -> str:
    """How a row is called."""
    return NAMES.get(design, design)
