"""The mask network's export: one ONNX graph with its contract, its weights stored small, checked against torch."""

import json
from pathlib import Path

import numpy as np
import torch

from anyprobe.masks.networks import MASK_CONTRACT, SMALL_PX
from anyprobe_train.mask_network.mask_net import MaskNet
from anyprobe_train.train.checkpoint import load_trained
from anyprobe_train.train.export_onnx import write_graph

TOLERANCE = 0.01
"""Largest mean difference of the cover between graph and network."""


def export_mask(checkpoint: Path, path: Path) -> float:
    """Write mask.onnx of a trained run: "input" [1, 4, 160, 160] to "output" [1, 1, 160, 160]; return its mean
    difference from torch; ModelError if that is more than TOLERANCE."""
    net, run = load_trained(MaskNet(), checkpoint)
    about = {**MASK_CONTRACT, "run": run["name"], "steps": str(run["step"]), "config": json.dumps(run)}
    about["scenes"] = str(run["scenes"] + run["step"] * run["fresh"])
    example = torch.rand((1, 4, SMALL_PX, SMALL_PX), generator=torch.Generator().manual_seed(0))
    return write_graph(
        net, {"input": example}, ("output",), about, path, tolerance=TOLERANCE, dynamic={}, typical=np.mean
    )
