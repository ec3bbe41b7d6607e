"""Checkpoint (noun): what a run keeps of itself; a damaged file or another run's is one clear line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import nn

from anyprobe.errors import ModelError


def read_checkpoint(path: Path, device: str = "cpu", holds: tuple[str, ...] = ("nets",)) -> dict[str, Any]:
    """What save_checkpoint wrote: weights, step, the configuration in JSON, and what else there is.

    Args:
        device: where its tensors go.
        holds: names of which one has the weights.
    Raises:
        ModelError: no file, a damaged one, or none of a run.
    """
    if not path.is_file():
        raise ModelError(f"{path}: expected a run's checkpoint, found none; train first")
    with path.open("rb") as stream:
        try:
            stored = torch.load(stream, map_location=device, weights_only=True)
        except Exception as error:  # torch raises many kinds for a damaged file
            raise _no_checkpoint(path, "a damaged file") from error
    if not isinstance(stored, Mapping):
        raise _no_checkpoint(path, f"a {type(stored).__name__}")
    if not any(isinstance(stored.get(name), Mapping) for name in holds):
        raise _no_checkpoint(path, f"a file without {' or '.join(holds)}")
    try:
        config = json.loads(stored["config"])
    except (KeyError, TypeError, ValueError) as error:
        raise _no_checkpoint(path, "a file without its configuration") from error
    if not isinstance(config, dict) or not isinstance(stored.get("step"), int):
        raise _no_checkpoint(path, "a file without its configuration or step")
    return dict(stored)


def load_weights(nets: nn.Module, weights: Mapping[str, torch.Tensor], path: Path) -> None:
    """Give networks the weights that a checkpoint at path holds; ModelError that names the first that does not fit."""
    wanted = nets.state_dict()
    for name in {**wanted, **weights}:
        expected, found = (
            list(state[name].shape) if isinstance(state.get(name), torch.Tensor) else "none"
            for state in (wanted, weights)
        )
        if expected != found:
            raise ModelError(
                f"{path}: expected this run's weights, with {name} {expected}, got {found}; "
                "take the release that trained it, or train again in another folder"
            )
    nets.load_state_dict(weights)


def _no_checkpoint(path: Path, found: str) -> ModelError:
    return ModelError(f"{path}: expected a run's checkpoint, got {found}; train again, or put a copy back")
