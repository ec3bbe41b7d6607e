"""Normals of the photo by a third-party monocular estimator: an ONNX graph and a small spec, or any callable.

A graph FILE.onnx is described by FILE.json:

    axes     the axis of the camera's frame (+x right, +y up, +z towards the camera) that each output channel is,
             "x", "-y", ...; OpenCV's camera is ["x", "-y", "-z"]
    size     side of its square input in pixels, or [height, width]
    mean, std    subtracted from and divided by display values in [0, 1], one number or three; default 0 and 1
    encoding     "vector", or "picture" where it answers (n + 1) / 2; default "vector"
    input, output    names in the graph; default: its first
    inputs   what else it takes: names and numbers
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from anyprobe.core.frames import turn_towards
from anyprobe.errors import InputError, ModelError
from anyprobe.files.graphs import open_graph
from anyprobe.hints import NormalsEstimator
from anyprobe.masks.check import object_box
from anyprobe.pictures.resampling import resample

if TYPE_CHECKING:
    from jaxtyping import Float

WINDOW = 1.6
"""Side of the estimator's window over the longer side of the object's box: some surroundings help it."""
OUTWARD = 0.2
"""Smallest mean outward lean of normals near the outline; below it, axes are swapped."""
RIM = 0.08
"""Distance from the outline that counts as near, in sides of the object's box."""


@dataclass(frozen=True, kw_only=True, slots=True)
class NormalsSpec:
    """Inputs and outputs of a graph; see the module."""

    axes: tuple[str, str, str]
    size: int | tuple[int, int]
    mean: float | tuple[float, ...] = 0.0
    std: float | tuple[float, ...] = 1.0
    encoding: str = "vector"
    input: str | None = None
    output: str | None = None
    inputs: dict[str, float] = field(default_factory=dict)

    def frame(self) -> np.ndarray:
        """[3, 3]: from the graph's channels to the camera's axes; InputError if axes are none."""
        names = [str(axis).lstrip("+-") for axis in self.axes]
        if sorted(names) != ["x", "y", "z"]:
            raise InputError(f'axes: expected x, y and z in some order, each with or without "-", got {self.axes}')
        signs = [-1.0 if str(axis).startswith("-") else 1.0 for axis in self.axes]
        matrix = np.zeros((3, 3))
        for channel, (name, sign) in enumerate(zip(names, signs, strict=True)):
            matrix["xyz".index(name), channel] = sign
        return matrix


def open_normals_model(path: Path, threads: int | None = None) -> NormalsEstimator:
    """Open the estimator defined by a graph and the spec beside it.

    Raises:
        InputError: no graph, no spec, or an incomplete one.
        ModelError: a damaged graph, or one that does not match the spec.
    """
    spec = _read_spec(path.with_suffix(".json"))
    frame = spec.frame()
    if not path.is_file():
        raise InputError("no such file; check the path to the ONNX graph", source=path)
    session = open_graph(path, threads)
    height, width = (spec.size, spec.size) if isinstance(spec.size, int) else spec.size
    wanted = {one.name: one for one in session.get_inputs()}
    name = spec.input or next(iter(wanted))
    output = spec.output or session.get_outputs()[0].name
    outputs = [one.name for one in session.get_outputs()]
    missing = [one for one in wanted if one != name and one not in spec.inputs]
    if name not in wanted or output not in outputs or missing:
        raise ModelError(
            f"expected a graph with input {name} and output {output}, and a spec that gives all other "
            f"inputs, got {', '.join(wanted)} and {', '.join(outputs)}; mend {path.with_suffix('.json').name}",
            source=path.name,
        )
    dtypes = {"tensor(int64)": np.int64, "tensor(float16)": np.float16}
    others = {one: np.asarray(value, dtypes.get(wanted[one].type, np.float32)) for one, value in spec.inputs.items()}
    kind = dtypes.get(wanted[name].type, np.float32)

    def estimate(rgb: np.ndarray) -> np.ndarray:
        shown = (_resized(rgb, height, width) - np.asarray(spec.mean, np.float32)) / np.asarray(spec.std, np.float32)
        given = {name: shown.transpose(2, 0, 1)[None].astype(kind), **others}
        try:
            values = np.asarray(session.run([output], given)[0], np.float32)
        except Exception as error:  # the runtime has no common base class for its errors
            text = " ".join(str(error).split())[:80]
            raise ModelError(f"expected to take 1 x 3 x {height} x {width}, got: {text}", source=path.name) from error
        values = values[0] if values.ndim == 4 else values
        answer = values.shape
        if values.ndim == 3:
            values = values[:3].transpose(1, 2, 0) if answer[0] in (3, 4) else values[..., :3]
        if values.ndim != 3 or values.shape[-1] != 3:
            raise ModelError(f"expected three numbers a pixel, got shape {answer}", source=path.name)
        return (2.0 * values - 1.0 if spec.encoding == "picture" else values) @ frame.T

    return estimate


