"""Models (noun): the three networks as ONNX graphs, checked against their contract."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import onnxruntime

from anyprobe.core.response import MEAN_CURVE
from anyprobe.errors import ModelError
from anyprobe.light.environment import MAP_HEIGHT

CONTRACT = {
    "contract": "1",
    "frame": "right-handed +X right +Y up camera -Z; u = 0.5 + atan2(x, -z) / 2 pi",
    "logarithm": "natural",
    "curve": f"exponent {MEAN_CURVE.exponent} sigma {MEAN_CURVE.sigma}",
    "map_height": str(MAP_HEIGHT),
}
"""Metadata that every graph carries; another value means other conventions, and is refused."""

STAGES = ("irradiance", "illumination", "hdr")
PHOTO_SIZE = 128
DEFAULT_MODEL = "paper"


@dataclass(frozen=True, kw_only=True, slots=True)
class StageOutputs:
    """What the three networks say, in the crop's frame.

    irradiance [128, 128, 3] display; ldr [H, 2H, 3] display; ln_radiance [H, 2H, 3].
    """

    irradiance: np.ndarray
    ldr: np.ndarray
    ln_radiance: np.ndarray


def weights_folder(model: str) -> Path:
    """Where a model lives: a bundled one's name, or a folder of three graphs; ModelError if neither."""
    root = Path(str(resources.files("anyprobe") / "weights"))
    for folder in (root / model, Path(model)):
        if model and (folder / "irradiance.onnx").is_file():
            return folder
    names = sorted(p.parent.name for p in root.glob("*/irradiance.onnx"))
    raise ModelError(
        f"model {model!r}: expected one of {', '.join(names) or 'none installed'}, or a folder with "
        "irradiance.onnx, illumination.onnx and hdr.onnx"
    )


class Models:
    """Three sessions, opened once and used for many photos; safe to share between threads."""

    def __init__(self, model: str = DEFAULT_MODEL, threads: int | None = None) -> None:
        """Open a bundled model by name, or a folder of graphs.

        threads: cores for one network; None leaves it to the runtime.
        """
        self.name = model
        folder = weights_folder(model)
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3
        if threads is not None:
            options.intra_op_num_threads = threads
        self._sessions = {stage: _open(folder / f"{stage}.onnx", stage, options) for stage in STAGES}

    def __call__(self, image: np.ndarray) -> StageOutputs:
        """Run the chain on a crop [128, 128, 4]: display RGB times mask, and mask."""
        photo = np.ascontiguousarray(image.transpose(2, 0, 1)[None], dtype=np.float32)
        irradiance = self._run("irradiance", photo)
        ldr = self._run("illumination", np.concatenate([irradiance, photo[:, 3:]], axis=1))
        ln_radiance = self._run("hdr", ldr)
        return StageOutputs(
            irradiance=_image(irradiance).clip(0.0, 1.0), ldr=_image(ldr), ln_radiance=_image(ln_radiance)
        )

    def _run(self, stage: str, value: np.ndarray) -> np.ndarray:
        session = self._sessions[stage]
        return session.run(None, {session.get_inputs()[0].name: value})[0]


def _image(batch: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(batch[0].transpose(1, 2, 0))


def _open(path: Path, stage: str, options: onnxruntime.SessionOptions) -> onnxruntime.InferenceSession:
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no common base class for its errors
        raise ModelError(
            f"{path.name}: expected a readable ONNX graph, got a damaged file; reinstall anyprobe"
        ) from error
    found = session.get_modelmeta().custom_metadata_map
    for key, value in {**CONTRACT, "stage": stage}.items():
        if found.get(key) != value:
            raise ModelError(
                f"{path.name}: expected {key} = {value!r}, got {found.get(key)!r}; use weights of this version"
            )
    return session


def file_hashes(model: str) -> dict[str, str]:
    """First 12 hexadecimal digits of SHA-256 of each graph: the model's identity."""
    folder = weights_folder(model)
    return {
        stage: hashlib.sha256((folder / f"{stage}.onnx").read_bytes()).hexdigest()[:12] for stage in STAGES
    }


def model_id(model: str) -> str:
    """Name and a hash over the three graphs, as sidecars carry it."""
    joined = "".join(file_hashes(model).values())
    return f"{weights_folder(model).name}-{hashlib.sha256(joined.encode()).hexdigest()[:8]}"
