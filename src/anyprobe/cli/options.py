"""Options that commands share: what the photographed object is and where, and how its light is estimated.

A command takes a bundle as one argument, `object_options: ObjectOptions`, and `with_bundles` makes
its fields the command's own options, so that one option means the same everywhere. Hints and Settings name and describe
theirs.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer

from anyprobe.errors import InputError, InvalidMask, OutputError
from anyprobe.inputs.description import Hint
from anyprobe.inputs.hints import HINTS, PICTURES, Hints
from anyprobe.inputs.settings import SETTINGS, Settings
from anyprobe.notices import RESTART, Words

if TYPE_CHECKING:
    from anyprobe.estimate.estimator import Estimator
    from anyprobe.masks.networks import Network
    from anyprobe.masks.segmenters import Segmenter


JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")]
Colorspace = Literal["rec709", "acescg"]
ColorspaceOption = Annotated[
    Colorspace, typer.Option(help="Linear primaries of the .exr: Rec. 709 or ACEScg; its header says which.")
]
Frame = Literal["level", "camera"]
FrameOption = Annotated[
    Frame, typer.Option(help="level: +Y is up in the place, by the camera's pitch and roll; camera: its own frame.")
]
MarksOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="CSV with a row for each photo: photo, box, click, exclude (several with ; between)."
    ),
]
QuietOption = Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")]


NO_FOLDERS = (*PICTURES, ".npy", ".hdr", ".json", ".mp4", ".mov", ".glb", ".usda", ".usdz", ".zip")
"""Suffixes that show that a file's name was given where a folder is meant."""


def folder_option(help: str) -> Any:
    """Return the option -o of a command that writes into a folder; it refuses the name of a file."""
    return typer.Option("-o", "--out", help=help, callback=_folder)


def _folder(out: Path | None) -> Path | None:
    if out is not None and out.suffix.lower() in NO_FOLDERS and not out.is_dir():
        raise OutputError(
            f"-o {out}: expected a folder, got a name that ends in {out.suffix}; drop the suffix, or create the folder"
        )
    return out


def count_option(*names: str, least: int, most: int | None = None, **how: Any) -> Any:
    """Return the option of a whole number; another than from `least` to `most` is an InputError."""
    span = f"{least} or more" if most is None else f"{least} to {most}"

    def check(param: typer.CallbackParam, value: int) -> int:
        if value < least or (most is not None and value > most):
            raise InputError(f"expected {span}, got {value}", subject=param.name or "")
        return value

    return typer.Option(*names, callback=check, **how)


def _hint_option(hint: Hint) -> Any:
    kind: Any = str
    metavar, text = hint.metavar, hint.help
    if hint.suffixes:
        metavar, text = (
            "|".join(("FILE", *hint.words)),
            f"{text.rstrip('.')}; or a folder of them, named like the photos.",
        )
    elif hint.numbers == (1,):
        kind = float
    option = typer.Option(f"--{hint.name}", metavar=metavar, help=text)
    return Annotated[list[kind] | None if hint.repeated else kind | None, option]


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
        form = (
            FORMS.get(argument, "NUMBER") if hint is None else hint.metavar or ("FILE" if hint.suffixes else "NUMBER")
        )
        return f"{self.name(argument)} {value or form}"

    def action(self, name: str) -> str:
        """Return what users of the command line do."""
        return "or add --restart" if name == RESTART else super().action(name)


OPTIONS = OptionWords()


TO_FIND = tuple(name for name, hint in HINTS.items() if hint.about == "place" and name != "mask")
"""Hints that help to find the mask."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MaskOptions:
    """Location of the object."""

    given: Annotated[Hints, TO_FIND]
    finder: Annotated[Settings, ("segmenter",)]
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with status 2 if a result has a warning; it is still written.")
    ] = False

    def hints(self) -> Hints:
        """Return what the options give. Files may still be folders: hints_for makes them one photo's.

        Raises:
            InvalidMask: no such file or folder.
        """
        for name in ("mask", "depth"):
            path = self.given.files().get(name)
            if path is not None and not path.exists():
                raise InvalidMask("no such file or folder; check the path", subject=name, source=path)
        return self.given

    def segmenter(self) -> Network | Segmenter | None:
        """Load the segmenter that is asked for; None if none is. Errors: see load_segmenter."""
        from anyprobe.masks.segmenters import load_segmenter

        return None if self.finder.segmenter is None else load_segmenter(str(self.finder.segmenter))


def _read(hint: Hint, given: Any) -> Any:
    """Return the value of a hint's option, which typer gives as text, texts or a number."""
    if hint.suffixes:
        return hint.read_path(given)
    if isinstance(given, list):
        return [hint.read(text) for text in given]
    return hint.read(given) if isinstance(given, str) else given


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectOptions(MaskOptions):
    """Location of the object, and priors on it, its surroundings and the camera."""

    given: Annotated[Hints, tuple(HINTS)]


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelOptions:
    """Options of the estimator."""

    settings: Annotated[Settings, ("model", "providers", "threads")]

    def estimator(self, **more: Any) -> Estimator:
        """Open the estimator with these options; `more` overrides settings."""
        from anyprobe.estimate.estimator import Estimator

        return Estimator(replace(self.settings, **more))


