"""A model's networks as ONNX graphs, checked against their contract."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, ModelError
from anyprobe.files.graphs import CPU, open_graph
from anyprobe.files.onnx_runtime import onnxruntime
from anyprobe.given_material import MATERIAL_INPUTS, material_input
from anyprobe.inputs.settings import DEFAULT_MODEL, EMITTERS, EXPECTED, MODE
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.notices import give
from anyprobe.paper.equations import LN_MAX, reconstruct
from anyprobe.scatter.materials import Material

if TYPE_CHECKING:
    from jaxtyping import Float

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
LIFT_STAGES = ("light",)
"""The model that lifts pixels to the map: one graph."""
WHOLE = "whole"
"""A graph beside it, which completes its answer by what the photo shows around the object."""
WHOLE_INPUTS: tuple[str, ...] = tuple(contract("graph")["whole"]["inputs"])
WHOLE_OUTPUTS: tuple[str, ...] = tuple(contract("graph")["whole"]["outputs"])
LIFT_INPUTS: tuple[str, ...] = tuple(contract("graph")["inputs"])
LIFT_OUTPUTS: tuple[str, ...] = tuple(contract("graph")["outputs"])
POSTERIOR = ("metal", "red", "green", "blue", "reflectance_error", "level_error", "color_error")
"""Estimates of the object and of the map's errors: probability of a metal, total reflectance RGB, and mean errors
of its logarithm, of ln of the map's level and of its mean colour in degrees."""
FIRST_STAGES = (LIFT_STAGES[0], STAGES[0])
PHOTO_SIZE: int = contract("sizes")["crop"]
NORMALS_SIZE: int = contract("sizes")["normals"]
CONTEXT_SIZE: int = contract("sizes")["context"]
"""Side of the context picture."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Outputs:
    """A model's answer for one crop, in the crop's frame.

    radiance [H, 2H, 3]: the map, in the photo's exposure units; irradiance [128, 128, 3] display;
    ldr [H, 2H, 3] display and ln_radiance [H, 2H, 3]: the maps that it was made from.
    confidence [H, 2H]: probability that a pixel's display value is within 0.1; normals [64, 64, 3]: unit, the
    estimated ones or those that were given; posterior: by the names of POSTERIOR; posture [3]: of the camera, pitch
    downwards and its mean error, and roll, radians in the crop's frame; expected [H, 2H, 3]: the map with light sources
    spread over all likely places by their probability. None from a model that does not give it.
    """

    radiance: np.ndarray
    irradiance: np.ndarray
    ldr: np.ndarray
    ln_radiance: np.ndarray
    confidence: np.ndarray | None = None
    normals: np.ndarray | None = None
    posterior: dict[str, float] | None = None
    posture: np.ndarray | None = None
    expected: np.ndarray | None = None

    def with_map(
        self, radiance: Float[np.ndarray, "H 2*H 3"], confidence: Float[np.ndarray, "H 2*H"] | None
    ) -> Outputs:
        """Return the same with another map, LDR and ln maps that are this one's, and its confidence."""
        return replace(
            self,
            radiance=radiance,
            ldr=response(radiance),
            ln_radiance=np.log(np.maximum(radiance, 1e-6)),
            confidence=confidence,
        )


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
    names = bundled_models()
    raise ModelError(
        f"expected one of {', '.join(names) or 'none installed'}, or a folder with light.onnx, or with "
        f"irradiance.onnx, illumination.onnx and hdr.onnx, got {model!r}{did_you_mean(model, names)}",
        subject="model",
    )


def stages_of(folder: Path) -> tuple[str, ...]:
    """Names of the graphs in a model's folder, in the order they run."""
    if (folder / "light.onnx").is_file():
        return (*LIFT_STAGES, WHOLE) if (folder / f"{WHOLE}.onnx").is_file() else LIFT_STAGES
    return STAGES


