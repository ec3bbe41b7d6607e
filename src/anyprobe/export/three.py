"""three.js: two .hdr maps, a module that lights a scene with them, and a page that shows it."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from anyprobe.export.frames import THREE
from anyprobe.export.light import ExportedLight, template, write_maps


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.hdr, <name>_ambient.hdr, <name>.js and <name>.html.

    The maps are rolled, so that they stand right without environmentRotation. DirectionalLight's
    intensity is the irradiance of a plane that faces it, as ours is.
    """
    write_maps(light, folder, THREE, ".hdr")
    (folder / f"{light.name}.js").write_text(template("three.js", light), encoding="utf-8")
    page = template("three.html", light).replace("@TITLE@", escape(light.name))
    (folder / f"{light.name}.html").write_text(page, encoding="utf-8")
    return {
        "half_float": "HDRLoader makes halfs of .hdr: what is above 65504 is clamped there",
    }
