"""One helper: does a sampler of directions follow the density it claims? (Pearson's chi-square)

The sphere is cut into cells of equal steps in polar angle and azimuth. Counts of
samples in the cells are held against N times the integral of the density, and the
samples that a sampler throws away against the mass the density leaves out.
"""

import math

import numpy as np

SUBSTEPS = (12, 4)
"""Midpoint quadrature points in a cell, polar x azimuth; the polar profile is the steep one."""

MIN_EXPECTED = 5.0
"""Cells that expect fewer samples are pooled: Pearson's statistic needs a few."""


def _expected(pdf, rows: int, columns: int) -> np.ndarray:
    """Integral of the density over every cell, [rows * columns]."""
    i, j = SUBSTEPS
    theta = (np.arange(rows * i) + 0.5) * np.pi / (rows * i)
    phi = (np.arange(columns * j) + 0.5) * 2 * np.pi / (columns * j)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    d = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    mass = pdf(d) * np.sin(t) * (np.pi / (rows * i)) * (2 * np.pi / (columns * j))
    return mass.reshape(rows, i, columns, j).sum(axis=(1, 3)).reshape(-1)


def _observed(d: np.ndarray, rows: int, columns: int) -> np.ndarray:
    theta = np.arccos(np.clip(d[:, 2], -1, 1))
    phi = np.arctan2(d[:, 1], d[:, 0]) % (2 * np.pi)
    row = np.minimum((theta / np.pi * rows).astype(int), rows - 1)
    column = np.minimum((phi / (2 * np.pi) * columns).astype(int), columns - 1)
    return np.bincount(row * columns + column, minlength=rows * columns)


def p_value(statistic: float, freedom: int) -> float:
    """Upper tail of chi-square by Wilson and Hilferty's cube-root normal approximation (1931).

    Good to about 1 % of the tail at the 20 and more degrees of freedom used here.
    """
    spread = 2.0 / (9.0 * freedom)
    z = ((statistic / freedom) ** (1.0 / 3.0) - (1.0 - spread)) / math.sqrt(spread)
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def chi2_p_value(
    sample, pdf, rng: np.random.Generator, count: int = 60_000, rows: int = 60, columns: int = 24
) -> float:
    """Probability of counts at least this far from the density if the sampler were right.

    Args:
        sample: u [N, 2] to unit directions [K, 3], K <= N: samples may be thrown away.
        pdf: unit directions [..., 3] to density [...] in 1/sr.
    """
    kept = sample(rng.random((count, 2)))
    mass = _expected(pdf, rows, columns)
    assert mass.sum() < 1.003, f"the density integrates to {mass.sum():.4f}"
    expected = np.append(mass, max(0.0, 1.0 - mass.sum())) * count
    observed = np.append(_observed(kept, rows, columns), count - len(kept))
    order = np.argsort(expected, kind="stable")
    expected, observed = expected[order], observed[order]
    pooled = int(np.searchsorted(np.cumsum(expected), MIN_EXPECTED)) + 1
    while pooled < len(expected) and expected[pooled] < MIN_EXPECTED:
        pooled += 1
    expected = np.append(expected[pooled:], expected[:pooled].sum())
    observed = np.append(observed[pooled:], observed[:pooled].sum())
    statistic = float(((observed - expected) ** 2 / expected).sum())
    return p_value(statistic, len(expected) - 1)


def assert_follows_pdf(sample, pdf, rng, num_tests: int = 1, significance: float = 0.01, **grid) -> None:
    """Fail if the sampler's p-value is below the Sidak level 1 - (1 - significance)^(1 / num_tests).

    num_tests: how many such tests are run together; without the correction one
    in a hundred of them would fail by chance.
    """
    level = 1.0 - (1.0 - significance) ** (1.0 / num_tests)
    p = chi2_p_value(sample, pdf, rng, **grid)
    assert p > level, f"sampler and density disagree: p = {p:.2e} < {level:.2e}"
