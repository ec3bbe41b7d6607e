"""anyprobe export: files for three.js, Blender, Unity and others from estimated lights."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.options import FrameOption, JsonOption, QuietOption, folder_option
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe.estimate.sidecar import export_settings, read_rotation
from anyprobe.export.exported_light import check_front
from anyprobe.export.targets import TARGETS

_MAX_PIXELS = 8192 * 4096
"""Largest map that is exported [pixels]: some targets take 90 bytes a pixel."""


def export(
    *lights: Annotated[Path, Parameter(name="LIGHT", required=True)],
    to: Annotated[
        list[str] | None,
        Parameter(metavar="TARGET[,TARGET...]", help=f"Required: any of {', '.join(TARGETS)}; or all. Repeatable."),
    ] = None,
    out: Annotated[Path, folder_option("Folder for the files; several lights get one folder each in it.")] = Path(
        "export"
    ),
    world_from_camera: Annotated[
        str | None, Parameter(metavar="YAW,ELEVATION[,ROLL]", allow_leading_hyphen=True)
    ] = None,
    frame: FrameOption = "level",
    exposure: float = 0.0,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Export lights to Blender, Unity, three.js and others.

    A .json beside each file describes its orientation.

    Args:
        lights: Maps that estimate wrote: .exr (full range) or .hdr.
        world_from_camera: Camera orientation, degrees: yaw to the left, elevation (positive looks down), roll; or a
            rotation matrix, nine numbers row by row. Default: level, see --frame.
        exposure: Exposure change in stops: 1 doubles the light.
    """
    from anyprobe.export import targets
    from anyprobe.maps.radiance import read_radiance

    names = target_names(",".join(to or []))
    rotation = read_rotation(world_from_camera)
    for light, folder in folders(lights, out):
        radiance = read_radiance(light, _MAX_PIXELS)
        check_front(light)
        settings = export_settings(light, rotation, is_level=frame == "level") | {"exposure_ev": exposure}
        for name in names:
            written, doubts = targets.write_export(radiance, name, folder, light.stem, **settings)
            if as_json:
                summary = {"light": str(light), "target": name, "files": [str(path) for path in written]}
                described = json.loads((folder / f"{light.stem}_{name}.json").read_text(encoding="utf-8"))
                summary |= {key: described[key] for key in ("clipped_energy", "warnings")}
                print(json.dumps(summary), flush=True)
            elif not quiet:
                print(f"{name}: {', '.join(str(path) for path in written)}", file=sys.stderr)
            for doubt in () if quiet else doubts:
                print(f"warning: {doubt}", file=sys.stderr)


def folders(lights: Sequence[Path], out: Path) -> list[tuple[Path, Path]]:
    """Return each light once, with the folder for its files: out, or out/<stem> if there are several.

    Raises:
        InputError: a light is missing, or two share a stem.
    """
    unique = list(dict.fromkeys(lights))
    by_stem: dict[str, Path] = {}
    for light in unique:
        if not light.exists():
            raise InputError("no such file; check the path", source=light)
        previous = by_stem.setdefault(light.stem, light)
        if previous != light:
            text = f"expected distinct file names, got {previous} before it; export them separately"
            raise InputError(text, source=light)
    return [(light, out if len(unique) == 1 else out / light.stem) for light in unique]


def target_names(text: str, option: str = "to") -> list[str]:
    """Return the targets of an option, each once; "all" stands for every one. InputError for none or an unknown one."""
    parts = [name.strip() for name in text.split(",")]
    names = list(dict.fromkeys(target for name in parts for target in (TARGETS if name == "all" else (name,))))
    for name in names:
        if name not in TARGETS:
            got = f"{name!r}{did_you_mean(name, [*TARGETS, 'all'])}" if text else "none"
            raise InputError(f"expected any of {', '.join(TARGETS)}, or all, got {got}", subject=option)
    return names
