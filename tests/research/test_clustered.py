"""Standard errors over clusters, rank correlation, coverage."""

import numpy as np
import pytest

from research.clustered import coverage, rank_correlation, upper_decile, with_error


def test_the_error_of_a_mean_is_that_of_independent_draws():
    values = np.random.default_rng(1).normal(0, 2, 400)
    mean, error = with_error(np.mean, range(400), values)
    assert mean == values.mean()
    assert error == pytest.approx(2 / 20, rel=0.1)


def test_photos_of_one_cluster_count_as_one():
    """Ten times the same values are no surer than once."""
    values = np.random.default_rng(2).normal(0, 1, 50)
    (_, once), (_, tenfold) = (
        with_error(np.mean, list(range(50)) * times, np.tile(values, times)) for times in (1, 10)
    )
    assert tenfold == pytest.approx(once, rel=1e-6)
    assert np.isnan(with_error(np.mean, ["map"] * 50, values)[1])


@pytest.mark.ci
def test_few_clusters_are_not_surer_than_they_are():
    errors = [with_error(np.mean, range(3), draw)[1] for draw in np.random.default_rng(3).normal(0, 1, (100, 3))]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1 / np.sqrt(3), rel=0.12)


def test_rank_correlation_is_of_ranks():
    values = np.array([3.0, 1.0, 2.0, 2.0, 9.0])
    assert rank_correlation(values, values**3) == pytest.approx(1.0)
    assert rank_correlation(values, -np.exp(values)) == pytest.approx(-1.0)
    assert rank_correlation(values, np.ones(5)) == 0.0
    # ranks 4 1 2.5 2.5 5 and 1 2 3 4 5
    assert rank_correlation(values, np.arange(5)) == pytest.approx(np.corrcoef([4, 1, 2.5, 2.5, 5], range(5))[0, 1])


def test_coverage_counts_errors_up_to_what_was_said():
    assert coverage(np.array([5.0, 5.0, 5.0, 5.0]), np.array([1.0, 5.0, 6.0, 90.0])) == 0.5
    assert upper_decile(np.arange(11.0)) == 9.0
