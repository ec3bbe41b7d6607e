"""Options that commands share. A command takes a bundle as one argument, and `with_bundles` spreads its fields."""

from __future__ import annotations

import functools
import glob
import inspect
import math
import sys
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields, is_dataclass, make_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import typer

from anyprobe.errors import InputError, InvalidMask, InvalidPhoto, MissingExtra, OutputError
from anyprobe.estimate.runtime import DEFAULT_ENGINE, DEFAULT_MODEL, ENGINES, MODE
from anyprobe.files.exr import HEADER_BYTES, parse_header
from anyprobe.files.paths import folds_case, open_regular, read_stream, same_file_key, visible_files
from anyprobe.hints import HINTS, PICTURES, Hint, Hints, check_together, renamed, said_as

if TYPE_CHECKING:
    from anyprobe.detail.library import Library
    from anyprobe.estimate.estimator import Estimator

MODEL_HELP = "lift; paper: stages of Park et al. 2020 in our layers, begun as lift; or a folder of ONNX graphs."
"""Of --model."""
STDIN = Path("-")
"""A photo that comes through standard input."""

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")]
Colorspace = Literal["rec709", "acescg"]
ColorspaceOption = Annotated[
    Colorspace, typer.Option(help="Linear primaries of the .exr: Rec. 709 or ACEScg; its header says which.")
]
Frame = Literal["level", "camera"]
FrameOption = Annotated[
    Frame, typer.Option(help="level: +Y is up in the place, by the camera's pitch and roll; camera: its own frame.")
]
QuietOption = Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")]


NO_FOLDERS = (*PICTURES, ".npy", ".hdr", ".json", ".mp4", ".mov", ".glb", ".usda", ".usdz", ".zip")
"""Suffixes that a name has by mistake where a folder is meant."""


def folder_option(help: str) -> Any:
    """The option -o of a command that writes into a folder: the name of a file is refused."""
    return typer.Option("-o", "--out", help=help, callback=_folder)


def _folder(out: Path | None) -> Path | None:
    if out is not None and out.suffix.lower() in NO_FOLDERS and not out.is_dir():
        raise OutputError(
            f"-o {out}: expected a folder, got a name that ends in {out.suffix}; leave that out, or make the folder"
        )
    return out


def _options_of(hints: Iterable[str]) -> Any:
    """A dataclass with an option for each of these hints."""
    options = [(name, _hint_option(HINTS[name]), None) for name in hints]
    return make_dataclass("HintOptions", options, frozen=True, kw_only=True)


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


def option_of(name: str) -> str:
    """What the command line calls a hint."""
    return f"--{HINTS[name].name}"


def said_of_hints() -> AbstractContextManager[None]:
    """What the library says of a hint is said of its option."""
    return said_as(**{name: f"--{hint.name}" for field, hint in HINTS.items() for name in (field, hint.name)})


def line_of(said: object) -> str:
    """An error or a warning as one line that names options: `mask=` is `--mask FILE` there."""

    def option(hint: Hint) -> str:
        return f"--{hint.name} {hint.metavar or ('FILE' if hint.suffixes else 'NUMBER')}"

    return renamed(" ".join(str(said).splitlines()), option)


TO_FIND = [name for name, hint in HINTS.items() if hint.about == "place" and name != "mask"]
"""Hints by which a mask is found."""
_ToFind: Any = _options_of(TO_FIND)
_Others: Any = _options_of(name for name in HINTS if name not in TO_FIND)


@dataclass(frozen=True, kw_only=True, slots=True)
class MaskOptions(_ToFind):
    """Where the object is."""

    segmenter: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[:ARGUMENT]",
            help="Segmenter to use instead of the built-in network: rembg[:MODEL], sam:FOLDER or a plug-in.",
        ),
    ] = None
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with status 2 if a result has a warning; it is written all the same.")
    ] = False

    def hints(self, **more: Any) -> Hints:
        """What the options give, and more; or one line on what does not go together.

        Files may still be folders: hints_for makes them one photo's.
        """
        texts = {name: getattr(self, name, None) for name in HINTS}
        given = {name: text for name, text in texts.items() if text not in (None, [])}
        check_together(list(given), option_of)
        with said_of_hints():
            hints = Hints(**{name: _read(HINTS[name], text) for name, text in given.items()} | more)
        for name in ("mask", "depth"):
            path = hints.files().get(name)
            if path is not None and not path.exists():
                raise InvalidMask(f"{option_of(name)} {path}: no such file or folder; check the path")
        return hints


