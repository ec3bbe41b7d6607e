"""What refuses an input: its code, the arguments and the file that it is about, whatever the sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from anyprobe.errors import (
    AnyprobeError,
    InputError,
    InvalidEnvironment,
    InvalidMesh,
    InvalidPhoto,
    MissingExtra,
    ModelError,
    OutputError,
)

KINDS = (InputError, InvalidEnvironment, InvalidMesh, InvalidPhoto, MissingExtra, ModelError, OutputError)
KIND_OF = {kind.default_code: kind for kind in KINDS}


@contextmanager
def refused(
    *subject: str,
    code: str = "invalid-option",
    source: str | None = None,
    naming: str = "",
    kind: type[AnyprobeError] | None = None,
) -> Iterator[Any]:
    """Expect an error of this code about these arguments; gives pytest's ExceptionInfo.

    Args:
        source: the file or photo that it is about, without folders; None: not looked at.
        naming: a value that its text gives, such as a size that was found.
        kind: class of the error; None: the one whose code this is.
    """
    with pytest.raises(kind or KIND_OF.get(code, AnyprobeError)) as error:
        yield error
    notice = error.value.notice
    assert (notice.code, notice.subject) == (code, subject)
    assert source in (None, Path(notice.source).name)
    assert naming in notice.text


def assert_one_line(caught, *words: str) -> None:
    """The error that pytest caught is one line, with these words."""
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
