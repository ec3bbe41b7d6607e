"""Griffe extension: a docstring's sections need no blank line above their titles."""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

TITLE = re.compile(r"(?<=[^\n])\n(?=(?:Args|Attributes|Raises|Returns|Yields):\n)")


class Sections(Extension):
    """Insert the blank lines that Griffe expects."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change an object's docstring in place."""
        if obj.docstring is not None:
            obj.docstring.value = TITLE.sub("\n\n", obj.docstring.value)
