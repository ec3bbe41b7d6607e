"""Notices: errors and doubts as data that every door puts into its own words.

An error carries one (`error.notice`), and every warning is one. Arguments have the names of Python's keywords; the
command line, HTTP, the page, Blender and ComfyUI each have a Words that renames them as their users know them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

CONTROLS = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")
"""Ends of lines, and codes by which the name of a file would move a terminal's cursor."""

FETCH_MASKS, CHOOSE_PHOTO, USE_VIDEO, RESTART = "fetch-masks", "choose-photo", "use-video", "restart"
_ACTIONS = {
    FETCH_MASKS: "run anyprobe mask --fetch, once and online",
    CHOOSE_PHOTO: "check the path, or convert it: to OpenEXR if it holds radiance",
    USE_VIDEO: "anyprobe video takes it",
    RESTART: "or start over with anyprobe video --restart",
}
"""Remedies that are actions rather than arguments."""


@dataclass(frozen=True, slots=True)
class Remedy:
    """A possible remedy.

    Attributes:
        do: "give" the argument, "leave out" it, or "run" an action.
        name: the argument's keyword in Python ("pitch_deg"), or the action ("fetch-masks").
        value: the text to give; "": the caller's choice.
    """

    do: Literal["give", "leave out", "run"]
    name: str
    value: str = ""


def give(*names: str, **values: str) -> tuple[Remedy, ...]:
    """Return a remedy for each argument, any of which helps; for `values`, with the text to give."""
    return (*(Remedy("give", one) for one in names), *(Remedy("give", one, text) for one, text in values.items()))


def leave_out(*names: str) -> tuple[Remedy, ...]:
    """Return a remedy for each argument that may be left out."""
    return tuple(Remedy("leave out", one) for one in names)


class Notice(str):
    """A fault or doubt. As a string it is one line in Python's words.

    Attributes:
        code: kind of fault, for programs: see docs/reference/errors.md.
        subject: keywords of the arguments concerned.
        text: what was expected and what was given, without the names of arguments.
        remedy: arguments to give or to leave out, or actions to run.
        source: name of the photo or file concerned; "" where there is none.
    """

    code: str
    subject: tuple[str, ...]
    text: str
    remedy: tuple[Remedy, ...]
    source: str

    def __new__(
        cls,
        text: object,
        *,
        code: str = "",
        subject: str | Iterable[str] = (),
        remedy: Iterable[Remedy] = (),
        source: object = "",
    ) -> Notice:
        """Build a notice; arguments left out are copied from the text if that is a Notice."""
        old = text if isinstance(text, Notice) else None
        text = old.text if old is not None else str(text)
        code = code or (old.code if old is not None else "")
        names = [subject] if isinstance(subject, str) else subject
        subject = tuple(dict.fromkeys(filter(None, names))) or (() if old is None else old.subject)
        remedy = tuple(remedy) or (() if old is None else old.remedy)
        source = str(source) or ("" if old is None else old.source)
        source = "" if source in subject else source
        self = super().__new__(cls, PYTHON.compose(subject, source, text, remedy))
        self.code, self.subject, self.text, self.remedy, self.source = code, subject, text, remedy, source
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the notice as its JSON."""
        return Notice.from_json, (self.as_json(),)

    def adding(self, text: str) -> Notice:
        """Return a copy with more text."""
        more = f"{self.text}; {text}"
        return Notice(more, code=self.code, subject=self.subject, remedy=self.remedy, source=self.source)

    def of(self, source: object) -> Notice:
        """Return a copy about another photo or file; "": about none."""
        return Notice(self.text, code=self.code, subject=self.subject, remedy=self.remedy, source=source)

    def naming(self, names: Mapping[str, str]) -> Notice:
        """Return a copy with arguments renamed."""
        subject = [names.get(one, one) for one in self.subject]
        remedy = [replace(one, name=names.get(one.name, one.name)) for one in self.remedy]
        return Notice(self.text, code=self.code, subject=subject, remedy=remedy, source=self.source)

    def as_json(self) -> dict[str, Any]:
        """Return the notice as plain data; see from_json."""
        remedy = [{name: text for name, text in asdict(one).items() if text} for one in self.remedy]
        found = {"code": self.code, "subject": list(self.subject), "text": self.text, "remedy": remedy}
        return {**found, "source": self.source} if self.source else found

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Notice:
        """Build a notice from as_json's data.

        Raises:
            KeyError, TypeError: malformed data.
        """
        remedy = [Remedy(**one) for one in data["remedy"]]
        rest = {name: data.get(name, "") for name in ("code", "source")}
        return cls(data["text"], subject=data["subject"], remedy=remedy, **rest)


def as_notice(line: str, source: object = "") -> Notice:
    """Convert a warning to a Notice about the given source; a plain line becomes its text."""
    if isinstance(line, Notice):
        return line.of(source) if source else line
    return Notice(line, code="doubt", source=source)


class Words:
    """A door's names for arguments: here Python's keywords. Other doors override name, giving or action."""

    verb = "pass"

    def name(self, argument: str) -> str:
        """Return what users call an argument."""
        return argument

    def giving(self, argument: str, value: str) -> str:
        """Return how users give the argument; value "": any."""
        return f"{self.name(argument)}={value}"

    def action(self, name: str) -> str:
        """Return what users do for an action; "" where they cannot do it."""
        return _ACTIONS[name]

    def line(self, notice: str) -> str:
        """Render a notice, an error or a plain text as one line in these words."""
        if isinstance(notice, Notice):
            notice = self.compose(notice.subject, notice.source, notice.text, notice.remedy)
        return CONTROLS.sub(" ", notice)

    def compose(self, subject: tuple[str, ...], source: str, text: str, remedy: tuple[Remedy, ...]) -> str:
        """Format "subject source: text; remedy"."""
        head = " ".join(one for one in (" and ".join(map(self.name, subject)), source) if one)
        return "; ".join([f"{head}: {text}" if head else text, *self._remedies(remedy)])

    def _remedies(self, remedy: tuple[Remedy, ...]) -> list[str]:
        given = [self.giving(one.name, one.value) for one in remedy if one.do == "give"]
        dropped = [self.name(one.name) for one in remedy if one.do == "leave out"]
        ways = [f"{how} {_either(names)}" for how, names in ((self.verb, given), ("leave out", dropped)) if names]
        return [", or ".join(ways)] * bool(ways) + [
            done for one in remedy if one.do == "run" and (done := self.action(one.name))
        ]


def _either(names: list[str]) -> str:
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


PYTHON = Words()
