"""Windows and macOS as far as Linux can play them: python -X warn_default_encoding -m pytest -p support.other_system

No fork, resource, fcntl, links, niceness or affinity; processes begin by spawn; and a file that is opened without an
encoding, which would be cp1252 there, is an error.
"""

from __future__ import annotations

import multiprocessing
import os
import sys

import pytest

ABSENT = ("sched_getaffinity", "nice", "fork", "mkfifo")


def _no_links(*_: object, **__: object) -> None:
    raise OSError(1314, "A required privilege is not held by the client")


def pytest_configure(config: pytest.Config) -> None:
    """Take away what only POSIX has."""
    multiprocessing.set_start_method("spawn", force=True)
    for name in ("resource", "fcntl"):
        sys.modules[name] = None  # type: ignore[assignment]  # an import of it fails
    for name in ABSENT:
        if hasattr(os, name):
            delattr(os, name)
    os.symlink = _no_links  # type: ignore[assignment]
    config.addinivalue_line("filterwarnings", "error::EncodingWarning:anyprobe")
