"""How bright the chain's white is made before it ships."""

from __future__ import annotations

import numpy as np
import pytest
from support.some_pair import sphere_pair

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.color import luminance  # noqa: E402
from anyprobe.light.environment import integral  # noqa: E402
from research.export_weights.paper import STEPS, power_off  # noqa: E402


class Answers(torch.nn.Module):
    """The same answer, whatever it sees."""

    def __init__(self, answer: torch.Tensor) -> None:
        super().__init__()
        self.answer = answer

    def forward(self, *_: torch.Tensor) -> torch.Tensor:
        return self.answer


@pytest.mark.parametrize("dimmer", [0.3, 0.6])
def test_white_that_is_too_dim_is_found_out(dimmer):
    """All of the map is white, and as much too dim as the truth's power says."""
    pair = sphere_pair(0)
    level = float(luminance(integral(pair.radiance.astype(np.float64)))) / (4 * np.pi)
    nets = torch.nn.ModuleDict(
        {
            "irradiance": Answers(torch.zeros(1, 3, 128, 128)),
            "illumination": Answers(torch.ones(1, 3, 64, 128)),
            "hdr": Answers(torch.full((1, 3, 64, 128), np.log(level) - dimmer)),
        }
    )
    off = power_off(nets, [pair, pair])
    assert STEPS[off.argmin()] == pytest.approx(dimmer)
    assert off[0] == pytest.approx(dimmer / np.log(2), abs=1e-3)
    assert off.min() < 1e-3
