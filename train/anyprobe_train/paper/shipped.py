"""The paper's networks that ship, as their graphs compute them: what needs one that was not trained here takes it."""

import json
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import torch
from torch import nn

from anyprobe.estimate.runtime import STAGES, weights_folder
from anyprobe.files.graphs import open_graph
from anyprobe_train.paper.settings import Setting

SIZES = {"side", "rows", "width", "code"}
"""Fields of a setting that a network's layers depend on."""
PIECE_OF = dict(zip(STAGES, ("irradiance_net", "ours", "hdr_net"), strict=True))
"""Each graph's piece."""


class ShippedNet(nn.Module):
    """A graph, as a network of the chain: display values clipped to [0, 1], or ln radiance. step: that it had."""

    def __init__(self, session: Any, step: int) -> None:
        super().__init__()
        self._session, self.step = session, step

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        """Estimate, without a gradient."""
        (output,) = self._session.run(None, {"input": picture.float().contiguous().cpu().numpy()})
        return torch.from_numpy(output).to(picture.device)


@lru_cache
def shipped_net(name: str, setting: Setting) -> ShippedNet | None:
    """Return a piece that ships; None where it does not, or is of other sizes."""
    stage = next((stage for stage, piece in PIECE_OF.items() if piece == name), None)
    if stage is None:
        return None
    session = open_graph(weights_folder("paper") / f"{stage}.onnx", torch.get_num_threads())
    about = session.get_modelmeta().custom_metadata_map
    config = json.loads(about["config"])
    is_same = all(config[key] == value for key, value in asdict(setting).items() if key in SIZES)
    return ShippedNet(session, int(about["steps"])) if is_same else None