class Models:
    """Sessions opened once and used for many photos; safe to share between threads.

    `paper` has a graph for each stage of the paper's Fig. 2; the last two give Eq. 7's map.

    `light.onnx` takes, of N = 1 and in this order, LIFT_INPUTS: photo [N, 4, 128, 128], display RGB times mask, and
    mask; tan_half [N, 1], tangent of half the crop's field of view; given_normals [N, 3, 64, 64], zero where unknown;
    surroundings [N, 4, 64, 128], display RGB times cover, and cover; material [N, 8], see material_input, or zero. It
    gives LIFT_OUTPUTS: irradiance [N, 3, 128, 128], ln_radiance [N, 3, 64, 128], confidence [N, 1, 64, 128], normals
    [N, 3, 64, 64], ln_expected [N, 3, 64, 128], and posterior [N, 7] of POSTERIOR.
    """

    def __init__(
        self,
        model: str = DEFAULT_MODEL,
        threads: int | None = None,
        providers: Sequence[str] = CPU,
        emitters: str = MODE,
    ) -> None:
        """Open a bundled model by name, or a folder of graphs.

        threads: cores for one network; None leaves it to ONNX Runtime.
        providers: of ONNX Runtime, the preferred first; see files.graphs.open_graph.
        emitters: one of EMITTERS; the paper's chain knows only those that it draws.
        """
        folder = weights_folder(model)
        self.name, self.stages = model, stages_of(folder)
        self.emitters = self._check_emitters(emitters)
        self._sessions = {stage: _open(folder / f"{stage}.onnx", stage, threads, providers) for stage in self.stages}

    def _run(self, stage: str, *values: np.ndarray) -> list[np.ndarray]:
        """Run a graph on one array for each of its inputs, in its order; return its outputs."""
        session = self._sessions[stage]
        return session.run(None, dict(zip((one.name for one in session.get_inputs()), values, strict=True)))

    @property
    def lifts(self) -> bool:
        """Whether it lifts pixels to the map, and so takes hints."""
        return LIFT_STAGES[0] in self.stages

    def with_emitters(self, emitters: str) -> Models:
        """Return the same sessions, asked for other emitters; InputError if this model does not know them."""
        other = copy(self)
        other.emitters = self._check_emitters(emitters)
        return other

    def _check_emitters(self, emitters: str) -> str:
        if emitters not in EMITTERS:
            advice = did_you_mean(emitters, EMITTERS)
            raise InputError(f"expected one of {', '.join(EMITTERS)}, got {emitters!r}{advice}", subject="emitters")
        if emitters != MODE and not self.lifts:
            raise InputError(
                f"expected a model that estimates their distribution, got {self.name}",
                subject="emitters",
                remedy=give(model=DEFAULT_MODEL),
            )
        return emitters

    def __call__(
        self,
        image: Float[np.ndarray, "128 128 4"],
        tan_half: float,
        normals: Float[np.ndarray, "64 64 3"] | None = None,
        surroundings: np.ndarray | None = None,
        material: Material | None = None,
        context: np.ndarray | None = None,
        up: Float[np.ndarray, " 3"] | None = None,
    ) -> Outputs:
        """Run on a crop.

        Args:
            image: [128, 128, 4], display RGB times mask, and mask.
            tan_half: tangent of half the field of view of the crop's side.
            normals: [64, 64, 3] in the crop's frame, unit, zero where they are not known; None: nowhere.
            surroundings: [64, 128, 4 or 5] known part of the map in the crop's frame, see estimate.surroundings; None:
                nothing.
            material: of the object; None: not known.
            context: [96, 96, 5] the photo around the object, see estimate.photo.Crop; None: not given.
            up: [3] away from the ground, in the crop's frame; None: not known. The paper's chain ignores all of these.
        """
        if self.lifts:
            given = lift_inputs(image, tan_half, normals, surroundings, material)
            return self._lift(given, context, up)
        return self._chain(_batch(image), np.array([[tan_half]], np.float32))

    def _chain(self, photo: np.ndarray, tan_half: np.ndarray) -> Outputs:
        (irradiance,) = self._run("irradiance", photo, tan_half)
        (ldr,) = self._run("illumination", np.concatenate([irradiance, photo[:, 3:]], axis=1), tan_half)
        (ln_radiance,) = self._run("hdr", ldr)
        ldr, ln_radiance = _image(ldr), _image(ln_radiance)
        return Outputs(
            radiance=reconstruct(ldr, ln_radiance),  # Eq. 7-8
            irradiance=_image(irradiance).clip(0.0, 1.0),
            ldr=ldr,
            ln_radiance=ln_radiance,
        )

    def _lift(self, given: dict[str, np.ndarray], context: np.ndarray | None, up: np.ndarray | None) -> Outputs:
        irradiance, drawn, confidence, normals, spread, posterior = self._run("light", *given.values())
        posture = None
        if context is not None and WHOLE in self.stages:
            alone = {"alone_expected": spread, "alone_radiance": drawn, "alone_confidence": confidence}
            known = {**given, **whole_inputs(context, up), **alone, "posterior": posterior}
            drawn, spread, confidence, posture = self._run(WHOLE, *(known[name] for name in WHOLE_INPUTS))
        ln_radiance = _image(spread if self.emitters == EXPECTED else drawn)
        radiance = np.exp(np.minimum(ln_radiance, LN_MAX))
        return Outputs(
            radiance=radiance,
            irradiance=_image(irradiance).clip(0.0, 1.0),
            ldr=response(radiance),
            ln_radiance=ln_radiance,
            confidence=confidence[0, 0],
            normals=_image(normals),
            posterior=dict(zip(POSTERIOR, posterior[0].tolist(), strict=True)),
            posture=None if posture is None else posture[0],
            expected=np.exp(np.minimum(_image(spread), LN_MAX)),
        )


