"""Figures with standard errors where photos share a map or an object, and so err together."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np

SAMPLES = 400
SAID_SHARE = 2 / 3
"""Of the errors that a said error is meant not to be exceeded in."""


def with_error(
    of: Callable[..., float], clusters: Sequence[Hashable], *columns: Sequence[float] | np.ndarray
) -> tuple[float, float]:
    """Return a figure of columns [N] and its standard error, by a bootstrap over clusters [N].

    Whole clusters are drawn; the spread of G of them is a factor sqrt(G / (G - 1)) too small, which is put right. NaN
    for one cluster, which does not tell.
    """
    given = [np.asarray(column) for column in columns]
    names = list(dict.fromkeys(clusters))
    members = [np.array([k for k, one in enumerate(clusters) if one == name]) for name in names]
    value, count = float(of(*given)), len(names)
    if count < 2:
        return value, float("nan")
    rng, drawn = np.random.default_rng(0), []
    for _ in range(SAMPLES):
        which = np.concatenate([members[k] for k in rng.integers(count, size=count)])
        drawn.append(of(*(column[which] for column in given)))
    return value, float(np.nanstd(drawn) * np.sqrt(count / (count - 1)))


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return Spearman's rank correlation of a and b [N]: equal values share a rank; 0 where one is constant."""
    ranks = [_ranks(np.asarray(one)) for one in (a, b)]
    if any(np.ptp(one) == 0 for one in ranks):
        return 0.0
    return float(np.corrcoef(*ranks)[0, 1])


def coverage(said: np.ndarray, error: np.ndarray) -> float:
    """Return the share of errors [N] that are no larger than what was said of them; SAID_SHARE is meant."""
    return float(np.mean(np.asarray(error) <= np.asarray(said)))


def upper_decile(values: np.ndarray) -> float:
    """Return what 90 % of values [N] do not exceed."""
    return float(np.percentile(values, 90))


def _ranks(values: np.ndarray) -> np.ndarray:
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[which]
