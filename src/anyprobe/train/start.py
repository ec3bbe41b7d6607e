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
    kept = _read_start(path)
    try:
        nets.load_state_dict(
            {name: value.float() if value.is_floating_point() else value for name, value in kept.items()}
        )
    except Exception as error:  # other names, other shapes, no weights at all
        raise _not_of_this_run(path, " ".join(str(error).split())[:80]) from error


def mean_checkpoint(checkpoint: Path, other: Path, path: Path) -> Path:
    """A checkpoint at path, for export alone, of the mean of a run's weights and those kept in other.

    Where a run began from other, what both have learned stays and much of what is each one's chance goes (Wortsman et
    al. 2022, Model soups).

    Raises:
        ModelError: no checkpoint, or other holds another network's weights.
    """
    if not checkpoint.is_file():
        raise ModelError(f"{checkpoint}: expected a run's checkpoint, found none; train first")
    stored = torch.load(checkpoint, map_location="cpu", weights_only=True)
    kept, nets = _read_start(other), stored["nets"]
    if {name: value.shape for name, value in kept.items()} != {
        name: value.shape for name, value in nets.items()
    }:
        raise _not_of_this_run(other, "another network's")
    mean = {
        name: (value + kept[name].float()) / 2 if value.is_floating_point() else value
        for name, value in nets.items()
    }
    torch.save({**stored, "nets": mean, "optimizer": {}}, path)
    return path


def _read_start(path: Path) -> dict[str, torch.Tensor]:
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises many kinds for a damaged file
        raise _not_of_this_run(path, " ".join(str(error).split())[:80]) from error


def _not_of_this_run(path: Path, found: str) -> ModelError:
    return ModelError(
        f"{path}: expected weights of this run, kept by `anyprobe weights --start`, got {found}"
    )