def with_bundles(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with each parameter that is a dataclass of options replaced by these options.

    A field of such a dataclass is an option, or `Annotated[Hints, names]` or `Annotated[Settings, names]`: an option
    for each of these fields of Hints or Settings, from their own descriptions.
    """
    hints = get_type_hints(command, include_extras=True)
    options: list[inspect.Parameter] = []
    bundles: dict[str, type] = {}
    for parameter in inspect.signature(command).parameters.values():
        kind = hints[parameter.name]
        if isinstance(kind, type) and is_dataclass(kind):
            bundles[parameter.name] = kind
            options += _options_of(kind)
        else:
            options.append(_option(parameter.name, kind, parameter.default))

    @functools.wraps(command)
    def run(**values: Any) -> None:
        bundle_values = {name: _bundle(kind, values) for name, kind in bundles.items()}
        command(**bundle_values, **values)

    run.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]  # what typer reads
    run.__annotations__ = {one.name: one.annotation for one in options}
    del run.__wrapped__
    return run


def _options_of(bundle: type) -> list[inspect.Parameter]:
    """Return the options of a bundle's fields."""
    annotations, options = get_type_hints(bundle, include_extras=True), []
    for field in fields(bundle):
        kind, names = _group(annotations[field.name])
        if kind is Hints:
            options += [_option(name, _hint_option(HINTS[name]), None) for name in names]
        elif kind is Settings:
            options += [_setting_option(setting) for setting in fields(Settings) if setting.name in names]
        else:
            options.append(_option(field.name, annotations[field.name], field.default))
    return options


def _bundle(bundle: type, values: dict[str, Any]) -> Any:
    """Build a bundle from its options' values, which are removed from `values`."""
    annotations = get_type_hints(bundle, include_extras=True)
    arguments: dict[str, Any] = {}
    for field in fields(bundle):
        kind, names = _group(annotations[field.name])
        if kind is Hints:
            given = {name: values.pop(name) for name in names}
            arguments[field.name] = Hints(
                **{name: _read(HINTS[name], value) for name, value in given.items() if value not in (None, [])}
            )
        elif kind is Settings:
            arguments[field.name] = Settings(**{name: values.pop(name) for name in names})
        else:
            arguments[field.name] = values.pop(field.name)
    return bundle(**arguments)


def _group(annotation: Any) -> tuple[Any, tuple[str, ...]]:
    """Return Hints or Settings and the names of Annotated[Hints, names]; (None, ()) for another annotation."""
    kind, *names = get_args(annotation) if get_origin(annotation) is Annotated else (None,)
    return (kind, names[0]) if kind in (Hints, Settings) else (None, ())


def _setting_option(setting: Field[Any]) -> inspect.Parameter:
    described = SETTINGS[setting.name]
    kind: Any = {"threads": int | None, "segmenter": str | None}.get(setting.name, str)
    option = typer.Option(f"--{setting.name.replace('_', '-')}", metavar=described.metavar, help=described.help)
    default = ",".join(setting.default) if isinstance(setting.default, tuple) else setting.default
    return _option(setting.name, Annotated[kind, option], default)


def _option(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def refuse_unused(context: typer.Context, why: str, *names: str) -> None:
    """Raise InputError if the command line gives one of these parameters, which has no effect; why: "with --x"."""
    for name in names:
        source = context.get_parameter_source(name)
        assert source is not None, name
        if source.name == "COMMANDLINE":
            raise InputError(f"does nothing {why}; leave it out", subject=name)