def lift_inputs(
    image: np.ndarray,
    tan_half: float,
    normals: np.ndarray | None = None,
    surroundings: np.ndarray | None = None,
    material: Material | None = None,
) -> dict[str, np.ndarray]:
    """Return the inputs of the lifting model's graph for one crop, see Models, in the order of LIFT_INPUTS."""
    normals = np.zeros((NORMALS_SIZE, NORMALS_SIZE, 3)) if normals is None else normals
    surroundings = np.zeros((MAP_HEIGHT, 2 * MAP_HEIGHT, 4)) if surroundings is None else surroundings
    surroundings = np.minimum(
        surroundings[..., :4], surroundings[..., 3:4]
    )  # display values, whatever is known above white
    described = np.zeros(MATERIAL_INPUTS, np.float32) if material is None else material_input(material)
    values = (
        _batch(image),
        np.array([[tan_half]], dtype=np.float32),
        _batch(normals),
        _batch(surroundings),
        described[None],
    )
    return dict(zip(LIFT_INPUTS, values, strict=True))


def whole_inputs(context: np.ndarray, up: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Return the inputs of the graph WHOLE beside those and the outputs of the first graph."""
    upright = np.zeros((1, 3), np.float32) if up is None else np.asarray(up, np.float32)[None]
    return {"context": _batch(context), "up": upright}


def _batch(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image.transpose(2, 0, 1)[None], dtype=np.float32)


def _image(batch: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(batch[0].transpose(1, 2, 0))


def _open(path: Path, stage: str, threads: int | None, providers: Sequence[str]) -> onnxruntime.InferenceSession:
    session = open_graph(path, threads, providers)
    found = session.get_modelmeta().custom_metadata_map
    for key, value in {**CONTRACT, "stage": stage}.items():
        if found.get(key) != value:
            raise ModelError(
                f"expected {key} = {value!r}, got {found.get(key)!r}; use weights of this version", source=path.name
            )
    if stage == WHOLE:
        _check_names(path, "inputs", WHOLE_INPUTS, session.get_inputs())
        _check_names(path, "outputs", WHOLE_OUTPUTS, session.get_outputs())
    if stage in LIFT_STAGES:
        _check_names(path, "inputs", LIFT_INPUTS, session.get_inputs())
        _check_names(path, "outputs", LIFT_OUTPUTS, session.get_outputs())
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