def _read(hint: Hint, given: Any) -> Any:
    """What a hint's option stands for, which typer gives as text, texts or a number."""
    if hint.suffixes:
        return hint.read_path(given)
    if isinstance(given, list):
        return [hint.read(text) for text in given]
    return hint.read(given) if isinstance(given, str) else given


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectOptions(_Others, MaskOptions):
    """Where the object is and what is given of it, of its surroundings and of the camera."""

    normals_from: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.onnx",
            help="Estimate the normals with this ONNX graph; FILE.json beside it describes it (docs/how-to/inputs.md).",
        ),
    ] = None
    camera: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Lens, pitch and roll of a .fspy, or of the .json that fSpy exports."),
    ] = None
    metal: Annotated[bool, typer.Option("--metal", help="The object is bare metal: chrome, if no --material.")] = False

    def hints(self, **more: Any) -> Hints:
        from anyprobe.estimate.normals_model import open_normals_model

        if self.normals_from is not None:
            if self.normals is not None:
                raise InputError("--normals and --normals-from: expected one of them, got both")
            more["normals"] = open_normals_model(self.normals_from)
        if self.camera is not None:
            more |= self._camera()
        if self.metal and self.material is None:
            more["material"] = "chrome"
        hints = MaskOptions.hints(self, **more)
        surface = hints.surface() if self.metal else None
        if surface is not None and surface.albedo.any():
            raise InputError(f"--metal and --material {self.material}: expected a metal, got another; leave one out")
        return hints

    def _camera(self) -> dict[str, float]:
        """What --camera gives, as hints; InputError where an option gives the same."""
        from anyprobe.files.fspy import read_fspy

        found = read_fspy(Path(str(self.camera)))
        given = {"fov_deg": found.long_fov_deg, "pitch_deg": found.pitch_deg, "roll_deg": found.roll_deg}
        for name in given:
            if getattr(self, name, None) is not None:
                raise InputError(f"--camera and {option_of(name)}: expected one of them, got both")
        return given


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelOptions:
    """What estimates, and how."""

    emitters: Annotated[
        str,
        typer.Option(
            metavar="mode|expected",
            help="mode: light sources at their most likely positions, with sharp shadows and highlights; expected: "
            "the mean over all positions, with soft shadows and a smaller error on matte objects.",
        ),
    ] = MODE
    model: Annotated[str, typer.Option(help=MODEL_HELP)] = DEFAULT_MODEL
    engine: Annotated[str, typer.Option(metavar="NAME", help=f"Engine: {', '.join(ENGINES)}.")] = DEFAULT_ENGINE
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the engine; default: its choice.")] = None

    def estimator(self, **more: Any) -> Estimator:
        """Opened by these options."""
        from anyprobe.estimate.estimator import Estimator

        return Estimator(self.model, threads=self.threads, engine=self.engine, emitters=self.emitters, **more)


@dataclass(frozen=True, kw_only=True, slots=True)
class DetailOptions:
    """Where a map's detail is from."""

    detail: Annotated[
        str,
        typer.Option(
            metavar="none|plausible",
            help="plausible: add invented high-frequency detail that fits the estimate, for sharp reflections.",
        ),
    ] = "none"
    detail_library: Annotated[
        Path | None, typer.Option(help="Folder of .exr and .hdr maps to take it from; default: the built-in library.")
    ] = None

    def settings(self) -> dict[str, Any]:
        """For Estimator. InputError for what does nothing without detail."""
        from anyprobe.detail.plausible import check_detail

        given = {} if self.detail_library is None else {"detail_library": self.detail_library}
        if not check_detail(self.detail) and given:
            raise InputError("--detail-library: does nothing without --detail plausible; add that, or leave it out")
        return {"detail": self.detail, **given}

    def library(self) -> Library | None:
        """What detail is from; None where none is asked for."""
        from anyprobe.detail.library_folder import open_library

        return None if self.settings()["detail"] == "none" else open_library(self.detail_library)


def with_bundles(command: Callable[..., None]) -> Callable[..., None]:
    """The command with each parameter that is annotated with a dataclass of options replaced by its fields."""
    hints = get_type_hints(command, include_extras=True)
    spread: list[inspect.Parameter] = []
    bundles: dict[str, type] = {}
    for parameter in inspect.signature(command).parameters.values():
        kind = hints[parameter.name]
        if isinstance(kind, type) and is_dataclass(kind):
            bundles[parameter.name] = kind
            inner = get_type_hints(kind, include_extras=True)
            spread += [_option(one.name, inner[one.name], one.default) for one in fields(kind)]
        else:
            spread.append(_option(parameter.name, hints[parameter.name], parameter.default))

    @functools.wraps(command)
    def run(**values: Any) -> None:
        made = {
            name: kind(**{one.name: values.pop(one.name) for one in fields(kind)}) for name, kind in bundles.items()
        }
        command(**made, **values)

    run.__signature__ = inspect.Signature(spread)  # type: ignore[attr-defined]  # what typer reads
    run.__annotations__ = {one.name: one.annotation for one in spread}
    del run.__wrapped__
    return run


