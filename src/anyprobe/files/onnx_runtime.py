"""ONNX Runtime, imported with its telemetry off: since 1.29 it reports every process that opens a graph to Microsoft.

The variable is read once, at import, and then removed again. A program that imports ONNX Runtime earlier, or sets the
variable, decides for itself.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

TELEMETRY_OFF = "ORT_DISABLE_TELEMETRY"


@contextmanager
def _without_telemetry() -> Iterator[None]:
    if TELEMETRY_OFF in os.environ:
        yield
        return
    os.environ[TELEMETRY_OFF] = "1"
    try:
        yield
    finally:
        del os.environ[TELEMETRY_OFF]


with _without_telemetry():
    import onnxruntime

__all__ = ["onnxruntime"]
