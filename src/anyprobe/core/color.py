"""Colour: linear Rec. 709 primaries, and the way from others to them."""

from __future__ import annotations

import numpy as np

from anyprobe.core import Float, UInt8

REC709 = (0.2126, 0.7152, 0.0722)

REC709_CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""CIE x, y of red, green, blue and white (D65)."""

XYZ_CHROMATICITIES = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
"""The same of files whose red, green and blue hold CIE X, Y, Z."""

COLORSPACES = {"rec709": REC709_CHROMATICITIES, "acescg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)}
"""Linear colour spaces of light in files, by CIE x, y of red, green, blue and white; ACEScg's primaries are AP1."""

SAME_CHROMATICITIES = 1e-3
"""Largest difference of chromaticities that count as the same: files round them."""

STRIP_ROWS = 64
"""Number of rows of a large picture that are converted at a time."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""Matrix from CIE XYZ to cone responses, in which one white is adapted to another."""


def luminance(rgb):
    """Compute relative luminance of linear Rec. 709: [..., 3] -> [...]."""
    return REC709[0] * rgb[..., 0] + REC709[1] * rgb[..., 1] + REC709[2] * rgb[..., 2]


def to_bytes(display: Float[np.ndarray, " ..."]) -> UInt8[np.ndarray, " ..."]:
    """Convert display values in [0, 1] to uint8, rounded; a few rows at a time, to fit the processor's caches."""
    result = np.empty(np.shape(display), np.uint8)
    for top in range(0, len(result), STRIP_ROWS):
        strip = np.asarray(display[top : top + STRIP_ROWS])
        result[top : top + STRIP_ROWS] = np.round(np.clip(strip, 0.0, 1.0) * 255.0)
    return result


def xyz_from_rgb(chromaticities) -> Float[np.ndarray, "3 3"]:
    """Return the matrix [3, 3] from linear RGB to CIE XYZ, white at Y = 1.

    Args:
        chromaticities: [8], CIE x, y of red, green, blue and white; primaries may be imaginary.
    Raises:
        ValueError: the white does not lie between the primaries, or a number is not finite.
    """
    values = np.asarray(chromaticities, dtype=np.float64)
    if values.shape != (8,) or not np.isfinite(values).all():
        raise ValueError("not eight finite numbers")
    x, y = values[0::2], values[1::2]
    columns = np.stack([x, y, 1.0 - x - y])  # [3, 4]: X, Y, Z of each over their sum
    primaries, white = columns[:, :3], columns[:, 3]
    if white[1] <= 0.0:
        raise ValueError("a white without light")
    shares = np.linalg.solve(primaries, white / white[1])  # primaries on one line: LinAlgError, a ValueError
    if (shares <= 0.0).any():
        raise ValueError("a white that is not between the primaries")
    return primaries * shares


def rec709_from_rgb(chromaticities) -> Float[np.ndarray, "3 3"]:
    """Return the matrix [3, 3] from linear RGB to linear Rec. 709, white to white (Bradford); raises as xyz_from_rgb.

    Exactly the identity for the chromaticities of Rec. 709.
    """
    theirs, ours = xyz_from_rgb(chromaticities), xyz_from_rgb(REC709_CHROMATICITIES)
    if np.allclose(chromaticities, REC709_CHROMATICITIES, rtol=0.0, atol=SAME_CHROMATICITIES):
        return np.eye(3)
    white, wanted = BRADFORD @ theirs.sum(axis=1), BRADFORD @ ours.sum(axis=1)
    if (white <= 0.0).any():
        raise ValueError("a white that no eye adapts to")
    adapt = np.linalg.solve(BRADFORD, (wanted / white)[:, None] * BRADFORD)
    return np.linalg.solve(ours, adapt @ theirs)


def from_rec709(rgb: np.ndarray, colorspace: str) -> np.ndarray:
    """Convert linear Rec. 709 [..., 3] to one of COLORSPACES, white to white by Bradford; Rec. 709 is returned
    unchanged."""
    if colorspace == "rec709":
        return rgb
    return rgb @ np.linalg.inv(rec709_from_rgb(COLORSPACES[colorspace])).astype(np.float32).T
