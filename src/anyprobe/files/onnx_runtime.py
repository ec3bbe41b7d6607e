"""ONNX Runtime, imported with its telemetry off: since 1.29 it reports every process that opens a graph to Microsoft.

The variable is read once, at import, and then removed again. A program that imports ONNX Runtime earlier, or sets the
variable, decides for itself.
"""

from __future__ import annotations

import os

TELEMETRY_OFF = "ORT_DISABLE_TELEMETRY"

_is_set = TELEMETRY_OFF in os.environ
os.environ.setdefault(TELEMETRY_OFF, "1")
try:
    import onnxruntime
finally:
    if not _is_set:
        del os.environ[TELEMETRY_OFF]

__all__ = ["onnxruntime"]
