"""The nodes. IMAGE is a torch tensor [B, H, W, C] of floats, MASK [B, H, W]; the library has NumPy arrays.

A map is an IMAGE too, [B, H, 2H, 3] linear in the photo's exposure units, so that values exceed 1.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from comfy_api.latest import ComfyExtension, io, ui

import anyprobe
from anyprobe.core.response import response
from anyprobe.estimate.ground import Ground
from anyprobe.files.atomic import atomic_path
from anyprobe.files.objects import OBJECTS
from anyprobe.inputs.hints import AUTO, HINTS, NONE, PHOTO
from anyprobe.inputs.settings import SETTINGS
from anyprobe.light.environment import check_radiance
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.notices import Words
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import PHOTO_MATERIAL, Arrangement, Stage
from anyprobe.render.spheres import sphere_images
from anyprobe.scatter.materials import MATERIALS

CATEGORY = "image/light"
UNKNOWN = "unknown"
"""In place of a material's name."""
FORMATS = ("exr", "hdr")
SPHERE = 256
"""Side of each sphere of the preview [px]."""
LOG = logging.getLogger(__name__)


def place_inputs() -> list[Any]:
    """What says where the object is, and how the camera stood."""
    return [
        io.Mask.Input("mask", optional=True, tooltip=HINTS["mask"].help),
        hint_input("click", "several with ; between. Blank: the mask network finds it"),
        hint_input("box"),
        hint_input("fov_deg"),
        hint_input("pitch_deg", "Blank: unknown"),
        choice("material", [UNKNOWN, *MATERIALS]),
        choice("surroundings", [AUTO, PHOTO, NONE]),
    ]


def text_input(name: str, tooltip: str) -> Any:
    return io.String.Input(name, optional=True, default="", tooltip=tooltip)


def hint_input(keyword: str, more: str = "") -> Any:
    """Return a text for a hint, described as at every other door."""
    hint = HINTS[keyword]
    form = f" {hint.metavar}" if hint.metavar else ""
    tooltip = f"{hint.help}{form}{f'; {more}' if more else ''}"
    return io.String.Input(hint.name, optional=True, default="", tooltip=tooltip)


def choice(keyword: str, options: Sequence[str]) -> Any:
    """Return the choices of a hint or a setting."""
    tooltip = {**HINTS, **SETTINGS}[keyword].help
    return io.Combo.Input(keyword, options=list(options), optional=True, default=options[0], tooltip=tooltip)


class LightFromPhoto(io.ComfyNode):
    """The light around the object of each photo."""

    @classmethod
    def define_schema(cls) -> io.Schema:
        return io.Schema(
            node_id="AnyprobeLightFromPhoto",
            display_name="Light from photo",
            category=CATEGORY,
            description="Estimates the HDR light around an object of one material in a photo.",
            inputs=[io.Image.Input("photo"), *place_inputs()],
            outputs=[
                io.Image.Output("hdri", display_name="hdri", tooltip="64 x 128, linear; front in the centre."),
                io.Image.Output("spheres", display_name="spheres", tooltip="A matte, a silver and a mirror sphere."),
                io.String.Output("light", display_name="light", tooltip="JSON: dominant light, harmonics, warnings."),
            ],
        )

    @classmethod
    def execute(cls, photo: torch.Tensor, mask: torch.Tensor | None = None, **given: Any) -> io.NodeOutput:
        with library_errors():
            lights = [anyprobe.estimate(one) for one in photos_of(photo, mask, given)]
        said = [light.sidecar() for light in lights]
        return io.NodeOutput(
            image_of([light.radiance for light in lights]),
            image_of([spheres_under(light.radiance) for light in lights]),
            json.dumps(said[0] if len(said) == 1 else said, indent=1),
            ui=warnings_of([line for light in lights for line in light.warnings]),
        )


