"""USD: a .usda with a DomeLight and a DistantLight, two .exr maps, and all of it as one .usdz.

Written as text, so that nothing need be installed.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anyprobe.export.exported_light import ExportedLight, numbers, write_maps
from anyprobe.export.target_frames import OPENEXR

if TYPE_CHECKING:
    from jaxtyping import Float

STAGE = """#usda 1.0
(
    defaultPrim = "Light"
    doc = "Linear Rec. 709 radiance, relative scale. Front is -Z, up is +Y."
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "Light" (
    variants = {{
        string mainLight = "separate"
    }}
    prepend variantSets = "mainLight"
)
{{
    def DomeLight "Dome"
    {{
        float inputs:intensity = 1
        token inputs:texture:format = "latlong"
    }}

    variantSet "mainLight" = {{
        "separate" (
            doc = "The dome without the dominant light, and the dominant light as a DistantLight."
        ) {{
            over "Dome"
            {{
                asset inputs:texture:file = {ambient}
            }}

            def DistantLight "Main"
            {{
                float inputs:angle = {angle}
                color3f inputs:color = ({r}, {g}, {b})
                float inputs:intensity = {intensity}
                bool inputs:normalize = true
                matrix4d xformOp:transform = ( {matrix} )
                uniform token[] xformOpOrder = ["xformOp:transform"]
            }}
        }}
        "inTheDome" (
            doc = "Everything in the dome."
        ) {{
            over "Dome"
            {{
                asset inputs:texture:file = {full}
            }}
        }}
    }}
}}
"""

USDZ_ALIGNMENT = 64
"""Every file in a .usdz begins at a multiple of this, stored as it is."""


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.usda, <name>.exr, <name>_ambient.exr and <name>.usdz.

    The maps lie as OpenEXR and DomeLight have them, so that no rotation is needed. With normalize
    a DistantLight's intensity is the irradiance of a plane that faces it, as ours is.
    """
    write_maps(light, folder, OPENEXR, ".exr")
    r, g, b = numbers(light.main.color)
    stage = STAGE.format(
        ambient=asset_path(f"./{light.name}_ambient.exr"),
        full=asset_path(f"./{light.name}.exr"),
        angle=round(light.main_angle_deg, 4),
        r=r,
        g=g,
        b=b,
        intensity=numbers(light.main.irradiance.max()),
        matrix=", ".join(f"({', '.join(map(str, row))})" for row in pointing_away(light.main.direction)),
    )
    path = folder / f"{light.name}.usda"
    path.write_text(stage, encoding="utf-8")
    maps = [folder / f"{light.name}_ambient.exr", folder / f"{light.name}.exr"]
    pack_usdz(folder / f"{light.name}.usdz", [path, *maps])
    return {"usd": {"dome_light_pole": "+Y", "dominant_light_prim": "/Light/Main"}}


def pointing_away(towards: Float[np.ndarray, " 3"]) -> list[list[float]]:
    """Rows of USD's matrix (row vectors) that turns -Z, where a DistantLight shines, from a light at [3]."""
    z = np.asarray(towards, dtype=np.float64)
    z /= np.linalg.norm(z)
    up = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = x, np.cross(z, x), z
    return [[round(float(v), 9) + 0.0 for v in row] for row in matrix]


def asset_path(path: str) -> str:
    """An asset's path between its delimiters; three where the path itself has one."""
    return f"@@@{path}@@@" if "@" in path else f"@{path}@"


def pack_usdz(path: Path, files: list[Path]) -> None:
    """A .usdz: a zip of stored files, the stage first, each at a multiple of 64 bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for file in files:
            entry = zipfile.ZipInfo(file.name, date_time=(1980, 1, 1, 0, 0, 0))
            start = archive.fp.tell() + 30 + len(file.name.encode()) + 4  # local header, name, field header
            padding = -start % USDZ_ALIGNMENT
            entry.extra = b"\x86\x19" + padding.to_bytes(2, "little") + b"\0" * padding
            archive.writestr(entry, file.read_bytes())
