"""Join (verb): the scores of some methods into files that hold more, where these cannot all be made again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from anyprobe.errors import InputError
from anyprobe.evaluate.report import read_result

JOINED = "joined"
"""Where a file says which command and commit gave the rows that came later."""


def join_file(path: Path, new: Mapping[str, Any]) -> dict[str, Any]:
    """What a result file becomes with the rows of a new one in the place of its own, or after them.

    Nothing else changes: the rows of other methods, and what was told of them pair by pair, stay as they are.

    Args:
        path: of evaluate.tables.result_files, as written before.
        new: the same file's content, of other methods on the same pairs.
    Raises:
        InputError: no such file, or one of other pairs.
    """
    old = read_result(path)
    for what in ("recipes", "pairs"):
        if old.get(what, new.get(what)) != new.get(what):
            raise InputError(
                f"{path}: expected {what} {new.get(what)}, got {old[what]}; rows of other pairs cannot be joined"
            )
    models = {name: value for name, value in new.items() if isinstance(value, Mapping) and "model" in value}
    said = {
        name: {**value, "command": new["command"], "commit": new["commit"]} for name, value in models.items()
    }
    result = {**old, **models, JOINED: {**old.get(JOINED, {}), **said}}
    if "rows" in old:
        result["rows"] = _rows(old["rows"], new["rows"])
    if "groups" in old:
        result["groups"] = {
            name: {**group, "rows": _rows(group["rows"], new["groups"][name]["rows"])}
            for name, group in old["groups"].items()
        }
    return result


def _rows(old: Sequence[dict[str, Any]], new: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    later = {row["design"]: row for row in new}
    kept = [later.pop(row["design"], row) for row in old]
    return kept + list(later.values())
