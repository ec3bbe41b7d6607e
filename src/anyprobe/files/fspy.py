"""Camera found by fSpy: field of view, pitch and roll, from a .fspy or the .json that fSpy exports.

fSpy's world is Z up, as Blender's; its camera looks along -Z with +Y up in the picture, as ours.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

from anyprobe.core.frames import is_rotation
from anyprobe.errors import InputError
from anyprobe.files.paths import open_regular

MAGIC = b"fspy"
HEAD = struct.Struct("<4sIII")
"""Magic, version, and sizes [bytes] of the project's JSON and of its picture."""
VERSION = 1
MOST_BYTES = 1 << 22
"""Largest JSON part [bytes]."""


def read_fspy(path: str | Path) -> dict[str, float]:
    """Read the camera of a .fspy or of fSpy's exported .json, as the hints fov_deg, pitch_deg and roll_deg.

    Raises:
        InputError: the file is absent, of another kind, or without a solved camera.
    """
    path = Path(path)
    name, wanted = path.name, "expected a .fspy, or the .json that fSpy exports"
    with open_regular(path, InputError, "a .fspy, or the .json that fSpy exports") as stream:
        head = stream.read(HEAD.size)
        if head.startswith(MAGIC):
            if len(head) < HEAD.size or HEAD.unpack(head)[1] != VERSION or HEAD.unpack(head)[2] > MOST_BYTES:
                raise InputError(f"{wanted}, got a damaged one or another version; save it with fSpy 1.0", source=name)
            text = stream.read(HEAD.unpack(head)[2])
        else:
            text = head + stream.read(MOST_BYTES)
    try:
        project = json.loads(text)
        camera = project.get("cameraParameters", project)
        if camera is None:
            unsolved = "expected a solved camera, got none; set fSpy's vanishing points, then save"
            raise InputError(unsolved, source=name)
        rows = np.array(camera["cameraTransform"]["rows"], np.float64)[:3, :3]
        fov = np.degrees(max(float(camera["horizontalFieldOfView"]), float(camera["verticalFieldOfView"])))
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError) as error:
        raise InputError(f"{wanted}, got something else; check the file", source=name) from error
    if not (is_rotation(rows) and 1 < fov < 170):
        raise InputError(f"{wanted}, got an impossible camera; solve it again in fSpy", source=name)
    up = rows.T @ (0.0, 0.0, 1.0)
    return {
        "fov_deg": float(fov),
        "pitch_deg": float(np.degrees(np.arcsin(np.clip(up[2], -1.0, 1.0)))),
        "roll_deg": float(np.degrees(np.arctan2(up[0], up[1]))),
    }
