"""BC6H: blocks of 4 x 4 HDR texels in 16 bytes, unsigned; only its mode of one line a block.

That mode holds two colours of 3 x 10 bits and, for every texel, one of 16 places between them, in
the bits of half floats, which run like a logarithm: a step of an endpoint is about 2 %.
"""

from __future__ import annotations

import numpy as np

BC6H_MAX = 65504.0
BLOCKS = 1 << 12
"""Encoded at once, some 10 kB each."""

MODE = 0b00011
WEIGHTS = np.array([0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64])
"""Sixty-fourths of the second endpoint, from the format's definition."""


def encode_bc6h(faces: np.ndarray) -> np.ndarray:
    """Faces [6, S, S, 3] >= 0 to blocks [6, ceil(S/4)^2, 16] uint8, row by row.

    A face smaller than a block is repeated to fill it.
    """
    size = faces.shape[1]
    if size % 4:
        repeats = -(-4 // size)
        faces, size = np.tile(faces, (1, repeats, repeats, 1))[:, :4, :4], 4
    side = size // 4
    texels = faces.reshape(6, side, 4, side, 4, 3).transpose(0, 1, 3, 2, 4, 5).reshape(-1, 16, 3)
    parts = [_encode(texels[at : at + BLOCKS]) for at in range(0, len(texels), BLOCKS)]
    return np.concatenate(parts).reshape(6, side * side, 16)


def _encode(texels: np.ndarray) -> np.ndarray:
    """Texels [B, 16, 3] to blocks [B, 16] uint8."""
    halfs = np.clip(texels, 0.0, BC6H_MAX).astype(np.float16).view(np.uint16).astype(np.float64)
    values = halfs * 64.0 / 31.0  # the scale that endpoints are unpacked to
    first, second = _endpoints(values)
    index = _nearest(values, first, second)
    first, second = _refined(values, index, first, second)
    index = _nearest(values, first, second)
    swap = index[:, 0] >= 8  # the first texel's place is kept in three bits
    first[swap], second[swap] = second[swap].copy(), first[swap].copy()
    index[swap] = 15 - index[swap]
    blocks = [_pack(*block) for block in zip(first.tolist(), second.tolist(), index.tolist(), strict=True)]
    return np.frombuffer(b"".join(blocks), np.uint8).reshape(-1, 16)


def unpack_endpoint(code: np.ndarray) -> np.ndarray:
    """10-bit codes to 16 bits, as the format unpacks them."""
    code = np.asarray(code)
    return np.where(code == 0, 0, np.where(code == 1023, 0xFFFF, ((code << 16) + 0x8000) >> 10))


def _codes(values: np.ndarray) -> np.ndarray:
    """The 10-bit codes whose unpacked values lie nearest."""
    return np.clip(np.floor(values / 64.0), 0, 1023).astype(np.int64)


def _endpoints(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the texels' spread along their main axis: [B, 16, 3] -> codes [B, 3], [B, 3]."""
    mean = values.mean(axis=1, keepdims=True)
    spread = values - mean
    _, axes = np.linalg.eigh(np.einsum("bic,bid->bcd", spread, spread))
    axis = axes[:, :, -1]
    along = np.einsum("bic,bc->bi", spread, axis)
    low, high = along.min(axis=1)[:, None], along.max(axis=1)[:, None]
    return _codes(mean[:, 0] + low * axis), _codes(mean[:, 0] + high * axis)


def _palette(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The 16 colours between two endpoints, [B, 16, 3], as the format mixes them."""
    a, b = unpack_endpoint(first)[:, None], unpack_endpoint(second)[:, None]
    weights = WEIGHTS[None, :, None]
    return (a * (64 - weights) + b * weights + 32) >> 6


def _nearest(values: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Place of every texel, [B, 16]."""
    distance = values[:, :, None, :] - _palette(first, second)[:, None]
    return np.argmin((distance**2).sum(axis=-1), axis=-1)


def _refined(
    values: np.ndarray, index: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Endpoints that fit the texels at their places best, by least squares."""
    w = WEIGHTS[index] / 64.0
    aa, ab, bb = ((1 - w) ** 2).sum(1), (w * (1 - w)).sum(1), (w**2).sum(1)
    determinant = aa * bb - ab**2
    ok = determinant > 1e-6  # else all texels share a place
    a = np.einsum("bi,bic->bc", 1 - w, values)
    b = np.einsum("bi,bic->bc", w, values)
    scale = np.where(ok, determinant, 1.0)[:, None]
    better_first = _codes((a * bb[:, None] - b * ab[:, None]) / scale)
    better_second = _codes((b * aa[:, None] - a * ab[:, None]) / scale)
    return np.where(ok[:, None], better_first, first), np.where(ok[:, None], better_second, second)


def _pack(first: list[int], second: list[int], index: list[int]) -> bytes:
    """One block: mode, r g b of the first endpoint, of the second, then 3 + 15 x 4 bits of places."""
    bits, at = MODE, 5
    for code in (*first, *second):
        bits |= code << at
        at += 10
    for place, width in zip(index, (3, *[4] * 15), strict=True):
        bits |= place << at
        at += width
    return bits.to_bytes(16, "little")
