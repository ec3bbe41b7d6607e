"""What only some commands need, asked for before anything else is done."""

from __future__ import annotations

from anyprobe.errors import MissingExtra


def need_torch(what: str) -> None:
    """MissingExtra where PyTorch is not there; what: what it is needed for."""
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise MissingExtra("torch", "train", what) from error
