"""What the commands let you say beside the photo: the object's normals and material, what is around it, and how the
light shall be told."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anyprobe.errors import InputError

if TYPE_CHECKING:
    from anyprobe.scatter.brdf import Material

NormalsOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|ball",
        help="The object's normals, where known: picture of (n + 1) / 2, .exr or .npy of the photo's size; +X right, "
        "+Y up, +Z to the camera; or a folder of them named like the photos; or ball, if the object is one.",
    ),
]
MaterialOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="The object's material, where known: chrome, gold, plastic or matte (albedo 0.6).",
    ),
]
AlbedoOption = Annotated[
    str | None,
    typer.Option(
        metavar="R,G,B",
        help="Its linear diffuse albedo, or one number: 0.18 for a grey card; else as --material.",
    ),
]
SurroundingsOption = Annotated[
    str | None,
    typer.Option(
        metavar="photo|FILE",
        help="What is known of the light itself: photo, if what it shows beside the object is far enough to light it; "
        "or a panorama in the camera's frame, transparent where nothing is known.",
    ),
]
LampsOption = Annotated[
    str,
    typer.Option(
        metavar="drawn|spread",
        help="drawn: lamps where they most likely are, for shadows and highlights; spread: their light over all places "
        "as likely as it is, which lights dull objects better.",
    ),
]


def read_surroundings_option(given: str | None) -> Path | str | None:
    """A path, or the word for the photo itself as it is."""
    from anyprobe.infer.surroundings import PHOTO

    return given if given is None or given == PHOTO else Path(given)


def read_normals_option(given: str | None) -> Path | str | None:
    """A path, or the word for a ball as it is."""
    from anyprobe.infer.known_normals import BALL

    return given if given is None or given == BALL else Path(given)


def read_material(name: str | None, albedo: str | None) -> Material | None:
    """The material that the options tell; None where they tell nothing."""
    from anyprobe.scatter.presets import told_material

    if albedo is None:
        return told_material(name)
    try:
        numbers = [float(part) for part in albedo.split(",")]
    except ValueError:
        raise InputError(f"--albedo: expected numbers, got {albedo!r}; for instance --albedo 0.18") from None
    return told_material(name, numbers)
