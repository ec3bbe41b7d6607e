"""Checkpoint -> ONNX graph with its contract, half-float storage, checked against torch."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.dataset.pairs import PairSource
from anyprobe.errors import ModelError
from anyprobe.estimate.runtime import CONTRACT, LIFT_INPUTS, LIFT_OUTPUTS, NORMALS_SIZE, PHOTO_SIZE, lift_inputs
from anyprobe.evaluate.methods import surroundings, true_normals
from anyprobe.files.atomic import atomic_path
from anyprobe.files.graphs import open_graph
from anyprobe.files.radiance import write_exr
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.reconstruct import LN_MAX
from anyprobe.nets.light_net import LightNet
from anyprobe.scatter.materials import MATERIAL_INPUTS
from anyprobe.train.checkpoint import read_checkpoint
from anyprobe.train.loop import load_nets, pairs_seen


def write_mean_map(source: PairSource, path: Path, batches: int = 64) -> None:
    """exp(mean ln radiance) over pairs, in the camera's frame and the photos' exposure units, as .exr."""
    stride = 6  # neighbouring batches share lights
    total = torch.zeros(())
    for k in range(batches):
        total = total + source.batch(k * stride).ln_radiance.mean(dim=0).cpu()
    mean = torch.exp(total / batches).permute(1, 2, 0).numpy()
    write_exr(path, np.ascontiguousarray(mean))


PHOTO = (1, 4, PHOTO_SIZE, PHOTO_SIZE)
NORMALS = (1, 3, NORMALS_SIZE, NORMALS_SIZE)
SURROUNDINGS = (1, 4, MAP_HEIGHT, 2 * MAP_HEIGHT)


@dataclass(frozen=True, kw_only=True, slots=True)
class Sureness:
    """How a graph corrects its claims (evaluate.calibration): slope and offset of the confidence logit, and factors
    of the errors of reflectance, level and colour."""

    logit: tuple[float, float] = (1.0, 0.0)
    errors: tuple[float, float, float] = (1.0, 1.0, 1.0)


AS_LEARNED = Sureness()
FLOATS = "float32"
INT8 = "int8 convolutions"
"""What a graph's metadata says that it computes in."""
TOLERANCE = 0.02
"""Largest difference of display values or ln radiance that half-float storage may make."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Graph:
    """One graph: its network, and the shapes of its inputs and names of its outputs in order.

    median: compare by the median difference, where a last bit may move a pixel to its neighbour.
    """

    net: nn.Module
    inputs: dict[str, tuple[int, ...]]
    outputs: tuple[str, ...] = ("output",)
    median: bool = False


class LightGraph(nn.Module):
    """Outputs of LightNet in the order of LIFT_OUTPUTS: irradiance, ln radiance with emitters at their mode, confidence
    [N, 1, 64, 128] in [0, 1], normals, expected ln radiance, posterior [N, 7] as estimate.runtime.POSTERIOR has it.

    """

    def __init__(self, net: LightNet, sureness: Sureness = AS_LEARNED) -> None:
        super().__init__()
        self.net = net
        self.sureness = sureness

    def forward(
        self,
        photo: torch.Tensor,
        tan_half: torch.Tensor,
        given_normals: torch.Tensor,
        surroundings: torch.Tensor,
        material: torch.Tensor,
    ) -> tuple[torch.Tensor, ...]:
        guess = self.net(photo, tan_half, given_normals, surroundings, material)
        slope, offset = self.sureness.logit
        of_reflectance, of_level, of_color = self.sureness.errors
        confidence = torch.sigmoid(slope * guess.confidence_logit + offset)
        metal, others = guess.posterior.split([1, 6], dim=1)
        factors = others.new_tensor([1.0, 1.0, 1.0, of_reflectance, of_level, 10 * of_color])
        posterior = torch.cat([torch.sigmoid(metal), torch.exp(others) * factors], dim=1)
        shown = guess.features.irradiance, guess.ln_radiance, confidence, guess.normals, guess.ln_expected
        return *shown, posterior


def graphs_of(nets: nn.ModuleDict, sureness: Sureness = AS_LEARNED) -> dict[str, Graph]:
    """The graphs that a run's networks become, by stage."""
    if "light" in nets:
        net = LightGraph(nets["light"], sureness).eval()
        shapes = dict(zip(LIFT_INPUTS, (PHOTO, (1, 1), NORMALS, SURROUNDINGS, (1, MATERIAL_INPUTS)), strict=True))
        return {"light": Graph(net=net, inputs=shapes, outputs=LIFT_OUTPUTS, median=True)}
    inputs = {"irradiance": PHOTO, "illumination": PHOTO, "hdr": (1, 3, MAP_HEIGHT, 2 * MAP_HEIGHT)}
    return {stage: Graph(net=nets[stage], inputs={"input": shape}) for stage, shape in inputs.items()}


