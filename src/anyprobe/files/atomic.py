"""Atomic writing of one file or a set: write beside the target, then rename.

A reader never sees a half-written result, and a failed or interrupted run leaves the old file unchanged.
"""

import errno
import os
import secrets
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from anyprobe.errors import OutputError

SCRATCH = ".anyprobe-"
"""Prefix of the folders that hold files until all are written."""

RETRIES_RENAME, RETRY_DELAYS_S = os.name == "nt", (0.02, 0.1, 0.5)
"""Whether a refused rename is tried again, and after which delays [s]."""

FULL_DISK = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)
"""Errors of a disk, or of a user's share of it, that is full."""


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path to write to; it is renamed to `path` when the block ends without an error.

    The temporary file is a hidden sibling with the same suffix, because encoders choose the format by it, and is made
    by the writer, so that it gets the usual permissions. Missing folders are made. A symbolic link is followed.

    Raises:
        OutputError: the folder cannot be made, or the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem[:60]}-{secrets.token_hex(4)}{target.suffix}")
    try:
        _refuse_folder(target, path)
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        _replace(temporary, target)
    except OutputError:
        raise
    except OSError as error:
        raise unwritable(path, Path(path).parent, error) from error
    finally:
        with suppress(OSError):  # already renamed, or never made
            temporary.unlink()


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check in advance that atomic_path can write there; nothing is left behind.

    Raises:
        OutputError: see atomic_path.
    """
    target = Path(os.path.realpath(path))
    _refuse_folder(target, path)
    check_folder(target.parent, path, "choose another folder")


def check_folder(
    folder: str | os.PathLike[str], path: str | os.PathLike[str] | None = None, advice: str = "choose another with -o"
) -> None:
    """Check in advance that atomic_files can write there; nothing is left behind.

    path, advice: for the error; None: the folder.

    Raises:
        OutputError: see atomic_files.
    """
    real = Path(os.path.realpath(folder))
    try:
        with tempfile.TemporaryFile(dir=next(one for one in (real, *real.parents) if one.exists())):
            pass
    except OSError as error:
        raise unwritable(path or folder, Path(folder), error, advice) from error


@contextmanager
def atomic_files(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield an empty folder to write files to; when the block ends without an error they all move into `folder`.

    Older files of the same names are replaced; if any move fails, they are restored and none of the new ones stays.
    Missing folders are made.

    Raises:
        OutputError: the folder cannot be made or written; its message never names the scratch folder.
    """
    folder, scratch = Path(folder), ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=SCRATCH) as scratch:
            new, old = Path(scratch) / "new", Path(scratch) / "old"
            new.mkdir()
            old.mkdir()
            yield new
            _replace_all(sorted(new.iterdir()), folder, old)
    except OutputError as error:
        if not scratch:
            raise
        raise OutputError(str(error).replace(str(Path(scratch) / "new"), str(folder))) from error
    except OSError as error:
        raise unwritable(folder, folder, error, "choose another with -o") from error


def _refuse_folder(target: Path, path: str | os.PathLike[str]) -> None:
    if target.is_dir():
        raise OutputError("is a folder; add the name of a file to write", source=path)


def unwritable(
    path: str | os.PathLike[str], folder: Path, error: OSError, advice: str = "choose another folder"
) -> OutputError:
    """Build the error for a refusal of the system: a file in the place of a folder, or the system's own message."""
    if isinstance(error, FileExistsError | NotADirectoryError):
        file = next((one for one in (folder, *folder.parents) if one.is_file()), folder)
        subject = "" if path == file else f"{file} "
        return OutputError(f"{subject}is a file, not a folder; {advice}", source=path)
    reason = error.strerror or str(error) or type(error).__name__
    advice += " or free some space" if error.errno in FULL_DISK else ""
    advice = "rename the photo" if error.errno == errno.ENAMETOOLONG else advice
    return OutputError(f"cannot be written ({reason}); {advice}", source=path)


def _replace(source: Path, target: Path) -> None:
    """Rename a file over another; on Windows a reader of that one, such as a virus scanner, blocks it for a moment."""
    for delay_s in RETRY_DELAYS_S if RETRIES_RENAME else ():
        try:
            return os.replace(source, target)
        except PermissionError:
            time.sleep(delay_s)
    os.replace(source, target)


def _replace_all(files: list[Path], folder: Path, old: Path) -> None:
    """Move files into `folder` and the files that they replace into `old`; undo everything if one move fails."""
    placed: list[Path] = []
    try:
        for file in files:
            target = folder / file.name
            if target.is_dir():
                raise OutputError("is a folder, not a file to replace; choose another with -o", source=target)
            if target.exists():
                _replace(target, old / file.name)
            placed.append(target)
            _replace(file, target)
    except BaseException:
        for target in placed:
            target.unlink(missing_ok=True)
            with suppress(FileNotFoundError):  # there was no older file
                os.replace(old / target.name, target)
        raise