def _read_spec(path: Path) -> NormalsSpec:
    if not path.is_file():
        raise InputError(
            "expected a spec beside the graph, found none; see docs/how-to/inputs.md for what it holds", source=path
        )
    try:
        values = json.loads(path.read_bytes())  # of any Unicode
        known = {one.name for one in fields(NormalsSpec)}
        if not isinstance(values, dict) or not {"axes", "size"} <= set(values) <= known:
            raise ValueError(f"axes and size, and of {', '.join(sorted(known))} no others")
        values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
        spec = NormalsSpec(**values)
        np.broadcast_to(np.asarray(spec.mean, float), 3), np.broadcast_to(np.asarray(spec.std, float), 3)
        if np.size(spec.size) > 2 or not np.all(np.asarray(spec.size) >= 1) or len(spec.axes) != 3:
            raise ValueError("size of one number or two, axes of three")
        if spec.encoding not in ("vector", "picture"):
            raise ValueError("encoding vector or picture")
    except (ValueError, TypeError) as error:
        raise InputError(f"expected a spec with {' '.join(str(error).split())[:120]}", source=path) from error
    return spec


def estimated_normals(
    estimator: NormalsEstimator, rgb: np.ndarray, mask: np.ndarray, long_fov_deg: float
) -> Float[np.ndarray, "H W 3"]:
    """Estimate the normals of a photo's object in the camera's frame.

    The estimator is shown a window around the object, as a camera that looks at its centre would; what it answers is
    turned back.

    Args:
        rgb: [H, W, 3] display values. mask: [H, W] in [0, 1]. long_fov_deg: of the photo's longer side.
    Returns:
        [H, W, 3] float32, unit on the object, zero elsewhere.
    Raises:
        InputError: the answer has another shape, or normals near the outline do not point outwards.
    """
    x0, y0, x1, y1 = object_box(mask)
    side = max(x1 - x0, y1 - y0)
    reach = int(np.ceil(WINDOW * side / 2))
    rows = slice(max((y0 + y1) // 2 - reach, 0), min((y0 + y1) // 2 + reach, len(mask)))
    columns = slice(max((x0 + x1) // 2 - reach, 0), min((x0 + x1) // 2 + reach, mask.shape[1]))
    window = np.ascontiguousarray(rgb[rows, columns], np.float32)
    answer = np.asarray(estimator(window), np.float32)
    if answer.ndim != 3 or answer.shape[-1] != 3:
        raise InputError(f"expected an estimator that answers [h, w, 3], got shape {answer.shape}", subject="normals")
    center = (columns.start + columns.stop) / 2, (rows.start + rows.stop) / 2
    values = _resized(answer, *window.shape[:2]) @ _turn(center, mask.shape, long_fov_deg).T
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    inside = mask[rows, columns] > 0.5
    values = np.where(inside[..., None] & (length > 1e-3), values / np.maximum(length, 1e-3), 0.0)
    _check_outline(values, inside, RIM * side)
    result = np.zeros((*mask.shape, 3), np.float32)
    result[rows, columns] = values
    return result


def _turn(center: tuple[float, float], shape: tuple[int, int], long_fov_deg: float) -> np.ndarray:
    """Return the rotation [3, 3] to the photo's camera from one that looks at the pixel center (x, y)."""
    focal = max(shape) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    ray = np.array([center[0] - shape[1] / 2, shape[0] / 2 - center[1], -focal])
    return turn_towards(ray / np.linalg.norm(ray))


def _check_outline(normals: np.ndarray, inside: np.ndarray, rim_px: float) -> None:
    """Raise InputError if normals near the outline do not lean away from the object, as those of any round thing do."""
    soft = Image.fromarray((255 * inside).astype(np.uint8)).reduce(max(1, round(rim_px / 2)))
    cover = np.asarray(soft, np.float32) / 255
    down, right = np.gradient(_resized(cover[..., None], *inside.shape)[..., 0])
    steep = np.hypot(right, down)
    near = inside & (steep > 0.5 * steep.max())
    outward = np.stack([-right, down], axis=-1)[near] / np.maximum(steep[near], 1e-9)[:, None]
    lean = float((normals[near][:, :2] * outward).sum(axis=-1).mean()) if near.any() else 1.0
    facing = float(normals[inside][:, 2].mean())
    if lean < OUTWARD or facing < 0.0:
        raise InputError(
            "expected an estimator's in the camera's frame (+X right, +Y up, +Z towards it), got some that "
            f"lean outwards by {lean:.2f} at the outline and face the camera by {facing:.2f}; mend the axes",
            subject="normals",
        )


def _resized(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """Resize [H, W, C] float: means over areas where it shrinks, else bilinear."""
    if values.shape[:2] == (height, width):
        return np.asarray(values, np.float32)
    return resample(values, (width, height), smooth=height * width >= values.shape[0] * values.shape[1])
