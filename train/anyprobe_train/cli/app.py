"""The command line of training: one file per command, everything heavy imported inside it."""

from collections.abc import Callable

from anyprobe.cli.app import main as cli_main
from anyprobe.cli.app import new_app
from anyprobe_train.cli import data
from anyprobe_train.cli.evaluate import evaluate
from anyprobe_train.cli.paper import paper
from anyprobe_train.cli.run import export, run

app = new_app("Train, export and evaluate the networks of anyprobe.", name="anyprobe-train")
COMMANDS: tuple[Callable[..., None], ...] = (run, export, evaluate, paper)
for place, command in enumerate(COMMANDS):
    app.command(command, sort_key=place)
app.command(data.app)


def main() -> None:
    """Run a command; errors are one line, as those of anyprobe."""
    cli_main(app)


if __name__ == "__main__":
    main()