class Relight(io.ComfyNode):
    """A virtual object beside the real one of each photo."""

    @classmethod
    def define_schema(cls) -> io.Schema:
        return io.Schema(
            node_id="AnyprobeRelight",
            display_name="Insert lit object",
            category=CATEGORY,
            description="Inserts a virtual object with its shadow beside the photo's object, lit by a map.",
            inputs=[
                io.Image.Input("photo"),
                io.Image.Input("hdri", optional=True, tooltip="Without it the light is estimated from the photo."),
                io.Combo.Input("shape", options=list(OBJECTS), default="sphere"),
                io.Combo.Input(
                    "shape_material",
                    options=[PHOTO_MATERIAL, *MATERIALS],
                    default="chrome",
                    tooltip="photo: the real object's own.",
                ),
                io.Float.Input("size", default=0.5, min=0.02, max=20.0, step=0.01, tooltip="Over the real object's."),
                text_input("at", "x,y of its foot in pixels. Blank: beside the real object."),
                *place_inputs(),
            ],
            outputs=[io.Image.Output("picture", display_name="picture")],
        )

    @classmethod
    def execute(
        cls,
        photo: torch.Tensor,
        shape: str,
        shape_material: str,
        size: float,
        at: str = "",
        hdri: torch.Tensor | None = None,
        mask: torch.Tensor | None = None,
        **given: Any,
    ) -> io.NodeOutput:
        pictures, warnings = [], []
        with library_errors():
            foot = None if not at.strip() else numbers_of("at", at, "click")
            photos = photos_of(photo, mask, given)
            maps = [None] * len(photos) if hdri is None else one_each(arrays_of(hdri), len(photos), "hdri")
            for one, found in zip(photos, maps, strict=True):
                radiance, said, ground = estimated(one)
                if found is not None:
                    radiance, said = check_radiance(found, "hdri"), one.warnings
                toward = find_dominant_light(radiance).direction
                place = Arrangement(size=size, at=foot, ground=ground, toward_light=toward)
                stage = Stage(one, OBJECTS[shape](), place)
                pictures.append(stage.relit(radiance, shape_material))
                warnings += [*said, *stage.warnings]
        return io.NodeOutput(image_of(pictures), ui=warnings_of(warnings))


class SaveHDRI(io.ComfyNode):
    """Maps as files of ComfyUI's output folder."""

    @classmethod
    def define_schema(cls) -> io.Schema:
        return io.Schema(
            node_id="AnyprobeSaveHDRI",
            display_name="Save HDRI",
            category=CATEGORY,
            description="Writes a map as .exr or .hdr, and its light beside it as .json, into the output folder.",
            inputs=[
                io.Image.Input("hdri"),
                io.String.Input("light", optional=True, force_input=True, tooltip="JSON of Light from photo."),
                io.String.Input("filename_prefix", default="light/photo"),
                io.Combo.Input("format", options=list(FORMATS), default=FORMATS[0]),
            ],
            outputs=[],
            is_output_node=True,
        )

    @classmethod
    def execute(cls, hdri: torch.Tensor, filename_prefix: str, format: str, light: str | None = None) -> io.NodeOutput:
        import folder_paths

        maps = arrays_of(hdri)
        with library_errors():
            lights = [anyprobe.Light(radiance=one) for one in maps]
        sidecars = sidecars_of(light, len(maps))
        folder, name, counter, subfolder, _ = folder_paths.get_save_image_path(
            filename_prefix, folder_paths.get_output_directory(), maps[0].shape[1], maps[0].shape[0]
        )
        written = []
        for index, (one, sidecar) in enumerate(zip(lights, sidecars, strict=True)):
            path = Path(folder) / f"{name.replace('%batch_num%', str(index))}_{counter + index:05}_.{format}"
            with library_errors():
                one.save(path)
            if sidecar is not None:
                with library_errors(), atomic_path(path.with_suffix(".json")) as temporary:
                    temporary.write_text(json.dumps(sidecar, indent=1) + "\n", encoding="utf-8")
            written.append(str(Path(subfolder) / path.name))
        return io.NodeOutput(ui=ui.PreviewText("\n".join(written)))


def photos_of(photo: torch.Tensor, mask: torch.Tensor | None, given: dict[str, Any]) -> list[anyprobe.Photo]:
    """An IMAGE's photos with their object found; given: the texts and words of place_inputs, blank where unknown."""
    images = [settled(one) for one in arrays_of(photo)]
    masks: list[np.ndarray | None] = [None] * len(images)
    if mask is not None:
        masks = one_each(
            [settled(one) for one in arrays_of(mask if mask.ndim == 3 else mask[None])], len(images), "mask"
        )
        if not all(one.any() for one in masks):
            raise ValueError(
                "mask: expected white on the object, got an empty one, as Load Image gives for photos without; "
                "draw it in the mask editor, or unplug it"
            )
    hints: dict[str, Any] = {"surroundings": given.get("surroundings", AUTO)}
    if given.get("material", UNKNOWN) != UNKNOWN:
        hints["material"] = given["material"]
    clicks = [numbers_of("click", one, "click") for one in given.get("click", "").split(";") if one.strip()]
    if clicks:
        hints["click"] = clicks
    for name, field in (("box", "box"), ("fov", "fov_deg"), ("pitch", "pitch_deg")):
        if given.get(name, "").strip():
            hints[field] = numbers_of(name, given[name], field)
    names = ["photo"] if len(images) == 1 else [f"photo {index + 1}" for index in range(len(images))]
    return [
        anyprobe.load_photo(image, name=name, **hints, **({} if one is None else {"mask": one}))
        for image, one, name in zip(images, masks, names, strict=True)
    ]


