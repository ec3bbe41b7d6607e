"""The mean training map."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs ./train[torch]")

from research.mean_map import mean_map


def test_the_mean_map_is_the_geometric_mean_of_maps():
    batches = [np.full((3, 64, 128, 3), level, np.float16) for level in (1.0, 4.0)]
    np.testing.assert_allclose(mean_map(batches), 2.0, rtol=1e-3)
