"""What is wrong with a command that a page shows, without running it."""

from __future__ import annotations

from cyclopts import CycloptsError

from anyprobe.cli.app import app
from anyprobe.errors import AnyprobeError
from anyprobe_train.cli import app as train

PROGRAMS = {"anyprobe": app, "anyprobe-train": train.app}


def fault_of(words: list[str]) -> str:
    """What the command line says of a command that it would refuse; empty where it takes it. Nothing runs."""
    try:
        PROGRAMS[words[0]].parse_args(words[1:])
    except (CycloptsError, AnyprobeError) as error:
        return str(error)
    return ""
