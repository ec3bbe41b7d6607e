"""Orientation of maps in every target: each is a roll of our columns, never a mirror.

Ours is right-handed, +X right, +Y up, -Z in front; u = 0.5 + atan2(x, -z) / 2 pi. A target reads
the same picture with its own axes and its own centre column:

    target          axes (x, y, z) of the target   u, in the target's axes    centre   roll
    front (ours)    ( x,  y,  z)  Y up, right      0.5 + atan2(x, -z) / 2 pi  -Z        0
    three.js        ( x,  y,  z)  Y up, right      0.5 + atan2(z, x) / 2 pi   +X       -W/4
    OpenEXR, USD    ( x,  y,  z)  Y up, right      0.5 - atan2(x, z) / 2 pi   +Z       +W/2
    Mitsuba 3       ( x,  y,  z)  Y up, right      0.5 - atan2(x, z) / 2 pi   +Z       +W/2
    Blender         ( x, -z,  y)  Z up, right      0.5 - atan2(y, x) / 2 pi   +X       -W/4
    Unity           ( x,  y, -z)  Y up, left       0.5 - atan2(z, x) / 2 pi   +X       -W/4
    Unreal          (-z,  x,  y)  Z up, left       0.5 + atan2(x, -y) / 2 pi  -Y       +W/4

v = acos(up) / pi and row 0 is up in all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core import Float
from anyprobe.errors import InvalidEnvironment
from anyprobe.light.harmonics import COSINE_LOBE, K

ODD_IN_Z = (2, 5, 7)
"""Indices of z, yz and xz: they change sign with z."""

ODD_IN_Y = (1, 4, 5)
"""Indices of y, xy and yz."""


def gltf(coefficients: Float[np.ndarray, "9 3"]) -> Float[np.ndarray, "9 3"]:
    """Compute A_l L_i [9, 3], which times Y_i(n) add up to E(n), with the signs of EXT_lights_image_based as Babylon.js
    reads them.

    It expects (-x, y, z) with the signs of Condon and Shortley, which is ours with y negated.
    """
    turned = coefficients * COSINE_LOBE[:, None]
    turned[list(ODD_IN_Y)] *= -1
    return turned


def polynomial(coefficients: Float[np.ndarray, "9 3"]) -> Float[np.ndarray, "9 3"]:
    """Compute A_l K_i L_i / pi [9, 3]: E(n) / pi = c0 + c1 y + c2 z + c3 x + c4 xy + ...

    The polynomials are those of anyprobe.light.harmonics, 3z^2 - 1 and x^2 - y^2 among them.
    Uniform radiance 1 gives c0 = 1 (Filament's IndirectLight.irradiance(3, sh)).
    """
    return coefficients * (COSINE_LOBE * K / np.pi)[:, None]


def unity(coefficients: Float[np.ndarray, "9 3"]) -> Float[np.ndarray, "3 9"]:
    """Compute SphericalHarmonicsL2[channel, i] [3, 9]: polynomial() with z negated."""
    turned = polynomial(coefficients)
    turned[list(ODD_IN_Z)] *= -1
    return turned.T


@dataclass(frozen=True, kw_only=True, slots=True)
class TargetFrame:
    """Axes of a target and the layout of its latitude-longitude maps.

    axes: rows of the matrix from our coordinates to the target's; its determinant is -1 if the target is left-handed.
    quarters: roll of our map's columns to the right, in quarters of its width.
    text, u, v: for sidecars and docs; u and v from a direction (x, y, z) in the target's axes.
    """

    axes: tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]
    quarters: int
    text: str
    u: str
    v: str

    def from_ours(self, d: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
        """Convert directions [..., 3] in our axes to the target's."""
        return np.asarray(d) @ np.asarray(self.axes, dtype=np.float64).T

    def roll(self, radiance: Float[np.ndarray, "H 2*H 3"]) -> Float[np.ndarray, "H 2*H 3"]:
        """Roll a map [H, 2H, 3] into the target's layout.

        Raises:
            InvalidEnvironment: a quarter of the width is not a whole number of columns.
        """
        width = radiance.shape[1]
        if width * self.quarters % 4:
            raise InvalidEnvironment(
                f"expected a width that 4 divides, to be turned by a quarter, got {width}; "
                "resize the map to an even height",
                subject="map",
            )
        return np.roll(radiance, width * self.quarters // 4, axis=1)


FRONT = TargetFrame(
    axes=((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    quarters=0,
    text="right-handed, +X right, +Y up, -Z in front",
    u="0.5 + atan2(x, -z) / 2 pi",
    v="acos(y) / pi",
)
THREE = replace(FRONT, quarters=-1, u="0.5 + atan2(z, x) / 2 pi")
OPENEXR = replace(FRONT, quarters=2, u="0.5 - atan2(x, z) / 2 pi")
BLENDER = TargetFrame(
    axes=((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    quarters=-1,
    text="right-handed, +X right, +Z up, +Y in front",
    u="0.5 - atan2(y, x) / 2 pi",
    v="acos(z) / pi",
)
UNITY = replace(
    FRONT,
    axes=((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    quarters=-1,
    text="left-handed, +X right, +Y up, +Z in front",
    u="0.5 - atan2(z, x) / 2 pi",
)
UNREAL = TargetFrame(
    axes=((0, 0, -1), (1, 0, 0), (0, 1, 0)),
    quarters=1,
    text="left-handed, +Y right, +Z up, +X in front",
    u="0.5 + atan2(x, -y) / 2 pi",
    v="acos(z) / pi",
)
