"""What is wrong with a command that a page shows, without running it."""

from __future__ import annotations

import typer

from anyprobe.cli.app import app
from anyprobe_train.cli import app as train

PROGRAMS = {"anyprobe": typer.main.get_command(app), "anyprobe-train": typer.main.get_command(train.app)}


def fault_of(words: list[str]) -> str:
    """What click says of a command that it would refuse; empty where it takes it. Nothing runs."""
    command, rest = PROGRAMS[words[0]], words[1:]
    context = command.context_class(command, info_name=words[0])
    try:
        while hasattr(command, "commands") and rest and not rest[0].startswith("-"):
            name, command, rest = command.resolve_command(context, rest)
            context = command.context_class(command, info_name=name, parent=context)
        command.make_context(context.info_name, rest, parent=context.parent)
    except typer.Exit:  # anyprobe --version
        return ""
    except Exception as error:  # click's own, which typer brings with it
        return getattr(error, "format_message", error.__str__)() or type(error).__name__
    return ""
