"""Windows and macOS as far as Linux can play them, a plugin of pytest; python -m tests.other_system runs with it.

No fork, resource, fcntl, links, niceness or affinity; processes begin by spawn; what they print and what is read of it
is cp1252; and a file that anyprobe opens without an encoding, which would be cp1252 there, is an error.
"""

from __future__ import annotations

import errno
import multiprocessing
import os
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src" / "anyprobe"
NO_LINKS = 1314
ABSENT = ("sched_getaffinity", "nice", "fork", "mkfifo")
ENCODING = "cp1252"


def _no_links(*_: object, **__: object) -> None:
    raise OSError(NO_LINKS, "A required privilege is not held by the client")


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


def _is_posix_only(error: Exception) -> bool:
    """Return whether a test itself, not anyprobe, asked for what such a system lacks: a link, a name, a module."""
    steps = [Path(step.filename) for step in traceback.extract_tb(error.__traceback__)]
    asked = not any(SOURCE in step.parents for step in steps)
    lacks = isinstance(error, ImportError) or getattr(error, "errno", None) in (NO_LINKS, errno.EINVAL, errno.EILSEQ)
    return asked and lacks


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Iterator[None]:
    """Skip tests whose fixtures are POSIX's alone."""
    try:
        return (yield)
    except (OSError, ImportError) as error:
        if _is_posix_only(error):
            pytest.skip(f"POSIX only: {error}")
        raise


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call() -> Iterator[Any]:
    """Skip tests that are POSIX's alone."""
    try:
        return (yield)
    except (OSError, ImportError) as error:
        if _is_posix_only(error):
            pytest.skip(f"POSIX only: {error}")
        raise
