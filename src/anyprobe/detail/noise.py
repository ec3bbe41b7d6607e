"""Textures without pieces that could be recognised: what is seen, convolved with white noise.

After Galerne, Gousseau and Morel 2011, "Random phase textures": the result has the power spectrum of the texture and
random phases.
"""

from __future__ import annotations

import numpy as np

WIDEST = 14
"""Waves around a row below which its variation is left to the estimate."""


def along_rows(texture: np.ndarray, weight: np.ndarray, seed: int) -> np.ndarray:
    """Make noise [H, W, C] that is periodic along rows from a texture [H, W, C] times its weights [H, W].

    The same random row convolves every row: what stands upright stays upright. A row's power is that of its seen part.
    """
    width = texture.shape[1]
    noise = np.random.default_rng(seed).normal(0.0, 1.0, width)
    waves = np.fft.rfft(texture, axis=1)
    kernel = np.fft.rfft(noise) * (1 - np.exp(-((np.arange(waves.shape[1]) / WIDEST) ** 2)))
    count = weight.sum(axis=1)
    result = np.fft.irfft(waves * kernel[None, :, None], n=width, axis=1)
    return (result / np.sqrt(np.maximum(count, 1.0))[:, None, None]).astype(np.float32)


def of_patch(patch: np.ndarray, weight: np.ndarray, size: int, seed: int) -> np.ndarray:
    """Make periodic noise [size, size, C] from a patch [h, w, C] of zero mean with weights [h, w]."""
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (size, size))
    waves = np.fft.rfft2(patch * weight[..., None], s=(size, size), axes=(0, 1))
    result = np.fft.irfft2(waves * np.fft.rfft2(noise)[..., None], s=(size, size), axes=(0, 1))
    return (result / np.sqrt(max(float((weight**2).sum()), 1.0))).astype(np.float32)
