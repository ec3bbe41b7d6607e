"""How lights are estimated, whatever the photo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from anyprobe.errors import InputError
from anyprobe.estimate.runtime import DEFAULT_MODEL, EMITTERS, LOOKS, MODE
from anyprobe.files.graphs import CPU
from anyprobe.masks.segmenters import SegmenterSource

MODEL_HELP = (
    "lift; paper: the stages of Park et al. 2020 with our layers and losses, and targets that are 70 % maps of lift; "
    "or a folder of ONNX graphs."
)
"""Default of --model."""


def _setting(default: Any, help: str, metavar: str | None = None, choices: tuple[Any, ...] = ()) -> Any:
    """Return a field; choices: the values that a request to the server may ask for, none where it may not ask."""
    return field(default=default, metadata={"help": help, "metavar": metavar, "choices": choices})


@dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """How lights are estimated, whatever the photo.

    Attributes:
        model: name of a bundled one, "lift" or "paper", or a folder of graphs.
        threads: of ONNX Runtime; None leaves the choice to it.
        providers: of ONNX Runtime, the preferred first, such as ("CUDAExecutionProvider", "CPUExecutionProvider") with
            onnxruntime-gpu in the place of onnxruntime; a list or names between commas.
        emitters: "mode", light sources at their most likely positions (sharp shadows and highlights), or "expected",
            the mean radiance over all positions (soft, and truer on matte objects).
        looks: 2, to look at the photo in a mirror too and take the likelier light, in twice the time: then a mirrored
            photo has the mirrored light.
        segmenter: what finds the object in photos without a mask, instead of the built-in network: a name of
            masks.segmenters ("rembg", "sam:FOLDER", a plug-in), or a Segmenter.
    Raises:
        InputError: another number of looks, or threads that are no whole number of 1 or more.
    """

    model: str = _setting(DEFAULT_MODEL, MODEL_HELP)
    threads: int | None = _setting(None, "Number of threads of ONNX Runtime; default: its choice.")
    providers: str | Sequence[str] = _setting(
        CPU, "Execution providers of ONNX Runtime, the preferred first.", "NAME[,NAME...]"
    )
    emitters: str = _setting(
        MODE,
        "mode: light sources at their most likely positions, with sharp shadows and highlights; expected: "
        "the mean over all positions, with soft shadows and a smaller error on matte objects.",
        "mode|expected",
        EMITTERS,
    )
    looks: int = _setting(
        1,
        "2: also look at the mirrored photo and keep the likelier light, so that a mirrored photo gets the mirrored "
        "light; takes twice as long.",
        choices=LOOKS,
    )
    segmenter: SegmenterSource | None = _setting(
        None,
        "Segmenter to use instead of the built-in network: rembg[:MODEL], sam:FOLDER or a plug-in.",
        "NAME[:ARGUMENT]",
    )

    def __post_init__(self) -> None:
        named = self.providers.split(",") if isinstance(self.providers, str) else self.providers
        object.__setattr__(self, "providers", tuple(named) or CPU)
        if self.looks not in LOOKS:
            raise InputError(f"expected {' or '.join(map(str, LOOKS))}, got {self.looks}", subject="looks")
        if self.threads is not None and not (isinstance(self.threads, int) and self.threads >= 1):
            raise InputError(
                f"expected a whole number of 1 or more, got {self.threads!r}; leave it out to use all cores",
                subject="threads",
            )

    @classmethod
    def among(cls, arguments: Mapping[str, Any]) -> Settings:
        """Return the settings among a function's arguments, its locals(), which have all of them."""
        return cls(**{one.name: arguments[one.name] for one in fields(cls)})

    def changes(self) -> dict[str, Any]:
        """Return the settings that are not defaults."""
        values = {one.name: (getattr(self, one.name), one.default) for one in fields(self)}
        return {name: value for name, (value, default) in values.items() if value != default}

    @property
    def networks(self) -> tuple[str, int | None, tuple[str, ...]]:
        """The settings that networks are opened with."""
        return self.model, self.threads, tuple(self.providers)


CHOICES: dict[str, tuple[Any, ...]] = {
    one.name: one.metadata["choices"] for one in fields(Settings) if one.metadata["choices"]
}
"""Values of the settings that a request may ask for."""
