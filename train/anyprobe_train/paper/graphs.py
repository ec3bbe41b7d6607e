"""Export of the trained chain as three ONNX graphs with weights of eight bits."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from anyprobe_train.paper.pieces import PIECES, steps_of
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.training import is_trained, load_net, stored
from anyprobe_train.train.export_onnx import CONVOLUTIONS, LINEAR_LAYERS, Graph, export_stage

STAGES = {"irradiance": ("irradiance_net",), "illumination": ("ours_longer", "ours"), "hdr": ("hdr_net",)}
"""Graphs, and the pieces that each is made of: the first that is trained."""


def export_chain(runs: Path, setting: Setting, folder: Path) -> dict[str, float]:
    """Write irradiance.onnx, illumination.onnx and hdr.onnx; return each one's largest difference from torch."""
    differences = {}
    for stage, names in STAGES.items():
        done = [piece for piece in PIECES if piece.name in names and is_trained(piece, setting, runs)]
        name = done[-1].name if done else names[-1]
        picture = (3, setting.rows, 2 * setting.rows) if stage == "hdr" else (4, setting.side, setting.side)
        graph = Graph(
            net=load_net(setting, runs, name), inputs={"input": (1, *picture)}, small=(LINEAR_LAYERS, CONVOLUTIONS)
        )
        steps = sum(steps_of(piece, setting) for piece in PIECES if piece.name in names and piece in done)
        recipe = {"run": f"paper {name}", "steps": str(steps), "pairs": str(steps * setting.batch)}
        recipe |= {"config": json.dumps({**asdict(setting), **stored(runs, name)["piece"]})}
        differences[stage] = export_stage(stage, graph, recipe, folder / f"{stage}.onnx")
    return differences