def export(checkpoint: Path, folder: Path, sureness: Sureness = AS_LEARNED) -> dict[str, float]:
    """Write the graphs of a run and return each one's largest difference from torch.

    Raises:
        ModelError: a graph disagrees with its network by more than TOLERANCE.
    """
    nets = load_nets(checkpoint)
    stored = read_checkpoint(checkpoint)
    config = json.loads(stored["config"])
    recipe = {
        "run": config["name"],
        "steps": str(stored["step"]),
        "pairs": str(pairs_seen(stored)),
        "config": stored["config"],
        "sureness": " ".join(f"{value:g}" for value in (*sureness.logit, *sureness.errors)),
        **provenance(stored),
    }
    return {
        stage: _export_stage(stage, graph, recipe, folder / f"{stage}.onnx")
        for stage, graph in graphs_of(nets, sureness).items()
    }


def provenance(stored: Mapping[str, Any]) -> dict[str, str]:
    """Provenance of a checkpoint's weights besides its own steps, as far as known:

    start           identity of the file of weights that the run began from, or "nothing"
    assets          the maps and shapes of its data, as dataloader.name_assets has them
    mean_with       identity of the file of weights that they are the mean with
    mean_with_pairs the pairs that those have seen
    """
    origin, other = stored.get("origin", {}), stored.get("mean_with", {})
    known = {
        "start": (origin["start"] or "nothing") if "start" in origin else None,
        "assets": origin.get("assets"),
        "mean_with": other.get("start"),
        "mean_with_pairs": other.get("pairs"),
    }
    return {name: str(value) for name, value in known.items() if value is not None}


def _export_stage(stage: str, graph: Graph, recipe: dict[str, str], path: Path) -> float:
    """One network: batch normalisation folded, weights stored as float16, computed as float32."""
    import onnx
    import onnxruntime

    generator = torch.Generator().manual_seed(0)
    examples = tuple(_smooth(shape, generator) for shape in graph.inputs.values())
    with atomic_path(path) as temporary:
        torch.onnx.export(
            graph.net,
            examples,
            str(temporary),
            input_names=list(graph.inputs),
            output_names=list(graph.outputs),
            dynamic_axes={name: {0: "n"} for name in (*graph.inputs, *graph.outputs)},
            opset_version=17,
            dynamo=False,
        )
        model = onnx.load(str(temporary))
        store_half(model)
        onnx.helper.set_model_props(model, {**CONTRACT, "stage": stage, "computes": FLOATS, **recipe})
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = graph.net(*examples)
        expected = (expected,) if isinstance(expected, torch.Tensor) else expected
        found = session.run(None, dict(zip(graph.inputs, (one.numpy() for one in examples), strict=True)))
        typical = np.median if graph.median else np.max
        difference = max(float(typical(np.abs(a - b.numpy()))) for a, b in zip(found, expected, strict=True))
        if not difference <= TOLERANCE:
            raise ModelError(f"{stage}: expected ONNX within {TOLERANCE} of torch, got {difference:.3g}")
    return difference


def _smooth(shape: tuple[int, ...], generator: torch.Generator) -> torch.Tensor:
    """Numbers in [0, 1]; pictures as smooth as photos are, since in noise a last bit may turn a normal around."""
    if len(shape) < 4:
        return torch.rand(shape, generator=generator)
    coarse = torch.rand((*shape[:2], 8, 8), generator=generator)
    return F.interpolate(coarse, size=shape[2:], mode="bilinear", align_corners=False)


