"""Open (verb): an ONNX graph, to be run beside other work on the same cores."""

from __future__ import annotations

from pathlib import Path

import onnxruntime

from anyprobe.errors import ModelError


def open_graph(path: Path, threads: int | None = None) -> onnxruntime.InferenceSession:
    """A session on the CPU, safe to share between threads.

    Its threads sleep as soon as they have nothing to do. Spinning, as is the default, they take their cores from
    what comes between two graphs: a whole call took up to 2.6 times as long.

    Args:
        threads: cores for the graph; None: all there are.
    Raises:
        ModelError: it cannot be read.
    """
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    if threads is not None:
        options.intra_op_num_threads = threads
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime has no common base class for its errors
        raise ModelError(
            f"{path.name}: expected a readable ONNX graph, got a damaged file; reinstall anyprobe"
        ) from error
