"""Names of files for libraries that take UTF-8 alone: a folder of another age holds other bytes."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from anyprobe.errors import OutputError


@contextmanager
def utf8_path(path: str | os.PathLike[str]) -> Iterator[str]:
    """The path itself, or one that leads to it where its bytes are no UTF-8; to read from and to write to.

    The other is a symbolic link of the same suffix, in a folder of its own for as long as the block lasts.

    Raises:
        OutputError: no link can be made.
    """
    name = os.fspath(path)
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:  # bytes that Python keeps as surrogates
        with ExitStack() as stack:
            try:
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="anyprobe-"))
                link = Path(folder) / f"file{Path(name).suffix.encode('ascii', 'ignore').decode()}"
                link.symlink_to(os.path.abspath(name))
            except OSError as error:
                raise OutputError(
                    f"{name}: expected a name in UTF-8, got other bytes, and no link to it can be made "
                    f"({error.strerror or error}); rename it"
                ) from error
            yield str(link)
    else:
        yield name
