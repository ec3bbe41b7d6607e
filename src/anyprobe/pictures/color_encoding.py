"""Colour encodings of pictures: primaries and transfer function, by code points or by numbers, to linear Rec. 709.

Code points are those of ITU-T H.273 (CICP), which PNG (cICP), HEIC, AVIF and JPEG XL (nclx) and video share. Diffuse
white is 1: PQ has it at 203 cd/m2, HLG at a signal of 0.75 (ITU-R BT.2408). HLG is decoded to the light of the scene,
without the opto-optical transfer function of a display.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from anyprobe.core.color import REC709_CHROMATICITIES, rec709_from_rgb

WHITE_NITS = 203.0
"""Luminance of diffuse white in PQ, cd/m2 (ITU-R BT.2408)."""

PQ, HLG, UNSPECIFIED = 16, 18, 2
"""Code points of H.273: two transfer functions, and `unspecified` for primaries as for transfer."""

D65 = (0.3127, 0.3290)

PRIMARIES = {
    **dict.fromkeys((1, 2), REC709_CHROMATICITIES),
    5: (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, *D65),
    **dict.fromkeys((6, 7), (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, *D65)),
    9: (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *D65),
    12: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *D65),
}
"""CIE x, y of red, green, blue and white by H.273's code point; unspecified ones count as Rec. 709.

Those of film, of the first colour television and of cinema projectors are left out: no camera writes them."""

ADOBE_RGB = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, *D65)

STRIP_PIXELS = 1 << 20
"""Number of pixels of a large picture that are converted at once."""

SAME = 1.2 / 255
"""Largest difference of display values between encodings that count as the same: sRGB profiles round its curve and
primaries."""


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """Decode sRGB values (IEC 61966-2-1) to linear light; odd around 0."""
    size = np.abs(values)
    return np.sign(values) * np.where(size <= 0.04045, size / 12.92, ((size + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """Encode linear light >= 0 as sRGB values; the inverse of srgb_to_linear."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


def _pq(values: np.ndarray) -> np.ndarray:
    """Decode SMPTE ST 2084 to light in units of WHITE_NITS."""
    v = np.clip(values, 0.0, 1.0).astype(np.float64) ** (32 / 2523)
    return 10_000.0 / WHITE_NITS * (np.maximum(v - 3424 / 4096, 0.0) / (2413 / 128 - 2392 / 128 * v)) ** (16384 / 2610)


def _hlg(values: np.ndarray) -> np.ndarray:
    """Decode ARIB STD-B67 to the light of the scene, in units of that at a signal of 0.75."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    v = np.clip(values, 0.0, 1.0)
    scene = np.where(v <= 0.5, v**2 / 3, (np.exp((np.maximum(v, 0.5) - c) / a) + b) / 12)
    return scene / ((np.exp((0.75 - c) / a) + b) / 12)


def gamma(exponent: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the power function with this exponent, 0 below 0."""
    return lambda values: np.clip(values, 0.0, None) ** exponent


TRANSFERS: dict[int, Callable[[np.ndarray], np.ndarray]] = {
    **dict.fromkeys((1, 2, 6, 11, 12, 13, 14, 15), srgb_to_linear),
    4: gamma(2.2),
    8: lambda values: values,
    PQ: _pq,
    HLG: _hlg,
}
"""Functions from code values in [0, 1] to linear light, by H.273's code point.

BT.709 and its kin are what cameras write; screens, browsers and this package show them as sRGB. Those of PAL's
tubes, of SMPTE 240M, of cinema projectors and logarithmic ones are left out.
"""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ColorEncoding:
    """Colour encoding of a picture.

    Attributes:
        matrix: [3, 3] from its linear light to linear Rec. 709.
        decode: function from its code values in [0, 1] to linear light, diffuse white at 1.
        is_hdr: whether it holds light above diffuse white.
    """

    matrix: np.ndarray
    decode: Callable[[np.ndarray], np.ndarray]
    is_hdr: bool = False

    def linear(self, values: np.ndarray) -> np.ndarray:
        """Decode code values [..., 3] to linear Rec. 709 float32, below 0 where a colour lies outside of it."""
        return (self.decode(values) @ self.matrix.T).astype(np.float32)


