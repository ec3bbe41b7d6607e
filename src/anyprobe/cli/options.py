"""Options that commands share: what the photographed object is and where, and how its light is estimated.

A command takes a group of them as one argument, `given: ObjectOptions`, whose fields are the options. What a hint's or
a setting's option is called, what it takes and its help are written where the input is described, in `inputs`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter, Token

from anyprobe.errors import InputError, InvalidMask, OutputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.files.graphs import CPU
from anyprobe.inputs.hints import HINTS, PICTURES, Hints
from anyprobe.inputs.settings import DEFAULT_MODEL, SETTINGS, Settings
from anyprobe.masks.networks import Network, load_network
from anyprobe.notices import RESTART, Words

Photos = Annotated[Path, Parameter(name="PHOTO", help="Photos, folders of photos, or - for standard input.")]
JsonOption = Annotated[bool, Parameter(name="--json", help="Print JSON on stdout.")]
QuietOption = Annotated[bool, Parameter(name=("--quiet", "-q"), help="Print errors only.")]
ColorspaceOption = Annotated[
    Literal["rec709", "acescg"],
    Parameter(help="Linear primaries of the .exr: Rec. 709 or ACEScg; its header says which."),
]
FrameOption = Annotated[
    Literal["level", "camera"],
    Parameter(help="level: +Y is up in the place, by the camera's pitch and roll; camera: its own frame."),
]
MarksOption = Annotated[
    Path | None,
    Parameter(
        metavar="FILE", help="CSV with a row for each photo: photo, box, click, exclude (several with ; between)."
    ),
]

STRICT = "Exit with status 2 if a result has a warning; it is still written."
NO_FOLDERS = (*PICTURES, ".npy", ".hdr", ".json", ".mp4", ".mov", ".glb", ".usda", ".usdz", ".zip")
"""Suffixes that show that a file's name was given where a folder is meant."""


def folder_option(help: str) -> Parameter:
    """Return the option -o of a command that writes into a folder; it refuses the name of a file."""
    return Parameter(name=("--out", "-o"), metavar="FOLDER", help=help, validator=_check_folder)


def _check_folder(_: Any, out: Path | None) -> None:
    if out is not None and out.suffix.lower() in NO_FOLDERS and not out.is_dir():
        text = f"expected a folder, got a name that ends in {out.suffix}; drop the suffix, or create the folder"
        raise OutputError(f"-o {out}: {text}")


def bounded(least: float, most: float = math.inf) -> Parameter:
    """Return the part of an option that refuses numbers outside a range, and fractions where whole ones are meant."""
    span = f"{least:g} or more" if most == math.inf else f"{least:g} to {most:g}"

    def read(kind: type, tokens: Sequence[Token]) -> Any:
        text = tokens[0].value
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            whole = "a whole number of " if kind is int and math.isnan(value) else ""
            raise InputError(f"expected {whole}{span}, got {text}", source=tokens[0].keyword)
        return value

    return Parameter(converter=read, allow_leading_hyphen=True)


GROUPS = {
    "place": Group("Where the object is", sort_key=1),
    "camera": Group("Camera", sort_key=2),
    "light": Group("Object's surface and its surroundings", sort_key=3),
    "setting": Group("Networks", sort_key=4),
}


