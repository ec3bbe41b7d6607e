"""Whole files or none: write beside the target, then rename.

A reader never meets a half-written result, and a failed or interrupted run
leaves the old file as it was.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from anyprobe.errors import OutputError


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path to write to; it becomes `path` when the block ends well.

    The temporary file is a hidden sibling with the same suffix, because encoders
    choose the format by it, and is made by the writer, so that it gets the usual
    permissions. Missing folders are made. A symbolic link is written through.

    Raises:
        OutputError: the folder cannot be made, or the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem[:60]}-{secrets.token_hex(4)}{target.suffix}")
    try:
        if target.is_dir():
            raise OutputError(f"{path}: expected the name of a file to write, got a folder; add a file name")
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, target)
    except OutputError:
        raise
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        raise OutputError(
            f"{path}: cannot be written ({reason}); choose another folder or free some space"
        ) from error
    finally:
        with suppress(OSError):  # already renamed, or never made
            temporary.unlink()
