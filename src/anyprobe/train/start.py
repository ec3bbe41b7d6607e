"""Start (noun): a finished run's weights alone, small enough to keep, for another run to begin from."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path

SMALL = 1024
"""Tensors of fewer numbers stay float32: statistics and biases, which weigh nothing."""


def save_start(checkpoint: Path, path: Path) -> None:
    """Keep a checkpoint's weights at path, large tensors as float16; ModelError if there is no checkpoint."""
    if not checkpoint.is_file():
        raise ModelError(f"{checkpoint}: expected a run's checkpoint, found none; train first")
    stored = torch.load(checkpoint, map_location="cpu", weights_only=True)
    state = stored["nets"] if "nets" in stored else stored["net"]
    kept = {
        name: value.half() if value.is_floating_point() and value.numel() >= SMALL else value
        for name, value in state.items()
    }
    with atomic_path(path) as temporary:
        torch.save(kept, temporary)


def load_start(nets: nn.Module, path: Path) -> None:
    """Give networks the weights that save_start kept; ModelError if they are none of theirs."""
    try:
        kept = torch.load(path, map_location="cpu", weights_only=True)
        nets.load_state_dict(
            {name: value.float() if value.is_floating_point() else value for name, value in kept.items()}
        )
    except Exception as error:  # torch raises many kinds for a damaged file
        raise ModelError(
            f"{path}: expected weights of this run, kept by `anyprobe weights --start`, "
            f"got {' '.join(str(error).split())[:80]}"
        ) from error