def option_of(name: str) -> Parameter:
    """Return the option of a hint or setting, as `inputs` describes it."""
    hint = {**HINTS, **SETTINGS}[name]
    metavar, text = hint.metavar, hint.help
    if hint.suffixes:
        metavar = "|".join(("FILE", *hint.words))
        text = f"{text.rstrip('.')}; or a folder of them, named like the photos."
    elif hint.numbers == (1,):
        metavar = "NUMBER"
    option, group, signed = f"--{hint.name.replace('_', '-')}", GROUPS[hint.about], bool(hint.numbers)
    return Parameter(name=option, metavar=metavar, help=text, group=group, allow_leading_hyphen=signed, negative=())


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PlaceOptions:
    """Location of the object; as text where it is no number."""

    click: Annotated[list[str] | None, option_of("click")] = None
    exclude: Annotated[list[str] | None, option_of("exclude")] = None
    box: Annotated[str | None, option_of("box")] = None
    depth: Annotated[Path | None, option_of("depth")] = None
    near: Annotated[float | None, option_of("near")] = None
    far: Annotated[float | None, option_of("far")] = None
    segmenter: Annotated[str | None, option_of("segmenter"), Parameter(group=GROUPS["place"])] = None
    strict: Annotated[bool, Parameter(help=STRICT)] = False

    def hints(self) -> Hints:
        """Return what the options give. Files may still be folders: hints_for makes them one photo's.

        Raises:
            InputError: a text that is not what its option takes. InvalidMask: no such file or folder.
        """
        given = [(HINTS[name], text) for name, text in vars(self).items() if name in HINTS and text is not None]
        values: list[Any] = [(hint.read_path if hint.suffixes else hint.read)(text) for hint, text in given]
        hints = Hints(**{hint.keyword: value for (hint, _), value in zip(given, values, strict=True)})
        for name in ("mask", "depth"):
            path = hints.files().get(name)
            if path is not None and not path.exists():
                raise InvalidMask("no such file or folder; check the path", subject=name, source=path)
        return hints

    def open_segmenter(self) -> Network | None:
        """Open the network that is asked for; None if none is. Errors: see load_network."""
        return None if self.segmenter is None else load_network(self.segmenter)


@dataclass(frozen=True, kw_only=True)
class ObjectOptions(PlaceOptions):
    """The same, and priors on the object, its surroundings and the camera."""

    mask: Annotated[Path | None, option_of("mask")] = None
    fov_deg: Annotated[float | None, option_of("fov_deg")] = None
    pitch_deg: Annotated[float | None, option_of("pitch_deg")] = None
    roll_deg: Annotated[float | None, option_of("roll_deg")] = None
    normals: Annotated[str | None, option_of("normals")] = None
    material: Annotated[str | None, option_of("material")] = None
    albedo: Annotated[str | None, option_of("albedo")] = None
    roughness: Annotated[float | None, option_of("roughness")] = None
    surroundings: Annotated[str | None, option_of("surroundings")] = None
    sun: Annotated[str | None, option_of("sun")] = None


ModelOption = Annotated[str, option_of("model")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """Options of the estimator."""

    model: ModelOption = DEFAULT_MODEL
    threads: Annotated[int | None, option_of("threads"), bounded(1)] = None
    providers: Annotated[str, option_of("providers")] = ",".join(CPU)

    def estimator(self, segmenter: str | None = None) -> Estimator:
        """Open the estimator with these options."""
        return Estimator(Settings(**vars(self), segmenter=segmenter))


FORMS = {"at": "X,Y"}
"""Forms of values, other than a number, of options that are no hints."""


class OptionWords(Words):
    """Arguments as options of the command line."""

    def name(self, argument: str) -> str:
        """Return the option of a hint, a setting or a command's own parameter."""
        if argument in ("photo", "photos", "clip"):
            return argument.upper()
        return f"--{HINTS[argument].name if argument in HINTS else argument.replace('_', '-')}"

    def giving(self, argument: str, value: str) -> str:
        """Return the option and what follows it."""
        hint = HINTS.get(argument)
        form = FORMS.get(argument) if hint is None else hint.metavar or ("FILE" if hint.suffixes else None)
        return f"{self.name(argument)} {value or form or 'NUMBER'}"

    def action(self, name: str) -> str:
        """Return what users of the command line do."""
        return "or add --restart" if name == RESTART else super().action(name)


OPTIONS = OptionWords()


def refuse_unused(why: str, *names: str) -> None:
    """Raise InputError if the command line has the option of one of these, which has no effect; why: "with --x"."""
    words = {word.partition("=")[0] for word in sys.argv[1:]}
    for name in names:
        if OPTIONS.name(name) in words:
            raise InputError(f"does nothing {why}; leave it out", subject=name)
