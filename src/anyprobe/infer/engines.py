"""Engines that run a graph: ONNX Runtime on the CPU, always there; OpenVINO, faster where it is installed; CUDA."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime

from anyprobe.errors import InputError, MissingExtra

ENGINES = ("onnxruntime", "openvino", "openvino-bf16", "cuda")
DEFAULT_ENGINE = "onnxruntime"
CUDA = "CUDAExecutionProvider"
PRECISION = {"openvino": "f32", "openvino-bf16": "bf16"}

Run = Callable[..., list[np.ndarray]]
"""A graph's inputs, one array each in its order, to its outputs; safe to share between threads."""


def open_engine(session: onnxruntime.InferenceSession, path: Path, engine: str, threads: int | None) -> Run:
    """Run the graph at path, which session has open and checked, by an engine.

    openvino-bf16 computes in bfloat16 where the processor can: the fastest, and a little less exact
    (docs/conventions.md says by how much); the others compute in float32. cuda is ONNX Runtime on an NVIDIA GPU.

    Raises:
        InputError: no such engine, or cuda without a runtime or a GPU for it; MissingExtra: it is not installed.
    """
    if engine == "cuda":
        session = _open_cuda(path)
    if engine in ("onnxruntime", "cuda"):
        names = [given.name for given in session.get_inputs()]
        return lambda *values: session.run(None, dict(zip(names, values, strict=True)))
    if engine not in PRECISION:
        raise InputError(f"engine {engine!r}: expected one of {', '.join(ENGINES)}")
    return _openvino(
        path, {given.name: given.shape for given in session.get_inputs()}, threads, PRECISION[engine]
    )


def _open_cuda(path: Path) -> onnxruntime.InferenceSession:
    """A session of which the GPU computes what it can; ONNX Runtime by itself would go on without one, silently."""
    if CUDA in onnxruntime.get_available_providers():
        session = onnxruntime.InferenceSession(str(path), providers=[CUDA, "CPUExecutionProvider"])
        if CUDA in session.get_providers():
            return session
    raise InputError(
        "engine 'cuda': expected an NVIDIA GPU and onnxruntime-gpu in the place of onnxruntime, found none; "
        f"use {DEFAULT_ENGINE}"
    )


def _openvino(path: Path, shapes: dict[str, list], threads: int | None, precision: str) -> Run:
    try:
        import openvino
    except ImportError as error:
        raise MissingExtra("openvino", "openvino", "the engine openvino") from error
    model = openvino.Core().read_model(str(path))
    model.reshape({name: [1, *shape[1:]] for name, shape in shapes.items()})
    hints = {
        "PERFORMANCE_HINT": "LATENCY",
        "INFERENCE_PRECISION_HINT": precision,
        "INFERENCE_NUM_THREADS": threads or 0,
    }
    compiled = openvino.compile_model(model, "CPU", hints)
    request, one_at_a_time = compiled.create_infer_request(), threading.Lock()

    def run(*values: np.ndarray) -> list[np.ndarray]:
        with one_at_a_time:  # requests of many threads at once were seen to wait for each other for ever
            results = request.infer(list(values))
            return [np.array(results[output]) for output in compiled.outputs]

    return run
