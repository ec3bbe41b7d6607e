"""The command line: thin, one file a command, everything heavy imported inside it."""

from __future__ import annotations

import sys

import typer

from anyprobe import __version__
from anyprobe.cli.compare import compare
from anyprobe.cli.data import data
from anyprobe.cli.doctor import doctor
from anyprobe.cli.estimate import estimate
from anyprobe.cli.evaluate import evaluate
from anyprobe.cli.evaluate_masks import evaluate_masks
from anyprobe.cli.export import export
from anyprobe.cli.limits import limits
from anyprobe.cli.mask import mask
from anyprobe.cli.relight import relight
from anyprobe.cli.report import report, timing
from anyprobe.cli.scaling import scaling
from anyprobe.cli.serve import serve
from anyprobe.cli.train import train, weights
from anyprobe.cli.trials import trials
from anyprobe.cli.video import video
from anyprobe.errors import AnyprobeError

app = typer.Typer(
    help="Any object is a light probe: HDR surrounding light from one photo.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    estimate,
    mask,
    relight,
    video,
    export,
    serve,
    evaluate,
    evaluate_masks,
    compare,
    limits,
    timing,
    report,
    doctor,
    train,
    weights,
    trials,
    scaling,
):
    app.command()(command)
app.add_typer(data, name="data")


def _version(value: bool) -> None:
    if value:
        typer.echo(f"anyprobe {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    pass


def main() -> None:
    """Run a command; what anyprobe raises on purpose becomes one line and exit status 2."""
    try:
        app()
    except AnyprobeError as error:
        print(f"anyprobe: {' '.join(str(error).splitlines())}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:  # a folder that may not be looked into, a disk that is full
        where = error.filename or "a file"
        print(
            f"anyprobe: {where}: cannot be used ({error.strerror or error}); check the path", file=sys.stderr
        )
        sys.exit(2)
    except SystemExit as end:  # what typer makes of Ctrl-C
        if end.code == 130:
            print("anyprobe: interrupted", file=sys.stderr)
        raise
