"""A model's networks as ONNX graphs, checked against their contract."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from functools import partial
from importlib import resources
from pathlib import Path

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.response import MEAN_CURVE
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import ModelError
from anyprobe.estimate.light_graph import INPUTS, OUTPUTS, Said
from anyprobe.estimate.window import Crop, crop_of
from anyprobe.files.graphs import CPU, open_graph
from anyprobe.files.onnx_runtime import onnxruntime
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.paper.chain import estimate_light

CONTRACT = {
    "contract": "3",
    "frame": "right-handed +X right +Y up camera -Z; u = 0.5 + atan2(x, -z) / 2 pi",
    "logarithm": "natural",
    "curve": f"exponent {MEAN_CURVE.exponent} sigma {MEAN_CURVE.sigma}",
    "map_height": str(MAP_HEIGHT),
}
"""Metadata that every graph carries; another value means other conventions, and is refused."""

STAGES: tuple[str, ...] = tuple(contract("graph")["chain"])
"""The paper's chain, one graph each."""
LIGHT_STAGE = "light"
"""The one graph of the model that takes a whole photo, see estimate.light_graph."""
FIRST_STAGES = (LIGHT_STAGE, STAGES[0])
PHOTO_SIZE: int = contract("sizes")["crop"]
CHAIN_PICTURES = dict.fromkeys(STAGES[:2], (4, PHOTO_SIZE, PHOTO_SIZE)) | {STAGES[2]: (3, MAP_HEIGHT, 2 * MAP_HEIGHT)}
"""Shape of the picture that each stage of the chain takes."""
TAKES = {(LIGHT_STAGE,): frozenset({"normals", "surroundings", "material"}), STAGES: frozenset()}
"""Hints that a model of these stages uses, beside the lens; others are refused."""


def bundled_models() -> list[str]:
    """Names of the models in the package."""
    root = Path(str(resources.files("anyprobe") / "weights"))
    return sorted(path.parent.name for first in FIRST_STAGES for path in root.glob(f"*/{first}.onnx"))


def weights_folder(model: str) -> Path:
    """Return where a model lives: a bundled one's name, or a folder of its graphs; ModelError if neither."""
    root = Path(str(resources.files("anyprobe") / "weights"))
    for folder in (root / model, Path(model)):
        if model and any((folder / f"{first}.onnx").is_file() for first in FIRST_STAGES):
            return folder
    if not root.is_dir():
        text = "expected anyprobe in a folder, got an archive, whose networks cannot be opened; install it"
        raise ModelError(text, subject="model")
    names = bundled_models()
    raise ModelError(
        f"expected one of {', '.join(names) or 'none'}, or a folder with light.onnx, or with "
        f"irradiance.onnx, illumination.onnx and hdr.onnx, got {model!r}{did_you_mean(model, names)}",
        subject="model",
    )


def stages_of(folder: Path) -> tuple[str, ...]:
    """Names of the graphs in a model's folder, in the order they run."""
    return (LIGHT_STAGE,) if (folder / f"{LIGHT_STAGE}.onnx").is_file() else STAGES


class Models:
    """Sessions opened once and used for many photos; safe to share between threads.

    `lift` is light.onnx. `paper` has a graph for each stage of the paper's Fig. 2.

    Attributes:
        takes: hints that it uses, see TAKES.
    """

    def __init__(self, model: str = DEFAULT_MODEL, threads: int | None = None, providers: Sequence[str] = CPU) -> None:
        """Open a bundled model by name, or a folder of graphs.

        threads: cores for one network; None leaves it to ONNX Runtime.
        providers: of ONNX Runtime, the preferred first; see files.graphs.open_graph.
        """
        folder = weights_folder(model)
        self.name, self.stages = model, stages_of(folder)
        self.takes = TAKES[self.stages]
        self._sessions = {stage: _open(folder / f"{stage}.onnx", stage, threads, providers) for stage in self.stages}

    def __call__(self, inputs: Mapping[str, np.ndarray]) -> Said:
        """Estimate the light of one photo; inputs: of light_graph.graph_inputs, of which `paper` sees the object."""
        if self.stages == STAGES:
            return self._chain(crop_of(inputs, PHOTO_SIZE))
        outputs = self._sessions[LIGHT_STAGE].run(None, {name: inputs[name] for name in INPUTS})
        return Said(**{name: one[0] for name, one in zip(OUTPUTS, outputs, strict=True)})

    def _chain(self, crop: Crop) -> Said:
        photo = np.ascontiguousarray(crop.image.transpose(2, 0, 1)[None], dtype=np.float32)
        irradiance_net, illumination_net, hdr_net = (partial(self._picture, one, crop.tan_half) for one in STAGES)
        made = estimate_light(photo, irradiance_net, illumination_net, hdr_net)
        irradiance, radiance = (one[0].transpose(1, 2, 0) for one in (made.irradiance, made.radiance))
        return Said(
            radiance=np.maximum(rotate(radiance, crop.camera_from_crop), 0.0),
            crop=crop.image,
            crop_frame=np.vstack([crop.camera_from_crop, [[crop.tan_half, *crop.center_px]]]),
            irradiance=irradiance.clip(0.0, 1.0),
        )

    def _picture(self, stage: str, tan_half: float, picture: np.ndarray) -> np.ndarray:
        """Run a stage of the chain; its graph may also ask for the tangent of half the field of view."""
        names = (one.name for one in self._sessions[stage].get_inputs())
        values = (picture, np.full((1, 1), tan_half, np.float32))
        return self._sessions[stage].run(None, dict(zip(names, values, strict=False)))[0]


def _open(path: Path, stage: str, threads: int | None, providers: Sequence[str]) -> onnxruntime.InferenceSession:
    session = open_graph(path, threads, providers)
    found = session.get_modelmeta().custom_metadata_map
    for key, value in {**CONTRACT, "stage": stage}.items():
        if found.get(key) != value:
            raise ModelError(
                f"expected {key} = {value!r}, got {found.get(key)!r}; use weights of this version", source=path.name
            )
    if stage == LIGHT_STAGE:
        _check_names(path, "inputs", INPUTS, session.get_inputs())
        _check_names(path, "outputs", OUTPUTS, session.get_outputs())
    elif (shape := tuple(session.get_inputs()[0].shape[1:])) != CHAIN_PICTURES[stage]:
        raise ModelError(
            f"expected a network of pictures {CHAIN_PICTURES[stage]}, got {shape}; train it in full size",
            source=path.name,
        )
    return session


def _check_names(path: Path, what: str, expected: tuple[str, ...], found: list) -> None:
    names = tuple(one.name for one in found)
    if names != expected:
        raise ModelError(
            f"expected {what} {', '.join(expected)}, got {', '.join(names)}; use weights of this version",
            source=path.name,
        )


def file_hashes(model: str) -> dict[str, str]:
    """First 12 hexadecimal digits of SHA-256 of each graph: the model's identity."""
    folder = weights_folder(model)
    missing = next((stage for stage in stages_of(folder) if not (folder / f"{stage}.onnx").is_file()), None)
    if missing is not None:
        raise ModelError(f"expected {missing}.onnx in it, found none; get the whole model", source=folder)
    return {
        stage: hashlib.sha256((folder / f"{stage}.onnx").read_bytes()).hexdigest()[:12] for stage in stages_of(folder)
    }


def model_id(model: str) -> str:
    """Name and a hash over the graphs, as sidecars carry it."""
    joined = "".join(file_hashes(model).values())
    return f"{weights_folder(model).name}-{hashlib.sha256(joined.encode()).hexdigest()[:8]}"
