"""Windows and macOS as far as Linux can play them, a plugin of pytest; python -m tests.other_system runs with it.

No fork, resource, fcntl, links, niceness or affinity; processes begin by spawn; what they print and what is read of it
is cp1252; and a file that anyprobe opens without an encoding, which would be cp1252 there, is an error.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from typing import Any

import pytest

ABSENT = ("sched_getaffinity", "nice", "fork", "mkfifo")
ENCODING = "cp1252"


def _no_links(*_: object, **__: object) -> None:
    raise OSError(1314, "A required privilege is not held by the client")


class _Popen(subprocess.Popen):
    """Reads text in the encoding of the system, as there."""

    def __init__(self, *given: Any, **named: Any) -> None:
        if (named.get("text") or named.get("universal_newlines")) and not named.get("encoding"):
            named["encoding"] = ENCODING
        super().__init__(*given, **named)


def pytest_configure(config: pytest.Config) -> None:
    """Take away what only POSIX has."""
    multiprocessing.set_start_method("spawn", force=True)
    for name in ("resource", "fcntl"):
        sys.modules[name] = None  # type: ignore[assignment]  # an import of it fails
    for name in ABSENT:
        if hasattr(os, name):
            delattr(os, name)
    os.symlink = _no_links  # type: ignore[assignment]
    subprocess.Popen = _Popen  # type: ignore[misc]
    os.environ["PYTHONIOENCODING"] = ENCODING
    config.addinivalue_line("filterwarnings", "ignore::EncodingWarning")  # the tests' own
    config.addinivalue_line("filterwarnings", "error::EncodingWarning:anyprobe")