@lru_cache(maxsize=64)
def by_code_points(primaries: int, transfer: int, full_range: bool = True, bits: int = 8) -> ColorEncoding | None:
    """Return the encoding of H.273's code points; None where one is reserved or left out.

    Args:
        full_range: whether 0 and 1 are black and white; else 16 and 235 of 255 are, scaled to `bits`.
        bits: of a code value.
    """
    if primaries not in PRIMARIES or transfer not in TRANSFERS:
        return None
    decode = TRANSFERS[transfer]
    if not full_range:
        narrow, step = TRANSFERS[transfer], 2.0 ** (bits - 8)
        top = 2.0**bits - 1

        def decode(values: np.ndarray) -> np.ndarray:
            return narrow(np.clip((values * top - 16 * step) / (219 * step), 0.0, None))

    return ColorEncoding(matrix=rec709_from_rgb(PRIMARIES[primaries]), decode=decode, is_hdr=transfer in (PQ, HLG))


def by_numbers(chromaticities: tuple[float, ...] | None, exponent: float | None) -> ColorEncoding | None:
    """Return the encoding with these primaries and white (CIE x, y) and decoding exponent; None stands for sRGB's.

    Returns:
        None where the primaries are impossible.
    """
    with suppress(ValueError):
        matrix = rec709_from_rgb(REC709_CHROMATICITIES if chromaticities is None else chromaticities)
        return ColorEncoding(matrix=matrix, decode=srgb_to_linear if exponent is None else gamma(exponent))
    return None


def is_srgb(encoding: ColorEncoding) -> bool:
    """Return whether its code values are sRGB display values already, up to the rounding of profiles."""
    ramp = np.linspace(0.0, 1.0, 33)[:, None]
    values = (np.array([[1, 1, 1], [1, 0.5, 0.5], [0.5, 1, 0.5], [0.5, 0.5, 1]])[:, None] * ramp).reshape(-1, 3)
    linear = encoding.linear(values)
    return not encoding.is_hdr and bool((np.abs(linear_to_srgb(np.clip(linear, 0, 1)) - values) < SAME).all())


def is_linear(encoding: ColorEncoding) -> bool:
    """Return whether its code values are proportional to light."""
    ramp = np.linspace(0.0, 1.0, 33, dtype=np.float32)[:, None].repeat(3, axis=1)
    return bool(np.allclose(encoding.decode(ramp), ramp, atol=2e-3))


def to_display(values: np.ndarray, encoding: ColorEncoding) -> tuple[np.ndarray, np.ndarray | None]:
    """Convert code values [H, W] or [H, W, 3] of any type to display values, and to radiance if the encoding is HDR.

    Integers span 0 to their type's maximum.

    Returns:
        sRGB [H, W, 3] float32 in [0, 1]; and linear Rec. 709 radiance [H, W, 3], or None.
    """
    linear_of, matrix = _decoder(values.dtype, encoding), encoding.matrix.T.astype(np.float32)
    display = np.empty((*values.shape[:2], 3), np.float32)
    radiance = np.empty_like(display) if encoding.is_hdr else None
    step = max(1, STRIP_PIXELS // max(values.shape[1], 1))
    for top in range(0, len(values), step):
        rows = slice(top, top + step)
        linear = np.maximum(linear_of(values[rows]) @ matrix, np.float32(0))
        display[rows] = linear_to_srgb(np.minimum(linear, np.float32(1)))
        if radiance is not None:
            radiance[rows] = linear
    return display, radiance


def _decoder(kind: np.dtype, encoding: ColorEncoding) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from code values [H, W] or [H, W, 3] to linear light [H, W, 3] float32; integers by table."""
    if kind.kind == "f":
        return lambda values: encoding.decode(_three(values).astype(np.float32)).astype(np.float32)
    ramp = np.linspace(0.0, 1.0, np.iinfo(kind).max + 1, dtype=np.float32)[:, None].repeat(3, axis=1)
    table = encoding.decode(ramp).astype(np.float32)
    return lambda values: np.stack([table[:, k][_three(values)[..., k]] for k in range(3)], axis=-1)


def _three(values: np.ndarray) -> np.ndarray:
    return np.broadcast_to(values[..., None], (*values.shape, 3)) if values.ndim == 2 else values
