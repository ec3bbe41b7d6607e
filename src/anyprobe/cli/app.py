"""The command line: one file per command, everything heavy imported inside it."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import typer

from anyprobe import __version__
from anyprobe.cli.doctor import doctor
from anyprobe.cli.estimate import estimate
from anyprobe.cli.export import export
from anyprobe.cli.mask import mask
from anyprobe.cli.match import match
from anyprobe.cli.material_list import materials
from anyprobe.cli.options import OPTIONS
from anyprobe.cli.relight import relight
from anyprobe.cli.serve import serve
from anyprobe.cli.video import video
from anyprobe.errors import AnyprobeError
from anyprobe.maps import image_io

TRACEBACK = "ANYPROBE_TRACEBACK"
"""Environment variable that lets unexpected errors through with their traceback."""

MIN_COLUMNS = 20
"""Smallest COLUMNS that is honoured [characters]; tables would be cut to nothing below it."""

COMMANDS = (estimate, mask, relight, video, match, export, materials, serve, doctor)

app = typer.Typer(
    help="HDR environment maps from one photo: any object is a light probe.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in COMMANDS:
    app.command()(command)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"anyprobe {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
) -> None:
    pass


def main(command: Callable[[], Any] = app) -> None:
    """Run a command; turn the errors that anyprobe raises into one line and exit status 2."""
    try:
        with quiet_libraries():
            command()
    except AnyprobeError as error:
        _fail(OPTIONS.line(error.notice))
    except MemoryError:
        _fail("expected a machine with more memory free, got none; process fewer or smaller files at once")
    except OSError as error:  # a folder that may not be looked into, a disk that is full
        if error.filename is None and isinstance(error, FileNotFoundError):  # os.getcwd
            _fail("the current folder no longer exists; change to another")
        _fail(
            f"{error.filename or 'the system'}: refused ({error.strerror or error}); "
            "check the path, or end other programs"
        )
    except UnicodeEncodeError as error:  # bytes that Python keeps as surrogates
        _fail(f"{ascii(error.object)[:120]}: expected a file name in UTF-8, got other bytes; rename it")
    except SystemExit as end:  # what typer makes of Ctrl-C
        if end.code == 130:
            print("anyprobe: interrupted", file=sys.stderr)
        raise
    except Exception as error:
        if os.environ.get(TRACEBACK):
            raise
        _fail(_fault(error), status=1)


def _fail(line: str, status: int = 2) -> NoReturn:
    print(f"anyprobe: {line}", file=sys.stderr)
    sys.exit(status)


def _fault(error: Exception) -> str:
    """Return one line about an unexpected error and where it came from."""
    message = " ".join(str(error).split())[:160]
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if os.sep + "anyprobe" + os.sep in frame.filename] or frames
    place = f" at {os.path.basename(own[-1].filename)}:{own[-1].lineno}" if own else ""
    return (
        f"bug in anyprobe or in a package that it uses, {type(error).__name__}{place}: {message or 'no message'}; "
        f"report it with the output of anyprobe doctor ({TRACEBACK}=1 shows the traceback)"
    )


@contextlib.contextmanager
def quiet_libraries() -> Iterator[None]:
    """Silence libraries that print about damaged files, and their warnings, while a command runs.

    SIGTERM ends the command as Ctrl-C does, so that nothing half-written stays. This changes the whole process, which
    only the command line may do.
    """
    _drop_unusable_columns()
    for stream in (sys.stdout, sys.stderr):  # a name that the terminal's encoding lacks is no reason to end
        with contextlib.suppress(AttributeError, OSError, ValueError):  # none, or a caller's own
            getattr(stream, "reconfigure")(errors="backslashreplace")  # noqa: B009  # of files alone
    os.environ.setdefault("PYTHONSAFEPATH", "1")  # a random.py in the working folder is not Python's in children either
    saved_quiet, image_io.quiet = image_io.quiet, silenced
    is_main_thread = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGTERM, _end) if is_main_thread else None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        image_io.quiet = saved_quiet
        if is_main_thread:
            signal.signal(signal.SIGTERM, handler)


def _drop_unusable_columns() -> None:
    """Drop a COLUMNS that is no terminal's width."""
    columns = os.environ.get("COLUMNS", "")
    if columns and not (columns.isascii() and columns.isdecimal() and MIN_COLUMNS <= int(columns[:9])):
        del os.environ["COLUMNS"]


def _end(number: int, _: object) -> None:
    sys.exit(128 + number)


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """Discard stdout and stderr of the whole process, C libraries included, within the block."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or none
            stream.flush()
    with contextlib.ExitStack() as stack:
        for number in (1, 2):
            with contextlib.suppress(OSError):  # closed, as a service's may be
                stack.callback(_restore, os.dup(number), number)
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, number)
                os.close(null)
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        yield


def _restore(saved: int, number: int) -> None:
    os.dup2(saved, number)
    os.close(saved)
