"""ONNX graphs opened to run beside other work on the same cores."""

from __future__ import annotations

import os
from pathlib import Path

from anyprobe.errors import ModelError
from anyprobe.files.onnx_runtime import onnxruntime

MOST_THREADS = 2
"""On more, sums of convolutions are split elsewhere, and their last bits differ; nor are the graphs any faster."""


def open_graph(path: Path, threads: int | None = None) -> onnxruntime.InferenceSession:
    """A session on the CPU, safe to share between threads.

    Its threads sleep as soon as they have nothing to do. Spinning, as is the default, they take their cores from
    what comes between two graphs: a whole call took up to 2.6 times as long.

    Weights that are stored small are widened once, now, not at each run.

    Args:
        threads: cores for the graph; None: all there are. A power of two up to MOST_THREADS is used, so that the
            result is the same to the last bit whatever the number.
    Raises:
        ModelError: it cannot be read.
    """
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.disable_quant_qdq", "1")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    options.intra_op_num_threads = even_threads(threads or cores)
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no common base class for its errors
        raise ModelError(
            "expected a readable ONNX graph, got a damaged file; reinstall anyprobe", source=path.name
        ) from error


def even_threads(threads: int) -> int:
    """The largest power of two that is not above it, nor above MOST_THREADS."""
    return 1 << (max(1, min(threads, MOST_THREADS)).bit_length() - 1)
