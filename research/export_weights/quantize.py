"""Quantize: a graph's convolutions in 8-bit numbers, of the range that they have on examples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.errors import ModelError
from anyprobe.estimate.runtime import lift_inputs
from anyprobe.evaluate.methods import surroundings, true_normals
from anyprobe.files.atomic import atomic_path
from anyprobe.files.graphs import open_graph
from anyprobe.light.reconstruct import LN_MAX
from anyprobe.train.export_onnx import INT8, store_half

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
    """Write a graph of export_graphs again, with the same inputs, outputs and contract, but for "computes".

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
