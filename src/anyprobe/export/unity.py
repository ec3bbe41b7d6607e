"""Unity: two .hdr maps for Skybox/Panoramic, SH for RenderSettings, and a component that sets both."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.export.frames import UNITY
from anyprobe.export.light import ExportedLight, numbers, template, write_maps
from anyprobe.export.sh_layouts import unity


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.hdr, <name>_ambient.hdr and AnyprobeLight.cs, which reads the sidecar.

    Unity's Lambert has no 1 / pi: its light's intensity is irradiance / pi, linear. The component's file
    is the same for every light, because Unity wants a class named as its file.
    """
    write_maps(light, folder, UNITY, ".hdr")
    (folder / "AnyprobeLight.cs").write_text(template("AnyprobeLight.cs", light), encoding="utf-8")
    return {
        "unity": {
            "sh_full": numbers(unity(light.sh_full).ravel()),
            "sh_ambient": numbers(unity(light.sh_ambient).ravel()),
            "light_direction": numbers(UNITY.from_ours(light.main.direction)),
            "light_color": numbers(light.main.color),
            "light_intensity": numbers(light.main.irradiance.max() / np.pi),
        }
    }
