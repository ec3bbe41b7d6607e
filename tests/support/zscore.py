"""Are two noisy pictures of the same thing? A z-test in every pixel, Sidak-corrected.

    z = (a - b) / sqrt(var a + var b + (tolerance of the mean)^2)

after Mitsuba 3's own render tests. var is that of a picture's mean. Estimated from R replicates it
follows Student's t, not the normal, which at p = 1e-7 is the difference between 5.2 and 5.8
for R = 64; Wallace's transformation carries t to z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np
import OpenEXR
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response


@dataclass(frozen=True, kw_only=True)
class Measured:
    """mean [P, 3], the variance of that mean [P, 3], and its degrees of freedom."""

    mean: np.ndarray
    variance: np.ndarray
    freedom: float


def measured(replicates: np.ndarray, largest: np.ndarray | float = 0.0, rare: float = 10.0) -> Measured:
    """From independent replicates [R, P, 3].

    largest: what the brightest single sample could add to the mean, [P, 3]. Where an emitter is
    hit by a few samples in a hundred thousand, the replicates may all have missed it and
    vary by nothing; the variance of `rare` such hits is therefore always added. With 10
    the chance of k hits where many more are due, P(k | lambda) with (lambda - k)^2 >
    5.2^2 (k + 10), stays below 4e-6 for every lambda.
    """
    count = len(replicates)
    variance = replicates.var(axis=0, ddof=1, dtype=np.float64) / count + rare * np.square(largest)
    return Measured(mean=replicates.mean(axis=0, dtype=np.float64), variance=variance, freedom=count - 1.0)


def z_of_t(t: np.ndarray, freedom: np.ndarray | float) -> np.ndarray:
    """The normal deviate with the tail of Student's t (Wallace 1959, good to 0.3 % from 15 degrees on)."""
    n = np.asarray(freedom, np.float64)
    return np.sign(t) * (8 * n + 1) / (8 * n + 3) * np.sqrt(n * np.log1p(np.square(t) / n))


def z_scores(ours: Measured, theirs: Measured, tolerance: float, floor: float = 0.0) -> np.ndarray:
    """[P, 3]. tolerance: relative, of the two pictures' mean; floor: absolute."""
    exact = np.square(tolerance * (ours.mean + theirs.mean) / 2) + floor**2
    total = ours.variance + theirs.variance + exact
    t = (ours.mean - theirs.mean) / np.sqrt(np.maximum(total, 1e-30))
    # Welch and Satterthwaite: the tolerance is known, not estimated
    estimated = ours.variance**2 / ours.freedom + theirs.variance**2 / theirs.freedom
    return z_of_t(t, total**2 / np.maximum(estimated, 1e-60))


def sidak_limit(num_tests: int, significance: float = 0.01) -> float:
    """|z| that num_tests right pixels together exceed anywhere with the given probability."""
    level = -math.expm1(math.log1p(-significance) / num_tests)
    return NormalDist().inv_cdf(1.0 - level / 2.0)


def p_values(z: np.ndarray) -> np.ndarray:
    """Two-sided."""
    return np.vectorize(math.erfc)(np.abs(z) / math.sqrt(2.0))


def assert_same_picture(
    ours: Measured,
    theirs: Measured,
    mask: np.ndarray,
    *,
    tolerance: float,
    num_tests: int,
    folder: Path,
    floor: float = 0.0,
) -> float:
    """Fail where a pixel of mask [S, S] differs by more than chance; the largest |z| otherwise.

    The pictures then lie in the folder: ours, theirs, difference, p_value (.exr) and
    all four in one row, verdict.png.
    """
    z = z_scores(ours, theirs, tolerance, floor)
    worst, limit = float(np.abs(z).max()), sidak_limit(num_tests)
    if worst <= limit:
        return worst
    pictures = {"ours": ours.mean, "theirs": theirs.mean, "difference": ours.mean - theirs.mean, "p_value": p_values(z)}
    _write(folder, mask, pictures)
    bad = np.abs(z) > limit
    at = np.unravel_index(np.abs(z).argmax(), z.shape)
    row, column = np.argwhere(mask)[at[0]]
    change = float(np.sqrt(np.mean((ours.mean - theirs.mean) ** 2)) / theirs.mean.mean())
    raise AssertionError(
        f"{bad.any(axis=1).sum()} of {len(z)} pixels differ beyond |z| = {limit:.2f}; worst |z| = {worst:.1f} "
        f"at row {row}, column {column}: ours {ours.mean[at]:.5g}, theirs {theirs.mean[at]:.5g}; "
        f"RMS difference {100 * change:.2f} % of the mean; mean {ours.mean.mean() / theirs.mean.mean():.4f} "
        f"of theirs; pictures in {folder}"
    )


def _write(folder: Path, mask: np.ndarray, pictures: dict[str, np.ndarray]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    spread = np.abs(pictures["difference"]).max()
    shown = {
        "ours": response(pictures["ours"]),
        "theirs": response(pictures["theirs"]),
        "difference": 0.5 + 0.5 * pictures["difference"] / max(spread, 1e-12),
        "p_value": 1.0 + np.log10(np.maximum(pictures["p_value"], 1e-12)) / 12.0,
    }
    row = np.zeros((mask.shape[0], 4, mask.shape[1], 3), np.float32)
    for k, (name, values) in enumerate(pictures.items()):
        picture = np.zeros((*mask.shape, 3), np.float32)
        picture[mask] = values
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": picture}).write(str(folder / f"{name}.exr"))
        row[:, k][mask] = np.clip(shown[name], 0.0, 1.0)
    strip = Image.fromarray(to_bytes(row.reshape(mask.shape[0], -1, 3)))
    strip.resize((strip.width * 6, strip.height * 6), Image.Resampling.NEAREST).save(folder / "verdict.png")
