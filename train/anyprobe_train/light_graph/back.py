"""From an answer in the frame of the crop to what the graph says, in the camera's frame of the photo."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import nn

from anyprobe.core.latlong import pixel_directions
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.harmonics import K, pixel_integrals
from anyprobe_train.light_graph.sampling import read_map


class Back(nn.Module):
    """Turns maps, and sums them up."""

    directions: torch.Tensor
    rows: torch.Tensor
    columns: torch.Tensor
    norms: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        rows, columns = pixel_integrals(MAP_HEIGHT)
        numbers = {"directions": pixel_directions(MAP_HEIGHT), "rows": rows, "columns": columns, "norms": K[:, None]}
        for name, values in numbers.items():
            self.register_buffer(name, torch.from_numpy(np.asarray(values, np.float32)), persistent=False)

    def turned(self, values: torch.Tensor, camera_from_map: torch.Tensor) -> torch.Tensor:
        """Turn a map [C, H, 2H] into the camera's frame: new(d) = old(R^T d)."""
        return read_map(values, self.directions @ camera_from_map)

    def harmonics(self, radiance: torch.Tensor) -> torch.Tensor:
        """Project a map [3, H, 2H] as light.harmonics.project does, [9, 3]."""
        seen = torch.einsum("fw,chw->fhc", self.columns, radiance)
        one, sine, cosine, sine2, cosine2, mixed = torch.einsum("gh,fhc->fgc", self.rows, seen).unbind()
        parts = [one[0], one[1], -cosine[2], sine[2], sine[3], -cosine[3]]
        parts += [3 * cosine2[4] - one[0], -mixed[4], sine2[4] - one[5]]
        return torch.stack(parts) * self.norms


def up_of(pitch: torch.Tensor, roll: torch.Tensor) -> torch.Tensor:
    """Return up [3] in the frame of a camera of this pitch downwards and roll [radians], both []."""
    return torch.stack([pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), pitch.sin()])


def posture_of(up: torch.Tensor) -> torch.Tensor:
    """Return pitch downwards and roll [degrees], [2], of a camera in whose frame up [3] is up."""
    pitch = torch.asin(up[2].clamp(-1.0, 1.0))
    return torch.stack([pitch, torch.atan2(up[0], up[1])]) * (180.0 / math.pi)
