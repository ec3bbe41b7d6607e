"""Checkpoints for export alone: of kept weights, and of the mean of two."""

from __future__ import annotations

import json
from pathlib import Path

import torch

from anyprobe.errors import ModelError
from anyprobe_train.train.checkpoint import init_weights_id, read_checkpoint, read_init_weights


def mean_checkpoint(checkpoint: Path, other: Path, path: Path, share: float = 0.5) -> Path:
    """A checkpoint at path, for export alone, of the mean of a run's weights and those kept in other.

    Where a run began from other, what both have learned stays and much of what is each one's chance goes (Wortsman et
    al. 2022, Model soups).

    share: of other in the mean.
    Raises:
        ModelError: no checkpoint, or other holds another network's weights.
    """
    stored = read_checkpoint(checkpoint)
    (kept, pairs), nets = read_init_weights(other), stored["nets"]
    own = {name.split(".")[0] for name in nets}
    kept = {name: value for name, value in kept.items() if name.split(".")[0] in own}
    if {name: value.shape for name, value in kept.items()} != {name: value.shape for name, value in nets.items()}:
        raise ModelError(f"expected weights of the run {checkpoint}, got another network's", source=other)
    mean = {
        name: torch.lerp(value, kept[name], share) if value.is_floating_point() else value
        for name, value in nets.items()
    }
    mean_with = {"start": init_weights_id(other), "pairs": pairs, "share": share}
    torch.save({**stored, "nets": mean, "optimizer": {}, "mean_with": mean_with}, path)
    return path


def kept_checkpoint(kept: Path, graph: Path, path: Path) -> Path:
    """A checkpoint at path, for export alone, of the kept weights of `lift`, with what a graph exported from them says
    of their run. Weights of whole.onnx, which train/checkpoints/lift.pt has too, are left out.

    Raises:
        ModelError: no weights, or no graph of an export.
    """
    from onnx import load

    said = {entry.key: entry.value for entry in load(str(graph), load_external_data=False).metadata_props}
    if not {"config", "steps", "pairs"} <= said.keys():
        raise ModelError("expected a graph of `anyprobe-train export`, got one that names no run", source=graph)
    nets = {name: value for name, value in read_init_weights(kept)[0].items() if name.split(".")[0] == "light"}
    config = json.dumps({"model": "lift", **json.loads(said["config"])})  # both networks' run states no model
    origin = {name: said[name] for name in ("start", "assets") if name in said}
    step, pairs = int(said["steps"]), int(said["pairs"])
    kept_run = {"nets": nets, "config": config, "step": step, "pairs": pairs, "origin": origin}
    if "mean_with" in said:
        share = float(said.get("mean_with_share", 0.5))
        kept_run["mean_with"] = {"start": said["mean_with"], "pairs": int(said["mean_with_pairs"]), "share": share}
    torch.save(kept_run, path)
    return path
