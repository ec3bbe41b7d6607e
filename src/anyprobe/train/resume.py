"""Resume (verb): go on with a run, which must be the one that its checkpoint is of: its settings, pairs, first weights.

What the configuration does not say of these is the run's origin, by name:

    start   identity of the file of weights that it began from, None where it began from nothing
    team    how many processes train together, each on pairs of its own
    assets  the maps and shapes of its data, as supply.name_assets has them

Older checkpoints lack some: these are taken to agree.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

from anyprobe.errors import InputError, ModelError

FREE = ("name", "steps")
"""Settings that may change: the folder's name, and how long the run is."""
EXPLAINED = {
    "pairs.lanes": "pairs.lanes (processes times --workers, 2 without workers) of",
    "team": "as many processes as",
    "assets": "--data with",
    "start": "--start with",
}


def check_goes_on(path: Path, stored: Mapping[str, Any], config: Any) -> None:
    """Refuse to go on from a checkpoint that has weights alone, with other settings, or to fewer steps than are done.

    Args:
        path: where it is.
        stored: of train.checkpoint.read_checkpoint.
        config: a run's configuration, a dataclass with `steps`.
    Raises:
        InputError: naming the first setting that differs.
        ModelError: it was kept without what the next step needs.
    """
    if "optimizer" not in stored:
        raise ModelError(
            f"{path}: expected a run's checkpoint, got weights that were kept to be scored; train in another "
            "folder with --start"
        )
    for name, then, now in differing(config, json.loads(stored["config"])):
        if name not in FREE:
            raise _another_run(path, name, then, now)
    if config.steps < stored["step"]:
        raise InputError(
            f"{path}: expected steps of at least the {stored['step']} that are done, got {config.steps}; "
            "give more --steps, or train in another --runs folder"
        )


def agreed(path: Path, began: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any]:
    """The origin of the run at path: what is known of how it began, and of now; InputError where these differ."""
    for name, value in now.items():
        if began.get(name, value) != value:
            raise _another_run(path, name, began[name], value)
    return {**now, **began}


def differing(config: Any, stored: Mapping[str, Any], part: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Name, as part.name, then its stored value and the one now, of each setting in which a dataclass differs from
    its stored form; one that is not stored had its default."""
    for setting in fields(config):
        now = getattr(config, setting.name)
        then = stored[setting.name] if setting.name in stored else _default(setting, now)
        if is_dataclass(now):
            yield from differing(now, then, f"{part}{setting.name}.")
        elif then != now:
            yield part + setting.name, then, now


def _default(setting: Field, now: Any) -> Any:
    """A setting's default in its stored form; the value now where it has none."""
    value = now
    if setting.default is not MISSING:
        value = setting.default
    elif setting.default_factory is not MISSING:
        value = setting.default_factory()
    return asdict(value) if is_dataclass(value) else value


def _another_run(path: Path, name: str, then: Any, now: Any) -> InputError:
    return InputError(
        f"{path}: expected {EXPLAINED.get(name, name)} {'nothing' if then is None else then}, as the run began, "
        f"got {now}; go on as it began, or train in another --runs folder"
    )
