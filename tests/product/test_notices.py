"""Messages are data: a door changes how arguments are named, nothing else."""

from __future__ import annotations

import copy
import json
import pickle

import pytest

from anyprobe.cli.options import OPTIONS
from anyprobe.errors import InvalidMask, MissingExtra, OutputError, arguments_named
from anyprobe.inputs.hints import HINTS
from anyprobe.notices import PYTHON, Notice, Words, give, leave_out

NOTICE = Notice(
    "expected white on the object, got none",
    code="no-object",
    subject=("mask", "fov_deg"),
    source="box=.png",
    remedy=(*give("click", "box", surroundings="photo"), *leave_out("depth")),
)


def test_a_notice_is_its_line_in_python():
    line = (
        "mask and fov_deg box=.png: expected white on the object, got none; pass click=, box= or surroundings=photo, "
        "or leave out depth"
    )
    assert str(NOTICE) == PYTHON.line(NOTICE) == line
    assert json.loads(json.dumps([NOTICE])) == [line]


def test_a_file_s_name_neither_ends_the_line_nor_moves_the_cursor():
    line = OPTIONS.line(Notice("no such file", source="a\nb\x1b[2J\x9bc\u2028d.png"))
    assert line == "a b [2J c d.png: no such file"


def test_the_command_line_names_options_and_leaves_file_names_alone():
    assert OPTIONS.line(NOTICE) == (
        "--mask and --fov box=.png: expected white on the object, got none; "
        "pass --click X,Y, --box X0,Y0,X1,Y1 or --surroundings photo, or leave out --depth"
    )


@pytest.mark.parametrize("name", HINTS)
def test_every_door_names_every_hint(name):
    problems = pytest.importorskip("anyprobe.serve.answers", reason="needs the serve extra", exc_type=ImportError)
    for words, shown in (
        (PYTHON, f"pass {name}="),
        (OPTIONS, f"pass --{HINTS[name].name} "),
        (problems.FIELDS, f"send {HINTS[name].name}"),
    ):
        assert words.line(Notice("a", remedy=give(name))).startswith(f"a; {shown}")


def test_nothing_is_lost_between_processes_and_in_json():
    for again in (
        pickle.loads(pickle.dumps(NOTICE)),
        copy.deepcopy(NOTICE),
        Notice.from_json(json.loads(json.dumps(NOTICE.as_json()))),
    ):
        assert (again, again.as_json()) == (NOTICE, NOTICE.as_json())
    for error in (
        InvalidMask(NOTICE),
        MissingExtra("rawpy", "raw", "a RAW photo"),
        OutputError("full", source="a.exr"),
    ):
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), again.notice.as_json()) == (type(error), str(error), error.notice.as_json())


def test_arguments_are_named_as_the_caller_s_own():
    with pytest.raises(InvalidMask) as error, arguments_named(size="scale", mask="cover"):
        raise InvalidMask("expected a, got b", subject="size", remedy=give("mask", "box"))
    assert str(error.value) == "scale: expected a, got b; pass cover= or box="


def test_a_line_is_one():
    assert Words().line("a\nb") == "a b"
    assert "\n" not in OPTIONS.line(Notice("a", source="b\nc"))
