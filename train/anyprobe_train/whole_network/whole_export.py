"""PhotoNet's export: light.onnx, the whole way from a photo to its light, checked against torch."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from anyprobe.estimate.runtime import LIGHT_STAGE
from anyprobe_train.nets.claims import AS_CALIBRATED
from anyprobe_train.train.export_onnx import export_stage, light_graph
from anyprobe_train.whole_network.whole_training import load_photo_net


def export_photo_net(checkpoint: Path, folder: Path, start: Sequence[Path] = (), share: float = 0.0) -> float:
    """Write folder/light.onnx and return its largest median difference from torch; ModelError where that is more than
    the tolerance. start, share: see load_photo_net."""
    net, run = load_photo_net(checkpoint, start, share)
    recipe = {"run": run["name"], "steps": str(run["step"]), "pairs": str(run["step"] * run["batch"])}
    recipe["config"] = json.dumps(run)
    recipe["sureness"] = " ".join(f"{v:g}" for v in AS_CALIBRATED.numbers)
    graph = light_graph(net.light, net.whole, AS_CALIBRATED)
    return export_stage(LIGHT_STAGE, graph, recipe, folder / f"{LIGHT_STAGE}.onnx")