def numbers_of(name: str, text: str, field: str) -> Any:
    """A text's numbers as the hint of that field has them; InputError, which begins with the input's name."""
    try:
        return HINTS[field].read(text)
    except anyprobe.InputError as error:
        raise anyprobe.InputError(f"{name}: {str(error).partition(': ')[2]}") from error


def estimated(photo: anyprobe.Photo) -> tuple[np.ndarray, tuple[str, ...], Ground | None]:
    """The map of a photo, as bright as its object asks where its material is not given; the warnings; the ground."""
    light = anyprobe.estimate(photo)
    gain = 1.0 if photo.material is not None else least_scale(photo, light.radiance)
    return light.radiance * np.float32(gain), light.warnings, light.ground


def sidecars_of(light: str | None, count: int) -> list[dict[str, Any] | None]:
    """The JSON of Light from photo, an object or one for each of several maps; ValueError for another text."""
    if light is None or not light.strip():
        return [None] * count
    try:
        found = json.loads(light)
    except ValueError as error:
        raise ValueError(f"light: expected the JSON of Light from photo, got no JSON ({error})") from error
    found = found if isinstance(found, list) else [found]
    if len(found) != count or not all(isinstance(one, dict) for one in found):
        raise ValueError(f"light: expected the JSON of {count} maps, got that of {len(found)}; connect the same node")
    return found


def arrays_of(tensor: torch.Tensor) -> list[np.ndarray]:
    """An IMAGE [B, H, W, C] or MASK [B, H, W] as arrays of floats."""
    return list(tensor.detach().cpu().float().numpy())


OVERSHOOT = 0.2
"""By so much sharp resampling may leave the range of a picture."""


def settled(pixels: np.ndarray) -> np.ndarray:
    """Without what a sharp resize puts a little below 0 and above 1."""
    return pixels.clip(0.0, 1.0) if -OVERSHOOT < pixels.min() and pixels.max() < 1 + OVERSHOOT else pixels


def image_of(arrays: list[np.ndarray]) -> torch.Tensor:
    """Arrays of one shape as an IMAGE."""
    return torch.from_numpy(np.stack(arrays).astype(np.float32))


def one_each(arrays: list[np.ndarray], count: int, name: str) -> list[np.ndarray]:
    """As many as photos; one serves for all."""
    if len(arrays) not in (1, count):
        raise ValueError(f"{name}: expected one, or one for each of {count} photos, got {len(arrays)}")
    return arrays if len(arrays) == count else arrays * count


def spheres_under(radiance: np.ndarray) -> np.ndarray:
    """Display picture [S, 3 S, 3]: matte, silver and mirror, at one exposure at which the matte one does not clip."""
    spheres = sphere_images(radiance, SPHERE)
    ev = min(0.0, math.floor(-2 * math.log2(max(spheres["diffuse"].max(), 1e-6))) / 2)
    return np.concatenate([response(one * 2.0**ev) for one in spheres.values()], axis=1)


def warnings_of(lines: list[str]) -> Any:
    """Lines under the node and in ComfyUI's log."""
    for line in lines:
        LOG.warning("%s", INPUTS.line(line))
    return ui.PreviewText("\n".join(map(INPUTS.line, lines))) if lines else None


class InputWords(Words):
    """Arguments as inputs of the nodes."""

    verb = "connect or set"

    def name(self, argument: str) -> str:
        return HINTS[argument].name if argument in HINTS else argument

    def giving(self, argument: str, value: str) -> str:
        return f"{self.name(argument)} {value}".strip()


INPUTS = InputWords()


@contextmanager
def library_errors() -> Iterator[None]:
    """The library's line, with the inputs' names, as a ValueError, which ComfyUI shows at the node."""
    try:
        yield
    except anyprobe.AnyprobeError as error:
        raise ValueError(INPUTS.line(error.notice)) from error


class AnyprobeExtension(ComfyExtension):
    async def get_node_list(self) -> list[type[io.ComfyNode]]:
        return [LightFromPhoto, Relight, SaveHDRI]


async def comfy_entrypoint() -> AnyprobeExtension:
    return AnyprobeExtension()
