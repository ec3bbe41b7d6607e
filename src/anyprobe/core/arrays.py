"""Conversion of callers' arrays to plain ones."""

from __future__ import annotations

import numpy as np

from anyprobe.errors import InputError


def plain_array(
    values: np.ndarray, name: str, fault: type[InputError] = InputError, *, subject: str = ""
) -> np.ndarray:
    """Convert an array of any class to numpy's own.

    Args:
        name: what messages call it.
        subject: the keyword that it was passed as.
    Raises:
        fault: a masked array; its mask would be lost silently.
    """
    if isinstance(values, np.ma.MaskedArray):
        raise fault(
            "expected an array of numbers, got a masked array; fill it first (array.filled(0)), and give "
            "what is the object as a mask",
            source=name,
            subject=subject,
        )
    return np.asarray(values)
