"""How one input is described: its kind, unit, bounds, help, and its names at every door; all by inputs.schema.json."""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from numbers import Real
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError

Function = TypeVar("Function", bound=Callable[..., Any])

MAX_NUMBER = 1e6
"""Upper bound of numbers parsed from text."""

About = Literal["place", "camera", "light", "setting"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Hint:
    """How one input is described, named and read where it comes as text or as a file.

    Attributes:
        about: "place", the object's place; "camera"; "light", used by the estimate only; or "setting".
        help: one line for users.
        unit: of a number.
        least, most: bounds of a number.
        keyword: the field's name, Python's keyword.
        name: its option, form field and query parameter: the field's name without its unit.
        metavar: format of its text.
        numbers: allowed counts of comma-separated numbers in its text; none: it is a word or a file.
        repeated: whether it may be given several times.
        example: a valid text.
        words: keywords accepted in place of a file; of a setting, the values that a request to the server may ask for.
        suffixes: of its file, where folders hold one a photo; none: it is no file.
        in_web: option of the JavaScript package that takes it; "" where there is none.
    """

    about: About
    help: str
    unit: str
    least: float | None
    most: float | None
    keyword: str
    name: str
    metavar: str | None
    numbers: tuple[int, ...]
    repeated: bool
    example: str
    words: tuple[str, ...]
    suffixes: tuple[str, ...]
    in_web: str

    def read(self, text: Any) -> Any:
        """Parse a text: a number, numbers, or the text itself; a list of texts one by one; else return it as it is.

        Raises:
            InputError: wrong numbers.
        """
        if isinstance(text, list):
            return [self.read(one) for one in text]
        if not self.numbers or not isinstance(text, str):
            return text
        if not (found := numbers_in(text, *self.numbers)):
            example = f"; for instance {self.example}" if self.example else ""
            raise InputError(f"expected {self._form()}, got {text[:60]!r}{example}", subject=self.keyword)
        return found[0] if self.numbers == (1,) else found

    def _form(self) -> str:
        forms = ["a number"] if 1 in self.numbers else []
        forms += [self.metavar or ""] if self.numbers != (1,) else []
        return " or ".join(forms) + (" in pixels" if self.unit == "px" else "")

    def read_word(self, text: str) -> str:
        """Check for one of the words accepted in place of a file; InputError for another."""
        if text not in self.words:
            form, advice = " or ".join(("a file part", *self.words)), did_you_mean(text, self.words)
            raise InputError(f"expected {form}, got {text[:60]!r}{advice}", subject=self.keyword)
        return text

    def read_path(self, text: str | Path) -> str | Path:
        """Return one of the words, or a file's path."""
        return text if text in self.words else Path(text)

    def check(self, value: Any) -> None:
        """Refuse a value of another kind, or out of bounds."""
        is_number = isinstance(value, Real)
        if self.suffixes:
            is_file = isinstance(value, os.PathLike | str | bytes | np.ndarray)
            if is_number or not (is_file or self.keyword in ("mask", "surroundings")):
                got = f"the number {value}" if is_number else type(value).__name__
                raise InputError(f"expected a file, its bytes, a picture or an array, got {got}", subject=self.keyword)
        elif self.numbers == (1,):
            if not is_number:
                got = f"{type(value).__name__} {str(value)[:40]!r}"
                raise InputError(f"expected a number, got {got}", subject=self.keyword)
            if self.least is not None and self.most is not None and not self.least <= value <= self.most:
                text = f"expected {self.least:g} to {self.most:g} {self.unit}".rstrip()
                raise InputError(f"{text}, got {value:g}", subject=self.keyword)


def numbers_in(text: str, *counts: int) -> tuple[float, ...]:
    """Return the numbers below MAX_NUMBER between a text's commas; none unless there are as many as one of `counts`."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return found if len(found) in counts and all(abs(one) < MAX_NUMBER for one in found) else ()  # NaN fails too


def described(kind: type, **files: tuple[str, ...]) -> dict[str, Hint]:
    """Return the descriptions of a dataclass's fields by name, in their order; files: suffixes by x-files."""
    text = Path(__file__).with_name("inputs.schema.json").read_text(encoding="utf-8")
    found = {}
    for name in (one.name for one in fields(kind)):
        schema = json.loads(text)["properties"][name]
        kinds = schema.get("anyOf", [schema])
        counted = [one for one in kinds if one.get("type") == "number" or "minItems" in one]
        bounds = counted[0].get("items", counted[0]) if counted else {}
        found[name] = Hint(
            about=schema["x-about"],
            help=schema["description"],
            unit=schema.get("x-unit", ""),
            least=bounds.get("minimum"),
            most=bounds.get("maximum"),
            keyword=name,
            name=schema["x-option"].removeprefix("--").replace("-", "_"),
            metavar=schema.get("x-metavar"),
            numbers=tuple(one.get("minItems", 1) for one in counted),
            repeated=any("items" in one and "minItems" not in one for one in kinds),
            example=schema.get("x-example", ""),
            words=tuple(word for one in kinds for word in one.get("enum", ())),
            suffixes=files.get(schema.get("x-files"), ()),
            in_web=schema.get("x-web", ""),
        )
    return found


def shown_as(*kinds: type) -> Callable[[Function], Function]:
    """Return a decorator that shows the fields of these classes as a function's keywords, in help and completion."""

    def show(function: Function) -> Function:
        own = inspect.signature(function)
        kept = [one for one in own.parameters.values() if one.kind != one.VAR_KEYWORD]
        more = [
            inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=one.type)
            for kind in kinds
            for one in fields(kind)
        ]
        function.__signature__ = own.replace(parameters=[*kept, *more])  # type: ignore[attr-defined]
        return function

    return show
