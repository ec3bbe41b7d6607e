"""Settings: how lights are estimated, whatever the photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, TypedDict

from anyprobe.errors import InputError
from anyprobe.files.graphs import CPU
from anyprobe.inputs.description import described
from anyprobe.inputs.hints import HintKeywords
from anyprobe.masks.networks import NetworkSource

DEFAULT_MODEL = "lift"


@dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """How lights are estimated, whatever the photo.

    Attributes:
        model: name of a bundled one, "lift" or "paper", or a folder of graphs.
        threads: of ONNX Runtime; None leaves the choice to it.
        providers: of ONNX Runtime, the preferred first, such as ("CUDAExecutionProvider", "CPUExecutionProvider") with
            onnxruntime-gpu in the place of onnxruntime; a list or names between commas.
        segmenter: network that finds the object in photos without a mask: "u2netp", "u2netp:FILE", "small", or a
            masks.networks.Network.
    Raises:
        InputError: threads that are no whole number of 1 or more.
    """

    model: str = DEFAULT_MODEL
    threads: int | None = None
    providers: str | Sequence[str] = CPU
    segmenter: NetworkSource | None = None

    def __post_init__(self) -> None:
        named = self.providers.split(",") if isinstance(self.providers, str) else self.providers
        object.__setattr__(self, "providers", tuple(named) or CPU)
        if self.threads is not None and not (isinstance(self.threads, int) and self.threads >= 1):
            text = f"expected a whole number of 1 or more, got {self.threads!r}; leave it out to use all cores"
            raise InputError(text, subject="threads")

    def changes(self) -> dict[str, Any]:
        """Return the settings that are not defaults."""
        values = {one.name: (getattr(self, one.name), one.default) for one in fields(self)}
        return {name: value for name, (value, default) in values.items() if value != default}

    @property
    def networks(self) -> tuple[str, int | None, tuple[str, ...]]:
        """The settings that networks are opened with."""
        return self.model, self.threads, tuple(self.providers)


class SettingKeywords(TypedDict, total=False):
    """Keywords of functions that take settings: the fields of Settings."""

    model: str
    threads: int | None
    providers: str | Sequence[str]
    segmenter: NetworkSource | None


class Keywords(HintKeywords, SettingKeywords, total=False):
    """Keywords of functions that take both."""


SETTINGS = described(Settings)
"""Descriptions by the field's name, in the order of Settings."""
