"""Sessions of ONNX graphs that share the cores with other work, how many cores there are, and child processes of one.

ONNX Runtime is imported with its telemetry off: since 1.29 it reports every process that opens a graph to Microsoft. It
reads the variable once, at import, and it is then removed again. A program that imports ONNX Runtime earlier, or sets
the variable, decides for itself.
"""

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from anyprobe.errors import InputError, ModelError

QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""File in which Linux states a container's limit: processor time per period, both in microseconds."""

CHILD_ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "PYTHONSAFEPATH"), "1"
)
"""Environment of worker processes: one thread, and no modules from the working folder, whose random.py is not
Python's."""


def usable_cores() -> int:
    """Return the number of cores, at least 1: those that the process may run on, or its container's share of them."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with suppress(OSError, ValueError, ZeroDivisionError):  # no container, or one without a limit
        quota, period = QUOTA.read_text(encoding="ascii").split()
        return max(1, min(cores, math.ceil(int(quota) / int(period))))
    return cores


TELEMETRY_OFF = "ORT_DISABLE_TELEMETRY"

_is_set = TELEMETRY_OFF in os.environ
os.environ.setdefault(TELEMETRY_OFF, "1")
try:
    import onnxruntime
finally:
    if not _is_set:
        del os.environ[TELEMETRY_OFF]

MOST_THREADS = 2
"""Largest number of threads: with more, sums of convolutions are split differently, which changes their last bits; nor
are the graphs any faster."""


CPU = ("CPUExecutionProvider",)
"""Providers of ONNX Runtime that every machine has."""


def local_providers() -> list[str]:
    """Return the providers of ONNX Runtime that compute here; Azure's asks a server."""
    return [one for one in onnxruntime.get_available_providers() if one != "AzureExecutionProvider"]


def open_graph(path: Path, threads: int | None = None, providers: Sequence[str] = CPU) -> onnxruntime.InferenceSession:
    """Open a session, safe to share between threads.

    Its threads sleep as soon as they have nothing to do. Spinning, the default, would take cores from the work between
    two graphs: a whole call took up to 2.6 times as long.

    Quantised weights are expanded once, here, not at each run.

    Args:
        threads: cores for the graph; None: usable_cores. At most MOST_THREADS are used, so that the result is
            the same to the last bit for any number.
        providers: names of ONNX Runtime's execution providers, the preferred first.
    Raises:
        InputError: a provider that this installation lacks, or that cannot work on this machine.
        ModelError: it cannot be read.
    """
    installed = local_providers()
    if absent := [one for one in providers if one not in installed]:
        raise InputError(f"expected some of {', '.join(installed)}, got {absent[0]!r}", subject="providers")
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4  # errors are raised, so not logged too
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.disable_quant_qdq", "1")
    # a single thread works even where the system gives no more
    for count in range(max(1, min(threads or usable_cores(), MOST_THREADS)), 0, -1):
        options.intra_op_num_threads = count
        try:
            # a fallback would print on stdout
            session = onnxruntime.InferenceSession(str(path), options, providers=list(providers), enable_fallback=0)
            break
        except Exception as error:  # the runtime has no common base class for its errors
            fault = error
    else:
        reason = " ".join(str(fault).split())[:120]
        text = f"cannot be opened ({reason}); reinstall anyprobe, or end other programs"  # damaged, or want of memory
        raise ModelError(text, source=path.name) from fault
    if missing := set(providers) - set(session.get_providers()):  # ONNX Runtime goes on without one, silently
        text = f"expected a machine that has {sorted(missing)[0]}, got none; leave it out"
        raise InputError(text, code="unsupported", subject="providers")
    return session


def check_metadata(session: onnxruntime.InferenceSession, expected: Mapping[str, str], name: str) -> None:
    """Raise ModelError unless a graph, called `name` in messages, carries this metadata: else it means other things."""
    found = session.get_modelmeta().custom_metadata_map
    for key, value in expected.items():
        if found.get(key) != value:
            text = f"expected {key} = {value!r}, got {found.get(key)!r}; use weights of this version"
            raise ModelError(text, source=name)


def run_options() -> onnxruntime.RunOptions:
    """Return options of a run that frees its memory afterwards; a segmenter's takes half a gigabyte."""
    options = onnxruntime.RunOptions()
    options.add_run_config_entry("memory.enable_memory_arena_shrinkage", "cpu:0")
    return options