def store_half(model) -> None:
    """Keep large float32 weights as float16 behind a Cast, equal ones once; the runtime widens them when it opens."""
    import onnx
    from onnx import numpy_helper

    casts, kept, renamed = [], {}, {}
    for tensor in list(model.graph.initializer):
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < 1024:
            continue
        name = tensor.name
        model.graph.initializer.remove(tensor)
        first = kept.setdefault((values.shape, values.tobytes()), name)
        if first != name:
            renamed[name] = first
            continue
        model.graph.initializer.append(numpy_helper.from_array(values.astype(np.float16), name + "_half"))
        casts.append(onnx.helper.make_node("Cast", [name + "_half"], [name], to=onnx.TensorProto.FLOAT))
    for node in model.graph.node:
        node.input[:] = [renamed.get(name, name) for name in node.input]
    for node in reversed(casts):
        model.graph.node.insert(0, node)


EXACT = ("/head/", "/sphere/up.2/", "/object/first/", "/object/up.3/")
"""Parts of the names of convolutions that stay in float: the heads, and the scales beside the environment map and the
irradiance image, where 256 steps show (LDR SSIM -.005, irradiance RMSE +1 %)."""
INT8_TOLERANCE = 0.03
"""In display values: how much the steps may change a map on the mean; those of the shipped weights by .0125."""
CHECKED = 24
"""Examples, evenly out of all, on which that is looked at."""


def lift_examples(pairs: Iterable[Pair]) -> Iterator[dict[str, np.ndarray]]:
    """What the lifting model's graph is given for pairs: every choice of normals, surroundings and material in turn."""
    for k, pair in enumerate(pairs):
        normals = true_normals(pair) if k % 2 else None
        surroundings_map = surroundings(pair) if k % 4 > 1 else None
        material = pair.material if k % 8 > 3 else None
        yield lift_inputs(pair.crop, pair.tan_half, normals, surroundings_map, material)


def quantize(source: Path, target: Path, examples: Iterable[dict[str, np.ndarray]]) -> float:
    """Write a graph of export_onnx.export again, with the same inputs, outputs and contract, but for "computes".

    Args:
        examples: its inputs by name, as many as there are; the ranges are theirs.
    Returns:
        How much its steps change the map: mean difference of display values on some of the examples.
    Raises:
        ModelError: no example, a graph without the convolutions of EXACT, or one that its steps change by more than
            INT8_TOLERANCE.
    """
    import onnx
    from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
    from onnxruntime.quantization.shape_inference import quant_pre_process

    given = list(examples)
    if not given:
        raise ModelError(f"{source.name}: expected examples to see its ranges on, got none; add some")

    class Examples(CalibrationDataReader):
        rest = iter(given)

        def get_next(self) -> dict[str, np.ndarray] | None:
            return next(self.rest, None)

    with TemporaryDirectory() as folder, atomic_path(target) as temporary:
        plain = Path(folder) / source.name
        quant_pre_process(str(source), str(plain), skip_symbolic_shape=True)  # folds the half floats' casts
        nodes = onnx.load(str(plain)).graph.node
        names = [node.name for node in nodes if node.op_type == "Conv"]
        exact = [name for name in names if any(part in name for part in EXACT)]
        if not all(any(part in name for name in exact) for part in EXACT):
            raise ModelError(
                f"{source.name}: expected convolutions named {' and '.join(EXACT)}, got none; use a run of lift"
            )
        quantize_static(
            str(plain),
            str(temporary),
            Examples(),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=["Conv"],
            nodes_to_exclude=exact,
        )
        model = onnx.load(str(temporary))
        store_half(model)
        contract = {entry.key: entry.value for entry in onnx.load(str(source)).metadata_props}
        contract["computes"] = INT8
        onnx.helper.set_model_props(model, contract)  # without what the tools note there
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        changed = difference(source, temporary, given[:: -(-len(given) // CHECKED)])
        if not changed <= INT8_TOLERANCE:
            raise ModelError(
                f"{source.name}: expected 8 bits to change maps by {INT8_TOLERANCE} in display values at most, got "
                f"{changed:.3g}; keep more convolutions in EXACT"
            )
    return changed


def difference(one: Path, other: Path, examples: Iterable[dict[str, np.ndarray]]) -> float:
    """Between the maps of two graphs of the lifting model: mean over examples, in display values."""
    sessions = [open_graph(path) for path in (one, other)]

    def shown(session, example: dict[str, np.ndarray]) -> np.ndarray:
        return response(np.exp(np.minimum(session.run(["ln_radiance"], example)[0], LN_MAX)))

    return float(np.mean([np.abs(np.subtract(*(shown(s, one) for s in sessions))).mean() for one in examples]))
