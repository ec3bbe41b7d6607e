"""Cube maps as files: six .hdr faces, one .ktx2, or one .dds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from anyprobe.export.bc6h import BC6H_MAX, encode_bc6h
from anyprobe.export.cubemap import (
    FACES,
    box_mips,
    clipped_share,
    cube_faces,
    face_size,
    to_half_rgba,
)
from anyprobe.export.dds import DXGI_BC6H_UF16, DXGI_R16G16B16A16_FLOAT, write_dds_cube
from anyprobe.export.ktx2 import write_ktx2_cube
from anyprobe.export.light import ExportedLight, template
from anyprobe.files.radiance import HALF_MAX, write_hdr_picture

ADDRESSING = {
    "order": "+X -X +Y -Y +Z -Z, row 0 first, as OpenGL, Direct3D, KTX2 and DDS address faces",
    "sample": "(-x, y, z): the direction to ask the cube for, from one in this export's frame; three.js does so",
}


def write_faces(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>_px.hdr ... <name>_nz.hdr, each the picture that is seen from inside."""
    faces = cube_faces(light.radiance, face_size(light.radiance.shape[0]))
    for face, pixels in zip(FACES, faces, strict=True):
        write_hdr_picture(folder / f"{light.name}_{face}.hdr", pixels)
    return {"cube": {**ADDRESSING, "size": faces.shape[1], "mips": 1}}


def write_ktx2(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.ktx2, half floats with all mips, and <name>.js, which gives it to three.js as a cube."""
    levels = _levels(light)
    write_ktx2_cube(folder / f"{light.name}.ktx2", [to_half_rgba(level, HALF_MAX) for level in levels])
    (folder / f"{light.name}.js").write_text(template("ktx2.js", light), encoding="utf-8")
    return _cube(levels, clipped_share(levels[0], HALF_MAX))


def write_dds(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.dds, half floats, <name>_bc6h.dds, an eighth of its size, and <name>.js for three.js.

    Both have all mips. three.js r187's DDSLoader reads the compressed one only.
    """
    levels = _levels(light)
    halfs = [to_half_rgba(level, HALF_MAX) for level in levels]
    write_dds_cube(folder / f"{light.name}.dds", halfs[0].shape[1], halfs, DXGI_R16G16B16A16_FLOAT)
    blocks = [encode_bc6h(level) for level in levels]
    write_dds_cube(folder / f"{light.name}_bc6h.dds", halfs[0].shape[1], blocks, DXGI_BC6H_UF16)
    (folder / f"{light.name}.js").write_text(template("dds.js", light), encoding="utf-8")
    return _cube(levels, clipped_share(levels[0], min(HALF_MAX, BC6H_MAX)))


def _levels(light: ExportedLight) -> list:
    return box_mips(cube_faces(light.radiance, face_size(light.radiance.shape[0])))


def _cube(levels: list, clipped: float) -> dict[str, Any]:
    return {
        "clipped_energy": clipped,
        "cube": {**ADDRESSING, "size": levels[0].shape[1], "mips": len(levels), "filter": "box"},
    }
