"""Checkpoints: resuming their run and no other, and their weights alone, in half floats, to start another run from."""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import nn

from anyprobe.errors import InputError, ModelError
from anyprobe.files.atomic import atomic_path

Net = TypeVar("Net", bound=nn.Module)
CHANGEABLE = ("name", "steps")
"""Settings that may change when a run is resumed."""
OPTIONS_OF = {"assets": "--data with", "start": "--init-weights with"}


def resumed(
    path: Path, config: Any, origin: dict[str, Any], start: Path | None, device: str = "cpu"
) -> tuple[dict[str, Any] | None, dict[str, Any]]:
    """Return the run's checkpoint, None if there is none yet, and its origin with the weights it started from.

    config: the run's, a dataclass with `steps`; a setting that is not stored had its default.

    Raises:
        InputError: other settings, of which it names the first, another origin, or more steps done than asked for.
        ModelError: of read_checkpoint, or a checkpoint that has weights alone.
    """
    if start is not None:
        origin["start"] = init_weights_id(start)
    if not path.is_file():
        return None, {"start": None, **origin}
    stored = read_checkpoint(path, device)
    if "optimizer" not in stored:
        raise ModelError(
            "expected a run's checkpoint, got weights alone; train in another folder with --init-weights", source=path
        )
    known = json.loads(stored["config"])
    for setting in fields(config):
        current = getattr(config, setting.name)
        old = known.get(setting.name, current if setting.default is MISSING else setting.default)
        if old != current and setting.name not in CHANGEABLE:
            raise _another_run(path, setting.name, old, current)
    if config.steps < stored["step"]:
        raise InputError(
            f"expected at least the {stored['step']} steps that are done, got {config.steps}; "
            "give more --steps, or train in another --runs folder",
            source=path,
        )
    begun = stored.get("origin", {})
    for name, value in origin.items():
        if begun.get(name, value) != value:
            raise _another_run(path, name, begun[name], value)
    return stored, {**origin, **begun}


def _another_run(path: Path, name: str, old: Any, current: Any) -> InputError:
    return InputError(
        f"expected {OPTIONS_OF.get(name, name)} {'nothing' if old is None else old}, as the run started, "
        f"got {current}; resume with the same, or train in another --runs folder",
        source=path,
    )


def save_checkpoint(path: Path, config: Any, step: int, origin: Mapping[str, Any], state: Mapping[str, Any]) -> None:
    """Save everything that the next step depends on; what is drawn depends on the step's number alone.

    state: weights, of the networks and of the optimizer, and numbers, by name.

    Raises:
        OutputError: it cannot be written.
    """
    _save(path, {**state, "step": step, "config": json.dumps(asdict(config)), "origin": dict(origin)})


def _save(path: Path, content: dict[str, Any]) -> None:
    data = io.BytesIO()  # torch reports a full disk as an error of its own, Python as one of files
    torch.save(content, data)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data.getbuffer())


def read_checkpoint(path: Path, device: str = "cpu") -> dict[str, Any]:
    """Read what save_checkpoint wrote; ModelError if there is no file, a damaged one, or none of a run."""
    if not path.is_file():
        raise ModelError("no such checkpoint; train first", source=path)
    try:
        stored = torch.load(path, map_location=device, weights_only=True)
        parts = stored["net"], json.loads(stored["config"]), stored["step"]
        if not all(isinstance(one, kind) for one, kind in zip(parts, (Mapping, dict, int), strict=True)):
            raise TypeError("not of a run")
    except Exception as error:  # torch raises many kinds for a damaged file
        text = "expected a run's checkpoint, got a damaged file or none of a run; train again, or restore a copy"
        raise ModelError(text, source=path) from error
    return dict(stored)


def load_weights(nets: nn.Module, weights: Mapping[str, torch.Tensor], path: Path) -> None:
    """Load a checkpoint's weights into networks; ModelError names the first that does not fit."""
    wanted, found = (
        {name: list(np.shape(one)) for name, one in state.items()} for state in (nets.state_dict(), weights)
    )
    for name in {**wanted, **found}:
        expected, shape = wanted.get(name, "none"), found.get(name, "none")
        if expected != shape:
            raise ModelError(
                f"expected this run's weights, with {name} {expected}, got {shape}; "
                "use the release that trained it, or train again in another folder",
                source=path,
            )
    nets.load_state_dict(weights)


def load_trained(net: Net, checkpoint: Path) -> tuple[Net, dict[str, Any]]:
    """Load a checkpoint's weights, the mean of the run's, into a network.

    Return it, ready to run, and the run's step, origin and settings; ModelError if there are none that fit.
    """
    stored = read_checkpoint(checkpoint)
    load_weights(net, stored["net"], checkpoint)
    about = {"step": stored["step"], "origin": stored.get("origin", {}), **json.loads(stored["config"])}
    return net.eval().requires_grad_(False), about


SMALL = 1024
"""Size below which tensors stay float32 [numbers]: statistics and biases, which take little space."""


def save_init_weights(checkpoint: Path, path: Path, with_pairs: bool = False) -> None:
    """Save a checkpoint's weights, large tensors as float16, with the number of pairs they have seen or without;
    read_init_weights reads them.

    Raises:
        ModelError: of read_checkpoint.
        InputError: path is the run's checkpoint, which bare weights must not replace.
    """
    stored = read_checkpoint(checkpoint)
    if path.exists() and path.samefile(checkpoint):
        text = "expected another file for the weights, got the run's own checkpoint; choose another"
        raise InputError(text, source=path)
    halved = {
        name: value.half() if value.is_floating_point() and value.numel() >= SMALL else value
        for name, value in stored["net"].items()
    }
    pairs = {"pairs": stored["step"] * json.loads(stored["config"])["batch"]}
    _save(path, {"nets": halved, **pairs} if with_pairs else halved)


def init_weights_id(path: Path) -> str:
    """Return the identity of initial weights: the first 16 hex digits of the file's SHA-256; ModelError if absent."""
    if not path.is_file():
        raise ModelError("no such file; save weights with `anyprobe-train export --keep`", source=path)
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def read_init_weights(path: Path) -> tuple[dict[str, torch.Tensor], int | None]:
    """Read a file of weights as float32, and the number of pairs they have seen, None if it is not stored."""
    try:
        stored = torch.load(path, map_location="cpu", weights_only=True)
        weights, pairs = (stored["nets"], stored.get("pairs")) if stored.get("nets") else (stored, None)
        return {name: value.float() if value.is_floating_point() else value for name, value in weights.items()}, pairs
    except Exception as error:  # torch raises many kinds for a damaged file
        found = " ".join(str(error).split())[:80]
        text = f"expected weights of this run, saved by `anyprobe-train export --keep`, got {found}"
        raise ModelError(text, source=path) from error
