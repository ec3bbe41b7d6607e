"""Statistics of scored pairs: means by group, paired differences and their standard errors."""

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe_train.evaluate.scoring import Scores
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
