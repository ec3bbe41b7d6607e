"""Export of the trained chain: three ONNX graphs with weights of eight bits, and their model card."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import torch
from torch.nn import functional as F

from anyprobe.errors import InputError
from anyprobe.estimate.runtime import CONTRACT, PHOTO_SIZE, model_id, weights_folder
from anyprobe.files.atomic import atomic_path
from anyprobe_train.paper.pieces import network_of, piece_named, steps_of
from anyprobe_train.paper.settings import SETTINGS, Setting
from anyprobe_train.paper.shipped import PIECE_OF, ShippedNet
from anyprobe_train.paper.training import checkpoint_of, log_of, net_in_chain, stored
from anyprobe_train.train.export_onnx import FLOATS, write_graph

TOLERANCE = 0.02
"""Largest median difference of display values or ln radiance that weights of eight bits may cause."""


def export_chain(runs: Path, setting: Setting, folder: Path) -> dict[str, float]:
    """Write irradiance.onnx, illumination.onnx, hdr.onnx and README.md; return each graph's difference from torch.

    Raises:
        InputError: the folder is the package's, and the networks are not what estimates take, not trained to their end,
            or changed since they were scored.
    """
    nets = {stage: net_in_chain(setting, runs, name) for stage, name in PIECE_OF.items()}
    trained = {stage: name for stage, name in PIECE_OF.items() if not isinstance(nets[stage][0], ShippedNet)}
    steps = {stage: (nets[stage][1], steps_of(piece_named(name), setting)) for stage, name in PIECE_OF.items()}
    table = runs / "table_1.md"
    if folder.resolve() == weights_folder("paper").resolve():
        faults = [] if setting.side == PHOTO_SIZE else [f"photos of {setting.side} pixels"]
        faults += [
            f"{PIECE_OF[stage]} at step {step} of {end}"
            for stage, (step, end) in steps.items()
            if stage in trained and step < end
        ]
        last = max((checkpoint_of(runs, name).stat().st_mtime for name in trained.values()), default=0.0)
        if not table.is_file() or table.stat().st_mtime < last:
            faults.append("no table_1.md of them; write it with --table")
        if faults:
            text = (
                f"expected networks for photos of {PHOTO_SIZE} pixels, trained to their end and scored, got {faults[0]}"
            )
            raise InputError(text, source=runs)
    differences = {}
    for stage in PIECE_OF.keys() - trained.keys():
        if folder.resolve() != weights_folder("paper").resolve():
            shutil.copy(weights_folder("paper") / f"{stage}.onnx", folder)
    for stage, name in trained.items():
        picture = (3, setting.rows, 2 * setting.rows) if stage == "hdr" else (4, setting.side, setting.side)
        recipe = {"run": f"paper {name}", "steps": str(steps[stage][0]), "pairs": str(steps[stage][0] * setting.batch)}
        recipe |= {"config": json.dumps({**asdict(setting), **stored(runs, name)["piece"]})}
        said = {**CONTRACT, "stage": stage, "computes": FLOATS, **recipe}
        coarse = torch.rand((1, picture[0], 8, 8), generator=torch.Generator().manual_seed(0))
        example = F.interpolate(coarse, size=picture[1:], mode="bilinear", align_corners=False)  # as smooth as photos
        pairs, path = {"input": {0: "n"}, "output": {0: "n"}}, folder / f"{stage}.onnx"
        differences[stage] = write_graph(
            nets[stage][0], {"input": example}, ("output",), said, path, tolerance=TOLERANCE, dynamic=pairs
        )
    sizes = {
        stage: sum(one.numel() for one in network_of(piece_named(name), setting).parameters())
        for stage, name in PIECE_OF.items()
    }
    rows = [
        f"| `{stage}.onnx` | {sizes[stage] / 1e6:.1f} M | {step:,} of {end:,} | {step * setting.batch:,} |"
        for stage, (step, end) in steps.items()
    ]
    named = next((name for name, known in SETTINGS.items() if known == setting), "full")
    orders = [f"paper --data DATA --setting {named} --only {name}" for name in trained.values()]
    if len(trained) == len(PIECE_OF):
        orders = [f"run paper --data DATA --setting {named}"]
    about = json.loads((runs / "tables" / "train" / "about.json").read_text(encoding="utf-8"))
    scored = next((line for line in reversed(log_of(runs, "ours")) if "box rmse" in line), {})
    card = CARD.format(
        model=model_id(str(folder)),
        networks="\n".join(rows),
        setting=named,
        recipe="\n".join(f"    anyprobe-train {one}" for one in orders),
        measured=sum(about["measured"]),
        others=len(about["maps"]) - sum(about["measured"]),
        shapes=len(about["shapes"]),
        table=table.read_text(encoding="utf-8").strip() if table.is_file() else "Not yet scored.",
        boxes=", ".join(f"{key[4:]} {value}" for key, value in scored.items() if key.startswith("box ")),
    )
    with atomic_path(folder / "README.md") as path:
        path.write_text(card, encoding="utf-8")
    return differences


CARD = """# Model card: `paper`

The chain of Park, Park, Yoon, Woo (TVCG 2020), id `{model}`: its three networks, trained from nothing as it trains
them ([element by element](../../paper/README.md)). Licence: Apache-2.0.

| graph | weights | steps | pairs |
|---|---|---|---|
{networks}

In: a crop [128, 128, 4] of the object, display RGB times mask, and mask. Out: importance-weighted irradiance image, LDR
map [64, 128, 3], ln radiance [64, 128, 3]; Eq. 7-8 combine the maps
([conventions](../../../../docs/reference/conventions.md)). Weights are stored as int8 and computed as float32. Of hints
it takes the lens, pitch and roll alone.

## Recipe

{recipe}
    anyprobe-train paper --data DATA --setting {setting} --graphs src/anyprobe/weights/paper

## Data

{measured} measured maps and {others} procedural or lifted from eight bits, {shapes} shapes ([ASSETS.md](../ASSETS.md)).
No test map or shape was trained on.

## Scores

On test maps and shapes, beside [the paper's own](../../../../docs/explanation/paper.md); `ours` ships:

{table}

Cropped to the object's box, as estimates are, LDR map: {boxes}.
Photos exposed as real ones are: [cut-outs](../../../../docs/explanation/results.md#cut-outs).

## Limits

Those of [`lift`](../lift/README.md#limits). It learned from objects of one material alone, cut out exactly.
"""
