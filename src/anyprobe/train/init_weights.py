"""A run's weights alone, in half floats, to begin another run from or to average with."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

import torch
from torch import nn

from anyprobe.errors import InputError, ModelError
from anyprobe.files.atomic import atomic_path
from anyprobe.train.checkpoint import current_names, read_checkpoint

ADDED = ("light.object.material.", "light.posterior.")
"""Parts that weights of older releases lack; they begin untrained."""
SMALL = 1024
"""Tensors of fewer numbers stay float32: statistics and biases, which weigh nothing."""


def save_init_weights(checkpoint: Path, path: Path) -> None:
    """Keep a checkpoint's weights at path, large tensors as float16.

    Raises:
        InputError: path is the checkpoint.
        ModelError: no checkpoint, or a damaged one.
    """
    stored = read_checkpoint(checkpoint, holds=("nets", "net"))
    keep_apart(checkpoint, path)
    with atomic_path(path) as temporary:
        torch.save(_halved(stored["nets"] if "nets" in stored else stored["net"]), temporary)


def keep_apart(checkpoint: Path, path: Path) -> None:
    """InputError if path is the run's checkpoint: what is kept is less, and must not take its place."""
    if checkpoint.exists() and path.exists() and path.samefile(checkpoint):
        raise InputError(
            f"{path}: expected another place to keep weights in, got the run's own checkpoint; choose another"
        )


def _halved(state: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    return {
        name: value.half() if value.is_floating_point() and value.numel() >= SMALL else value
        for name, value in state.items()
    }


def load_init_weights(nets: nn.Module, path: Path) -> None:
    """Give networks the weights that save_init_weights or keep_run kept; ModelError if they are none of theirs."""
    fresh = nets.state_dict()
    kept = current_names(_read_init_weights(path)[0], fresh)
    kept = {name: value for name, value in fresh.items() if name.startswith(ADDED)} | kept
    try:
        nets.load_state_dict(
            {name: value.float() if value.is_floating_point() else value for name, value in kept.items()}
        )
    except Exception as error:  # other names, other shapes, no weights at all
        raise _not_of_this_run(path, " ".join(str(error).split())[:80]) from error


def init_weights_id(path: Path) -> str:
    """Which weights to begin from these are: the first 16 hex digits of the file's SHA-256; ModelError if there is
    no such file."""
    if not path.is_file():
        raise _not_of_this_run(path, "no file")
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def mean_checkpoint(checkpoint: Path, other: Path, path: Path) -> Path:
    """A checkpoint at path, for export alone, of the mean of a run's weights and those kept in other.

    Where a run began from other, what both have learned stays and much of what is each one's chance goes (Wortsman et
    al. 2022, Model soups).

    Raises:
        ModelError: no checkpoint, or other holds another network's weights.
    """
    stored = read_checkpoint(checkpoint)
    (kept, pairs), nets = _read_init_weights(other), stored["nets"]
    kept = current_names(kept, nets)
    if {name: value.shape for name, value in kept.items()} != {
        name: value.shape for name, value in nets.items()
    }:
        raise _not_of_this_run(other, "another network's")
    mean = {
        name: (value + kept[name].float()) / 2 if value.is_floating_point() else value
        for name, value in nets.items()
    }
    mean_with = {"start": init_weights_id(other), "pairs": pairs}
    torch.save({**stored, "nets": mean, "optimizer": {}, "mean_with": mean_with}, path)
    return path


def _read_init_weights(path: Path) -> tuple[dict[str, torch.Tensor], int | None]:
    """The weights that a file keeps, and how many pairs they have seen, if it says so."""
    try:
        kept = torch.load(path, map_location="cpu", weights_only=True)
        return (kept["nets"], kept.get("pairs")) if kept.get("nets") else (kept, None)
    except Exception as error:  # torch raises many kinds for a damaged file
        raise _not_of_this_run(path, " ".join(str(error).split())[:80]) from error


def _not_of_this_run(path: Path, found: str) -> ModelError:
    return ModelError(f"{path}: expected weights of this run, kept by `anyprobe weights --keep`, got {found}")