def _option(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def refuse_unused(context: typer.Context, why: str, *names: str) -> None:
    """InputError where the command line gives one of these parameters, which does nothing there; why: `beside --x`."""
    for name in names:
        source = context.get_parameter_source(name)
        assert source is not None, name
        if source.name == "COMMANDLINE":
            option = next(one.opts[0] for one in context.command.params if one.name == name)
            raise InputError(f"{option}: does nothing {why}; leave it out")


def need_torch(what: str) -> None:
    """MissingExtra where PyTorch is not installed; what: what it is needed for."""
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise MissingExtra("torch", "train", what) from error


def photo_source(path: Path) -> Path | bytes:
    """A photo's path, or what standard input holds where the path is `-`."""
    if path != STDIN:
        return path
    if sys.stdin is None:  # closed, as a service's may be
        raise InvalidPhoto("stdin: expected a photo, got a closed input; name a file, or pipe one in")
    return read_stream(sys.stdin.buffer, "stdin", InvalidPhoto)


def photo_name(path: Path) -> str:
    """What a photo is called in messages."""
    return "stdin" if path == STDIN else path.name


def hints_for(photo: Path, hints: Hints) -> Hints:
    """The hints of one photo: folders of masks, depth images, normals or panoramas become the file of its name."""
    files: dict[str, Any] = {
        name: _file_for(photo, path, name, HINTS[name].suffixes) for name, path in hints.files().items()
    }
    return replace(hints, **files)


def list_photos(photos: list[Path]) -> list[Path]:
    """Files as given; folders as the photos in them, in natural order, without hidden files, environment maps and
    what anyprobe wrote: NAME_mask, NAME_overlay and NAME_relit beside NAME, and NAME.png beside a map of that name; nor
    NAME.jpg.png, a mask of NAME.jpg."""
    chosen: list[Path] = []
    for path in photos:
        if not path.is_dir():
            chosen.append(path)
            continue
        found = visible_files(path, PICTURES)
        written = {f"{p.stem}_{kind}" for p in found for kind in ("mask", "overlay", "relit", "origin")} | {
            p.name for p in found
        }
        maps = {p for p in found if p.suffix.lower() == ".exr" and _is_map(p)}
        previews = {p.with_suffix(".png") for p in maps if p.with_suffix(".json").is_file()}
        found = [p for p in found if p.stem not in written and p not in maps | previews]
        if not found:
            raise InputError(f"{path}: no photos in this folder; check the path")
        chosen += found
    return list(dict.fromkeys(chosen))


def _is_map(path: Path) -> bool:
    """Whether an .exr is twice as wide as high, as environment maps are; nothing is decoded."""
    try:
        with open_regular(path, InputError) as stream:
            low, high = parse_header(stream.read(HEADER_BYTES)).display
    except ValueError:  # what reads it says why
        return False
    return bool(high[0] - low[0] == 2 * (high[1] - low[1]))


def result_stem(photo: Path, listed: list[Path]) -> str:
    """What a photo's results are called: its stem; with the suffix (photo_heic) where another photo has the same."""
    if photo == STDIN:
        return photo_name(photo)
    alike = any(other.stem == photo.stem and other.suffix != photo.suffix for other in listed)
    return f"{photo.stem}_{photo.suffix[1:]}" if alike and photo.suffix else photo.stem


def check_names(photo: Path, listed: list[Path], targets: Iterable[Path], given: Iterable[Any]) -> None:
    """Refuse results of one name for two photos, and one that would replace a photo or what else is given."""
    targets = list(targets)
    folds = bool(targets) and folds_case(targets[0].parent)

    def name_of(one: Path) -> str:
        stem = result_stem(one, listed)
        return stem.casefold() if folds else stem

    twins = [other for other in listed if name_of(other) == name_of(photo)]
    if twins and twins[0] != photo:
        raise OutputError(f"{photo}: expected names that differ, got {twins[0]} before it; rename one of them")
    inputs = {same_file_key(one): one for one in (*listed, *given) if isinstance(one, Path)}
    for target in targets:
        if same_file_key(target) in inputs:
            lost = inputs[same_file_key(target)]
            raise OutputError(f"{photo}: the result would replace {lost}; choose another folder with -o")


def pixels_of(option: str, text: str, count: int, form: str, example: str) -> tuple[float, ...]:
    """So many numbers of an option's text; InvalidMask, with an example, for another."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InvalidMask(f"{option}: expected {form} in pixels, got {text!r}; for instance {option} {example}")
    return numbers


def _file_for(photo: Path, given: Path, kind: str, suffixes: tuple[str, ...]) -> Path:
    """The file itself, or by stem from a folder (NAME.*, NAME_<kind>.*, or the photo's whole name and a suffix)."""
    if not given.is_dir():
        return given
    for stem in (f"{photo.stem}_{kind}", photo.stem, photo.name):
        for candidate in sorted(given.glob(f"{glob.escape(stem)}.*")):
            # the glob finds stem.0002.png too, which is another photo's
            if candidate.stem != stem or candidate.suffix.lower() not in suffixes:
                continue
            if same_file_key(candidate) != same_file_key(photo):
                return candidate
    raise InvalidMask(f"{photo}: expected {photo.stem}.png or {photo.stem}_{kind}.png in {given}, found neither")
