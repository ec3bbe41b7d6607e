"""What is wrong with a command that a page shows, without running it."""

from __future__ import annotations

import ast
from importlib.util import find_spec
from pathlib import Path

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


def fault_of_module(words: list[str]) -> str:
    """What is wrong with the words of "python -m MODULE ...": no such module, option or subcommand; empty if nothing.

    The module is read, not imported. A word in capitals, a path, or what follows an option is the reader's own.
    """
    name, rest = words[2], words[3:]
    path = file_of(name)
    if path is None:
        return f"no module {name}"
    known = words_in(path.read_text(encoding="utf-8"))
    for before, word in zip(["", *rest], rest, strict=False):
        of_reader = before.startswith("-") or any(letter.isupper() or letter in "/." for letter in word)
        if word not in known and (word.startswith("-") or not of_reader):
            return f"{name}: no {word}"
    return ""


def file_of(name: str) -> Path | None:
    """The file that "python -m NAME" runs; None where there is none."""
    for module in (f"{name}.__main__", name):
        try:
            spec = find_spec(module)
        except ModuleNotFoundError:
            continue
        if spec is not None and spec.has_location and spec.origin is not None:
            return Path(spec.origin)
    return None


def words_in(source: str) -> set[str]:
    """Options and words that a module's command may take: its strings, and the parameters of its functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)
        elif isinstance(node, ast.arg):
            found.add("--" + node.arg.replace("_", "-"))
        elif isinstance(node, ast.FunctionDef):
            found.add(node.name)
    return found
