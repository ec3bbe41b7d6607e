"""ONNX graphs opened to run beside other work on the same cores."""

from __future__ import annotations

from pathlib import Path

from anyprobe.errors import ModelError
from anyprobe.files.cores import usable_cores
from anyprobe.files.onnx_runtime import onnxruntime

SHORT = ("bad_alloc", "memory", "alloc", "thread", "resource", "too many open files")
"""Words of errors that come from the system and not from a graph."""

MOST_THREADS = 2
"""On more, sums of convolutions are split elsewhere, and their last bits differ; nor are the graphs any faster."""


def open_graph(path: Path, threads: int | None = None) -> onnxruntime.InferenceSession:
    """Open a session on the CPU, safe to share between threads.

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
    options.log_severity_level = 4  # errors are raised, and said once
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.disable_quant_qdq", "1")
    for count in sorted(
        {even_threads(threads or usable_cores()), 1}, reverse=True
    ):  # one needs no thread of the system
        options.intra_op_num_threads = count
        try:
            return onnxruntime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"], enable_fallback=0
            )  # falling back, it prints on stdout
        except Exception as error:  # the runtime has no common base class for its errors
            fault = error
    if any(word in str(fault).lower() for word in SHORT) or isinstance(fault, MemoryError):
        raise ModelError(
            "cannot be opened, as the system gives no more memory or threads "
            f"({' '.join(str(fault).split())[:120]}); end other programs, or raise the limits",
            source=path.name,
        ) from fault
    text = "expected a readable ONNX graph, got a damaged file; reinstall anyprobe"
    raise ModelError(text, source=path.name) from fault


def even_threads(threads: int) -> int:
    """Return the largest power of two that is not above it, nor above MOST_THREADS."""
    return 1 << (max(1, min(threads, MOST_THREADS)).bit_length() - 1)


def run_options() -> onnxruntime.RunOptions:
    """Return options of a run that gives its memory back; a segmenter's is half a gigabyte."""
    options = onnxruntime.RunOptions()
    options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
    return options
