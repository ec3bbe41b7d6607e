"""What refuses an input: its code and the arguments that it is about, whatever the sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from anyprobe.errors import AnyprobeError


@contextmanager
def refused(*subject: str, code: str = "invalid-option") -> Iterator[Any]:
    """Expect an error of this code about these arguments; gives pytest's ExceptionInfo."""
    with pytest.raises(AnyprobeError) as error:
        yield error
    assert (error.value.code, error.value.subject) == (code, subject)
