"""A map summed up in nine spherical harmonics, as light.harmonics does it, by operations that an ONNX graph has."""

import numpy as np
import torch
from torch import nn

from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.harmonics import K, pixel_integrals


class Harmonics(nn.Module):
    """Map [3, 64, 128] -> [9, 3]."""

    rows: torch.Tensor
    columns: torch.Tensor
    norms: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        rows, columns = pixel_integrals(MAP_HEIGHT)
        for name, values in {"rows": rows, "columns": columns, "norms": K[:, None]}.items():
            self.register_buffer(name, torch.from_numpy(np.asarray(values, np.float32)), persistent=False)

    def forward(self, radiance: torch.Tensor) -> torch.Tensor:
        seen = torch.einsum("fw,chw->fhc", self.columns, radiance)
        one, sine, cosine, sine2, cosine2, mixed = torch.einsum("gh,fhc->fgc", self.rows, seen).unbind()
        parts = [one[0], one[1], -cosine[2], sine[2], sine[3], -cosine[3]]
        parts += [3 * cosine2[4] - one[0], -mixed[4], sine2[4] - one[5]]
        return torch.stack(parts) * self.norms
