"""Lists of recipes in files, and the frozen test set among them."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

from anyprobe.dataset.recipe import Recipe, digest
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path

FROZEN = Path(str(resources.files("anyprobe") / "evaluate" / "frozen.txt"))
"""1,000 recipes over held-out maps and shapes; they never change."""


def read_recipes(path: str | os.PathLike[str]) -> list[Recipe]:
    """One recipe a line, the first line `# <digest>`; raises InputError if the digest is another."""
    try:
        lines = Path(path).read_text(encoding="ascii").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: expected a text file of recipes, one a line, got none readable") from error
    recipes = [Recipe.from_hex(line.strip()) for line in lines[1:] if line.strip()]
    if lines[0] != f"# {digest(recipes)}":
        raise InputError(
            f"{path}: expected the first line '# {digest(recipes)}', got {lines[0][:40]!r}; "
            "the list was edited or cut short"
        )
    return recipes


def write_recipes(path: str | os.PathLike[str], recipes: list[Recipe]) -> None:
    """The file that read_recipes reads."""
    lines = [f"# {digest(recipes)}", *(recipe.to_hex() for recipe in recipes)]
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii")
