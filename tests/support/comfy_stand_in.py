"""What ComfyUI gives a node, as far as ours use it: the V3 classes with their parameters, and the output folder.

Names, parameters and rules are those of comfy_api/latest/_io.py and _ui.py; nothing here runs a graph as ComfyUI does.
"""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any


@dataclass
class Input:
    id: str
    display_name: str | None = None
    optional: bool = False
    tooltip: str | None = None

    def accepts(self, value: Any) -> bool:
        return False


@dataclass
class Widget(Input):
    default: Any = None
    force_input: bool | None = None


@dataclass
class ImageInput(Input):
    io_type = "IMAGE"


@dataclass
class MaskInput(Input):
    io_type = "MASK"


@dataclass
class StringInput(Widget):
    io_type = "STRING"
    multiline: bool = False
    placeholder: str | None = None

    def accepts(self, value: Any) -> bool:
        return isinstance(value, str)


@dataclass
class FloatInput(Widget):
    io_type = "FLOAT"
    min: float | None = None
    max: float | None = None
    step: float | None = None
    round: float | None = None

    def accepts(self, value: Any) -> bool:
        return isinstance(value, float | int) and self.min <= value <= self.max


@dataclass
class ComboInput(Widget):
    io_type = "COMBO"
    options: list[str] = field(default_factory=list)

    def accepts(self, value: Any) -> bool:
        return value in self.options


@dataclass
class Output:
    id: str | None = None
    display_name: str | None = None
    tooltip: str | None = None
    is_output_list: bool = False


class ImageOutput(Output):
    io_type = "IMAGE"


class StringOutput(Output):
    io_type = "STRING"


@dataclass
class Schema:
    node_id: str
    display_name: str | None = None
    category: str = "sd"
    inputs: list[Input] = field(default_factory=list)
    outputs: list[Output] = field(default_factory=list)
    description: str = ""
    is_output_node: bool = False

    def validate(self) -> None:
        ids = [one.id for one in (*self.inputs, *self.outputs)]
        if len(set(ids)) != len(ids):
            raise ValueError(f"ids must be unique between inputs and outputs: {ids}")
        for one in self.inputs:
            if isinstance(one, Widget) and one.default is not None and not one.accepts(one.default):
                raise ValueError(f"{one.id}: its own default is refused")


class ComfyNode:
    @classmethod
    def define_schema(cls) -> Schema:
        raise NotImplementedError

    @classmethod
    def execute(cls, **inputs: Any) -> NodeOutput:
        raise NotImplementedError


class NodeOutput:
    def __init__(self, *args: Any, ui: Any = None) -> None:
        self.args, self.ui = args, ui


class PreviewText:
    def __init__(self, value: str) -> None:
        self.value = value


class ComfyExtension:
    async def get_node_list(self) -> list[type[ComfyNode]]:
        raise NotImplementedError


def install(monkeypatch: Any, output: Path) -> None:
    """`comfy_api.latest` and `folder_paths`, for as long as monkeypatch lasts."""

    def get_save_image_path(prefix: str, folder: str, width: int = 0, height: int = 0) -> tuple:
        subfolder, name = os.path.split(os.path.normpath(prefix))
        full = os.path.join(folder, subfolder)
        if os.path.commonpath((folder, os.path.abspath(full))) != folder:
            raise Exception("ERROR: Saving image outside the output folder is not allowed.")
        os.makedirs(full, exist_ok=True)
        found = [re.match(re.escape(name) + r"_(\d+)_", one) for one in os.listdir(full)]
        return full, name, max((int(one[1]) for one in found if one), default=0) + 1, subfolder, prefix

    io = SimpleNamespace(
        Image=SimpleNamespace(Input=ImageInput, Output=ImageOutput),
        Mask=SimpleNamespace(Input=MaskInput),
        String=SimpleNamespace(Input=StringInput, Output=StringOutput),
        Float=SimpleNamespace(Input=FloatInput),
        Combo=SimpleNamespace(Input=ComboInput),
        Schema=Schema,
        ComfyNode=ComfyNode,
        NodeOutput=NodeOutput,
    )
    latest = ModuleType("comfy_api.latest")
    latest.io, latest.ui, latest.ComfyExtension = io, SimpleNamespace(PreviewText=PreviewText), ComfyExtension
    folder_paths = ModuleType("folder_paths")
    folder_paths.get_output_directory = lambda: str(output)
    folder_paths.get_save_image_path = get_save_image_path
    for name, module in (("comfy_api", ModuleType("comfy_api")), ("comfy_api.latest", latest)):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "folder_paths", folder_paths)
