"""Arrays of callers as plain ones."""

from __future__ import annotations

import numpy as np

from anyprobe.errors import InputError


def plain_array(
    values: np.ndarray, name: str, fault: type[InputError] = InputError, *, subject: str = ""
) -> np.ndarray:
    """Return an array of any class as numpy's own.

    Args:
        name: what messages call it.
        subject: the keyword that it was given by.
    Raises:
        fault: a masked array, whose mask would be lost without a word.
    """
    if isinstance(values, np.ma.MaskedArray):
        raise fault(
            "expected an array of numbers, got a masked array; fill it first (array.filled(0)), and give "
            "what is the object as a mask",
            source=name,
            subject=subject,
        )
    return np.asarray(values)
