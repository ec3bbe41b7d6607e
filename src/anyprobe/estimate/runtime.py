"""A model's networks as ONNX graphs, checked against their contract."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from functools import partial
from importlib import resources
from pathlib import Path

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.core.contract import contract
from anyprobe.core.frames import turn_towards
from anyprobe.core.resample import overlaps
from anyprobe.core.response import MEAN_CURVE
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import ModelError
from anyprobe.estimate.light_graph import CROP_MARGIN, INPUTS, OUTPUTS, Said
from anyprobe.files.graphs import CPU, check_metadata, onnxruntime, open_graph
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.masks.check import object_box
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
TAKES = {(LIGHT_STAGE,): frozenset({"normals", "surroundings", "material", "sun"}), STAGES: frozenset()}
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
            return self._chain(*crop_of(inputs))
        outputs = self._sessions[LIGHT_STAGE].run(None, {name: inputs[name] for name in INPUTS})
        return Said(**{name: one[0] for name, one in zip(OUTPUTS, outputs, strict=True)})

    def _chain(self, image: np.ndarray, frame: np.ndarray) -> Said:
        photo = np.ascontiguousarray(image.transpose(2, 0, 1)[None], dtype=np.float32)
        irradiance_net, illumination_net, hdr_net = (partial(self._picture, stage) for stage in STAGES)
        made = estimate_light(photo, irradiance_net, illumination_net, hdr_net)
        irradiance, radiance = (one[0].transpose(1, 2, 0) for one in (made.irradiance, made.radiance))
        radiance = np.maximum(rotate(radiance, frame[:3]), 0.0)
        return Said(radiance=radiance, crop=image, crop_frame=frame, irradiance=irradiance.clip(0.0, 1.0))

    def _picture(self, stage: str, picture: np.ndarray) -> np.ndarray:
        return self._sessions[stage].run(None, {"input": picture})[0]


def crop_of(inputs: Mapping[str, np.ndarray], size: int = PHOTO_SIZE) -> tuple[np.ndarray, np.ndarray]:
    """Cut the square around the object out of its window, for the paper's chain.

    Averaged over areas when shrinking, linear when enlarging, with colour premultiplied by the mask so that no
    background bleeds in. What lies over the border of the photo is empty.

    Args:
        inputs: of light_graph.graph_inputs.
    Returns:
        crop [size, size, 4] and crop_frame [4, 3] of light_graph.Said.
    """
    window = inputs["window"][0]
    width, height, _, left, top, step = (float(one) for one in inputs["geometry"][0])
    x0, y0, x1, y1 = object_box(window[..., 3])
    center, side = np.array([x0 + x1, y0 + y1]) / 2, CROP_MARGIN * max(x1 - x0, y1 - y0)
    sides = (np.linspace(middle - side / 2, middle + side / 2, size + 1) for middle in center[::-1])
    rows, columns = (_shares(borders, count) for borders, count in zip(sides, window.shape, strict=False))
    mask = window[..., 3:]
    values = np.concatenate([window[..., :3].clip(max=1.0) * mask, mask], axis=-1)
    image = np.einsum("ih,hwc,jw->ijc", rows, values, columns, optimize=True)
    focal = max(width, height) / 2.0 / float(inputs["lens"][0, 0])
    x, y = (left, top) + step * center
    ray = PinholeCamera(width=int(width), height=int(height), focal=focal).ray((x, y))
    # away from the photo's centre a pixel takes in less: by cos^2 along the radius, by cos across it
    tan_half = step * side / 2 / focal * (-ray[2]) ** 1.5
    return image.clip(0.0, 1.0), np.vstack([turn_towards(ray), [[tan_half, x, y]]])


def _shares(borders: np.ndarray, count: int) -> np.ndarray:
    """Return the weights [S, count] float32 of an axis' pixels in samples between borders [S + 1]."""
    step = borders[1] - borders[0]
    if step >= 1.0:
        return (overlaps(borders, count) / step).astype(np.float32)
    middle = (borders[:-1] + step / 2 - 0.5)[:, None]
    return np.clip(1.0 - np.abs(middle - np.arange(count)), 0.0, None).astype(np.float32)


def _open(path: Path, stage: str, threads: int | None, providers: Sequence[str]) -> onnxruntime.InferenceSession:
    session = open_graph(path, threads, providers)
    check_metadata(session, {**CONTRACT, "stage": stage}, path.name)
    if stage == LIGHT_STAGE:
        _check_names(path, "inputs", INPUTS, session.get_inputs())
        _check_names(path, "outputs", OUTPUTS, session.get_outputs())
    elif (shape := tuple(session.get_inputs()[0].shape[1:])) != CHAIN_PICTURES[stage]:
        text = f"expected a network of pictures {CHAIN_PICTURES[stage]}, got {shape}; train it in full size"
        raise ModelError(text, source=path.name)
    return session


def _check_names(path: Path, what: str, expected: tuple[str, ...], found: list) -> None:
    names = tuple(one.name for one in found)
    if names != expected:
        text = f"expected {what} {', '.join(expected)}, got {', '.join(names)}; use weights of this version"
        raise ModelError(text, source=path.name)


def file_hashes(model: str) -> dict[str, str]:
    """First 12 hexadecimal digits of SHA-256 of each graph: the model's identity."""
    folder = weights_folder(model)
    graphs = {stage: folder / f"{stage}.onnx" for stage in stages_of(folder)}
    missing = next((graph.name for graph in graphs.values() if not graph.is_file()), None)
    if missing is not None:
        raise ModelError(f"expected {missing} in it, found none; get the whole model", source=folder)
    return {stage: hashlib.sha256(graph.read_bytes()).hexdigest()[:12] for stage, graph in graphs.items()}


def model_id(model: str) -> str:
    """Name and a hash over the graphs, as sidecars carry it."""
    joined = "".join(file_hashes(model).values())
    return f"{weights_folder(model).name}-{hashlib.sha256(joined.encode()).hexdigest()[:8]}"
