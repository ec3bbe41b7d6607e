"""Whole files or none, one or a set: write beside the target, then rename.

A reader never meets a half-written result, and a failed or interrupted run leaves the old file as it was.
"""

from __future__ import annotations

import os
import platform
import secrets
import shutil
import tempfile
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from anyprobe.errors import OutputError

SCRATCH = ".anyprobe-"
"""Prefix of the folders that hold files until all are written; machine name and process number follow."""

WAITS, WAITS_S = os.name == "nt", (0.02, 0.1, 0.5)
"""Whether a rename may be refused for a moment, and how long it is waited for."""

STALE_S = 86_400.0
"""Age of such a folder that is abandoned, whichever machine's process made it."""


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path to write to; it becomes `path` when the block ends well.

    The temporary file is a hidden sibling with the same suffix, because encoders choose the format by it, and is made
    by the writer, so that it gets the usual permissions. Missing folders are made. A symbolic link is written through.

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
    """Refuse at once what atomic_path would refuse after the work; nothing is left of it.

    Raises:
        OutputError: as of atomic_path.
    """
    target = Path(os.path.realpath(path))
    _refuse_folder(target, path)
    try:
        with tempfile.TemporaryFile(dir=next(one for one in target.parents if one.exists())):
            pass
    except OSError as error:
        raise unwritable(path, Path(path).parent, error) from error


@contextmanager
def atomic_files(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield an empty folder to write files to; when the block ends well all of them move into `folder`.

    Older files of the same names are replaced; if any move fails they come back, and none of the new ones stays. What a
    run that was killed has left behind is put back and removed. Missing folders are made.

    Raises:
        OutputError: the folder cannot be made or written; its message never names the scratch folder.
    """
    folder, scratch = Path(folder), ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _tidy(folder)
        with tempfile.TemporaryDirectory(dir=folder, prefix=f"{SCRATCH}{_machine()}-{os.getpid()}-") as scratch:
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
    """One line on what the system refused: the file that stands in the place of a folder, or its own words."""
    if isinstance(error, FileExistsError | NotADirectoryError):
        file = next((one for one in (folder, *folder.parents) if one.is_file()), folder)
        return OutputError(f"{path}: {'' if path == file else f'{file} '}is a file, not a folder; {advice}")
    reason = error.strerror or str(error) or type(error).__name__
    return OutputError(f"{path}: cannot be written ({reason}); {advice} or free some space")


def _replace(source: Path, target: Path) -> None:
    """Rename a file over another. On Windows whoever reads that one, a virus scanner say, refuses it for a moment."""
    for wait_s in WAITS_S if WAITS else ():
        try:
            return os.replace(source, target)
        except PermissionError:
            time.sleep(wait_s)
    os.replace(source, target)


def _replace_all(files: list[Path], folder: Path, old: Path) -> None:
    """Move files into folder, what they replace into `old`; undo everything if one fails."""
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
            with suppress(FileNotFoundError):  # there was no older one
                os.replace(old / target.name, target)
        raise


def _tidy(folder: Path) -> None:
    """Remove what killed runs have left; files that they had put aside and not replaced yet come back."""
    for left in folder.glob(f"{SCRATCH}*"):
        with suppress(OSError):
            if not left.is_dir() or left.is_symlink() or not _is_left(left):
                continue
            for file in (left / "old").glob("*"):
                if not (folder / file.name).exists():
                    os.replace(file, folder / file.name)
            shutil.rmtree(left, ignore_errors=True)


def _is_left(scratch: Path) -> bool:
    """Return whether the process that made it is gone; on a shared drive it may be another machine's, which only age
    shows."""
    number = scratch.name.removeprefix(f"{SCRATCH}{_machine()}-").partition("-")[0]
    if os.name == "posix" and number.isdecimal():
        try:
            os.kill(int(number), 0)
        except ProcessLookupError:
            return True
        except (PermissionError, OverflowError):
            pass
    return time.time() - scratch.stat().st_mtime > STALE_S


def _machine() -> str:
    """Return this machine's name, short."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


@contextmanager
def held(path: Path, *, wait: bool) -> Iterator[bool]:
    """Hold a file or folder against other processes until the block, or this process, ends.

    True where nobody else holds it: always with wait, which waits for them. Also where nothing can be held: on Windows,
    where the user sees to it, and on shared file systems without locks.
    """
    try:
        import fcntl
    except ImportError:
        yield True
        return
    # some shared file systems lock for one alone only what may be written
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        alone = True
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            alone = False
        except OSError:
            pass
        yield alone
    finally:
        os.close(descriptor)
