"""Nothing but our own lines on stdout and stderr: C libraries print beside them, and Python warns."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator

from anyprobe.files import exr


@contextlib.contextmanager
def own_lines() -> Iterator[None]:
    """For as long as a command runs: libraries that print of damaged files, and their warnings, are silenced.

    SIGTERM ends it as Ctrl-C does, so that nothing half-written stays. All of this changes what the whole process has;
    only the command line owns one.
    """
    before, exr.quiet = exr.quiet, silenced
    ours = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGTERM, _end) if ours else None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        exr.quiet = before
        if ours:
            signal.signal(signal.SIGTERM, handler)


def _end(number: int, _: object) -> None:
    sys.exit(128 + number)


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """stdout and stderr of the whole process, C libraries included, lead nowhere."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or none
            stream.flush()
    with contextlib.ExitStack() as stack:
        for number in (1, 2):
            with contextlib.suppress(OSError):  # closed, as a service's may be
                stack.callback(_put_back, os.dup(number), number)
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, number)
                os.close(nowhere)
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        yield


def _put_back(kept: int, number: int) -> None:
    os.dup2(kept, number)
    os.close(kept)
