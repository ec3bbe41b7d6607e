"""Statistics of scored pairs: means by group, paired differences and their standard errors."""

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe_train.evaluate.scoring import Scores
from anyprobe_train.evaluate.standard_errors import clustered_error, one_way_variance
from research.compare.study import difference, means


def invented(**ssim):
    """Scores of two specular and two diffuse pairs in which only ldr_ssim was measured."""
    result = Scores()
    for index, material in enumerate((0, 0, 1, 1)):
        pair = sphere_pair(index, alpha=0.2 if material == 0 else 0.8, material=material)
        result.add(pair, {name: {"ldr_ssim": values[index]} for name, values in ssim.items()})
    return result


def test_means_go_by_group():
    result = invented(ours=(0.1, 0.3, 0.5, 0.9))
    assert means(result, "ours")["ldr_ssim"] == pytest.approx(0.45)
    assert means(result, "ours", "specular")["ldr_ssim"] == pytest.approx(0.2)
    assert means(result, "ours", "alpha 0.75-1")["ldr_ssim"] == pytest.approx(0.7)


def test_difference_is_paired():
    result = invented(ours=(0.2, 0.4, 0.6, 1.0), direct=(0.1, 0.3, 0.5, 0.9))
    one = difference(result, "ours", "direct", "ldr_ssim")
    assert one == {"mean": pytest.approx(0.1), "standard_error": pytest.approx(0.0)}
    d = np.array([0.1, 0.1, 0.1, 0.5])
    shifted = invented(ours=(0.2, 0.4, 0.6, 1.4), direct=(0.1, 0.3, 0.5, 0.9))
    error = difference(shifted, "ours", "direct", "ldr_ssim")["standard_error"]
    assert error == pytest.approx(d.std(ddof=1) / 2, abs=1e-5)
    shifted.maps = ["a", "b"] * 2  # whose pairs may err together: by -.2 and by .2 from the mean
    error = difference(shifted, "ours", "direct", "ldr_ssim")["standard_error"]
    assert error == pytest.approx(np.sqrt(2 * (0.2**2 + 0.2**2)) / 4, abs=1e-5)
    shifted.maps = ["a"] * 4
    assert difference(shifted, "ours", "direct", "ldr_ssim")["standard_error"] is None
    shifted.shapes = ["a", "b"] * 2  # and so may those of one shape
    assert difference(shifted, "ours", "direct", "ldr_ssim")["standard_error"] == error


def crossed(by_map, by_shape):
    """One pair of every map and shape: what each adds to d, and the names."""
    d = np.add.outer(by_map, by_shape)
    maps, shapes = np.meshgrid(range(len(by_map)), range(len(by_shape)), indexing="ij")
    return d.ravel(), [f"map {k}" for k in maps.ravel()], [f"shape {k}" for k in shapes.ravel()]


def test_pairs_of_one_map_that_are_all_equal_count_as_one(rng):
    """The error is then that of the maps' means; and of the shapes', where these decide alone."""
    means = rng.normal(size=7)
    error = means.std(ddof=1) / np.sqrt(7)
    d, maps, shapes = crossed(means, np.zeros(4))
    assert clustered_error(d, maps, shapes) == pytest.approx(error)
    assert clustered_error(d, shapes, maps) == pytest.approx(error)
    assert clustered_error(means, list("abcdefg"), ["one"] * 7) == pytest.approx(error)
    assert clustered_error(means, list("abcdefg"), list("tuvwxyz")) == pytest.approx(error)
    assert clustered_error([1.0, 1.0], ["a", "b"], ["a", "b"]) == 0.0


def test_pairs_of_one_map_and_shape_tell_of_no_error():
    """Two alike would else be certain."""
    assert np.isnan(clustered_error([0.0010, 0.0012], ["a", "a"], ["s", "s"]))
    alone = invented(ours=(0.2, 0.4, 0.6, 1.0), direct=(0.1, 0.3, 0.5, 0.9))
    alone.maps, alone.shapes = ["a"] * 4, ["s"] * 4
    gain = difference(alone, "ours", "direct", "ldr_ssim")
    assert gain["standard_error"] is None


def test_maps_and_shapes_add_up(rng):
    """d = a + b, each map with each shape once: var(a) / G + var(b) / H, less what both would have counted twice."""
    a, b = rng.normal(size=6), rng.normal(size=5)
    expected = a.var(ddof=1) / 6 + b.var(ddof=1) / 5 - (a.var() + b.var()) / 29
    assert clustered_error(*crossed(a, b)) == pytest.approx(np.sqrt(expected))
    assert clustered_error(*crossed(a, b)) > clustered_error(*crossed(a, 0 * b))


def test_an_error_is_never_below_that_of_maps_or_of_shapes(rng):
    d = rng.normal(size=40)
    maps, shapes = [f"{k % 8}" for k in range(40)], [f"{k // 8}" for k in range(40)]
    one_way = [one_way_variance(d, names) for names in (maps, shapes)]
    assert sum(one_way) - one_way_variance(d, list(zip(maps, shapes, strict=True))) < max(one_way)
    assert clustered_error(d, maps, shapes) == pytest.approx(np.sqrt(max(one_way)))
