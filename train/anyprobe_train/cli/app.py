"""The command line of training: one file per command, everything heavy imported inside it."""

from __future__ import annotations

import typer

from anyprobe.cli.app import main as cli_main
from anyprobe_train.cli import data
from anyprobe_train.cli.evaluate import evaluate
from anyprobe_train.cli.paper import paper
from anyprobe_train.cli.run import export, run

app = typer.Typer(
    help="Train, export and evaluate the networks of anyprobe.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (run, export, evaluate, paper):
    app.command()(command)
app.add_typer(data.app, name="data", help="Download maps and shapes.")


def main() -> None:
    """Run a command; errors are one line, as those of anyprobe."""
    cli_main(app)


if __name__ == "__main__":
    main()
