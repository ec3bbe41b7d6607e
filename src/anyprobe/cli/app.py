"""The command line: one file per command, each imported when it is asked for; and tables whose cells are never cut."""

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

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console
from rich.table import Table

from anyprobe import __version__
from anyprobe.cli.options import OPTIONS
from anyprobe.errors import AnyprobeError
from anyprobe.maps import image_io

TRACEBACK = "ANYPROBE_TRACEBACK"
"""Environment variable that lets unexpected errors through with their traceback."""


def new_app(help: str | None, **more: Any) -> App:
    """Return an application that `main` runs: no option has its --no-x, the last of two equal options counts, and
    [1].png is a file, no JSON."""
    settings = Parameter(
        negative=(),
        allow_repeating=True,
        json_list=False,
        show_default=lambda value: None if value in (None, False, ()) else str(value),
    )
    return App(
        help=help,
        help_format="plaintext",
        default_parameter=settings,
        print_error=False,
        exit_on_error=False,
        suppress_keyboard_interrupt=False,
        **more,
    )


DESCRIPTION = "HDR environment maps from one photo: any object is a light probe."
app = new_app(DESCRIPTION, name="anyprobe", version=f"anyprobe {__version__}")
COMMANDS = (
    *("estimate:estimate", "mask:mask", "relight:relight", "video:video", "match:match", "export:export"),
    *("material_list:materials", "serve:serve", "doctor:doctor"),
)
for place, command in enumerate(COMMANDS):  # imported once they are run or described
    app.command(f"anyprobe.cli.{command}", sort_key=place)
app.register_install_completion_command()


@app.command(name="--show-completion")
def show_completion() -> None:
    """Print this shell's completion, to copy or to change."""
    print(app.generate_completion())


def main(command: App | Callable[..., None] = app) -> None:
    """Run an application of new_app or one function; turn errors into one line and an exit status: 2, of a bug 1, of
    Ctrl-C 130."""
    if not isinstance(command, App):
        function, command = command, new_app(command.__doc__)
        command.default(function)
    words = ["./-" if word == "-" else word for word in sys.argv[1:]]  # a - alone is a file, no option
    if "" in words:  # Path would take it for the current folder
        _fail("expected a path or a value, got an empty one; leave it out, or set the variable that it comes from")
    try:
        with quiet_libraries():
            if words[:1] in ([], ["-h"], ["--help"]):  # it lists them all
                command.resolved_commands()
            command(words)
    except CycloptsError as error:
        if isinstance(error.__cause__, AnyprobeError):
            _fail(OPTIONS.line(error.__cause__.notice))
        _fail(f"{error} See {' '.join((command.name[0], *(error.command_chain or ()), '--help'))}.")
    except AnyprobeError as error:
        _fail(OPTIONS.line(error.notice))
    except MemoryError:
        _fail("expected a machine with more memory free, got none; process fewer or smaller files at once")
    except BrokenPipeError:  # the reader of the output, such as head, has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:  # a folder that may not be looked into, a disk that is full
        if error.filename is None and isinstance(error, FileNotFoundError):  # os.getcwd
            _fail("the current folder no longer exists; change to another")
        where, why = error.filename or "the system", error.strerror or error
        _fail(f"{where}: refused ({why}); check the path, or end other programs")
    except KeyboardInterrupt:
        _fail("interrupted", status=130)
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
    for stream in (sys.stdout, sys.stderr):  # a name that the terminal's encoding lacks is no reason to end
        with contextlib.suppress(AttributeError, OSError, ValueError):  # none, or a caller's own
            getattr(stream, "reconfigure")(errors="backslashreplace")  # noqa: B009  # of files alone
    os.environ.setdefault("PYTHONSAFEPATH", "1")  # a random.py in the working folder is not Python's in children either
    saved_quiet, image_io.quiet = image_io.quiet, silenced
    is_main_thread = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number)) if is_main_thread else None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        image_io.quiet = saved_quiet
        if is_main_thread:
            signal.signal(signal.SIGTERM, handler)


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """Discard stdout and stderr of the whole process, C libraries included, within the block."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or none
            stream.flush()
    with contextlib.ExitStack() as stack:
        for number in (1, 2):
            with contextlib.suppress(OSError):  # closed, as a service's may be
                saved = os.dup(number)
                stack.callback(os.close, saved)
                stack.callback(os.dup2, saved, number)
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, number)
                os.close(null)
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        yield


WIDEST = 10_000
"""Longest line of a table [characters]."""


def print_table(console: Console, table: Table) -> None:
    """Print a table as wide as its cells; only the terminal itself breaks a line that is too long."""
    table.width = console.measure(table, options=console.options.update(max_width=WIDEST)).maximum
    console.print(table, soft_wrap=True)
