"""Mitsuba 3: the map as an .exr and a scene.xml with three spheres under it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
import OpenEXR

from anyprobe.core.color import REC709_CHROMATICITIES
from anyprobe.errors import OutputError
from anyprobe.export.exported_light import SCALE, ExportedLight
from anyprobe.export.target_frames import OPENEXR
from anyprobe.files.paths import utf8_path

if TYPE_CHECKING:
    from jaxtyping import Float

SCENE = """<!-- mitsuba {name}.xml; the emitter is all that other scenes need -->
<scene version="3.0.0">
  <default name="spp" value="64"/>
  <integrator type="path">
    <integer name="max_depth" value="6"/>
  </integrator>
  <emitter type="envmap" id="light">
    <string name="filename" value={map}/>
  </emitter>
  <sensor type="perspective">
    <float name="fov" value="26"/>
    <string name="fov_axis" value="y"/>
    <transform name="to_world">
      <lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="480"/>
      <integer name="height" value="180"/>
      <string name="pixel_format" value="rgb"/>
    </film>
    <sampler type="multijitter">
      <integer name="sample_count" value="$spp"/>
    </sampler>
  </sensor>
  <shape type="sphere">
    <point name="center" x="-2.3" y="0" z="0"/>
    <bsdf type="diffuse">
      <rgb name="reflectance" value="1, 1, 1"/>
    </bsdf>
  </shape>
  <shape type="sphere">
    <bsdf type="roughconductor">
      <string name="material" value="none"/>
      <float name="alpha" value="0.16"/>
      <rgb name="specular_reflectance" value="0.8, 0.8, 0.8"/>
    </bsdf>
  </shape>
  <shape type="sphere">
    <point name="center" x="2.3" y="0" z="0"/>
    <bsdf type="conductor">
      <string name="material" value="none"/>
    </bsdf>
  </shape>
</scene>
"""


def pole_to_pole(radiance: Float[np.ndarray, "H 2*H 3"]) -> Float[np.ndarray, "H 2*H 3"]:
    """The map [H, 2H, 3] in 2H + 1 rows that lie at i / 2H, first and last on the poles.

    Mitsuba's rows lie at i / (rows - 1), ours at (i + 0.5) / H. Read between ours and held
    beyond the first and last, 2H + 1 rows are the same bilinear function.
    """
    height = radiance.shape[0]
    rows = np.clip(np.arange(2 * height + 1) / 2.0 - 0.5, 0, height - 1)
    low, high = np.floor(rows).astype(int), np.ceil(rows).astype(int)
    return (radiance[low] + radiance[high]) / 2.0


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.exr, 32-bit floats, and <name>.xml. A path tracer finds the dominant light in the map."""
    pixels = pole_to_pole(OPENEXR.roll(light.radiance)).astype(np.float32)
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": REC709_CHROMATICITIES,
        "anyprobe:scale": SCALE,
        "anyprobe:rows": "pole to pole, as Mitsuba 3 reads them: v = row / (rows - 1)",
    }
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate("RGB")}
    path = folder / f"{light.name}.exr"
    try:
        with utf8_path(path) as plain:
            OpenEXR.File(header, channels).write(plain)
    except RuntimeError as error:  # its only report of a full disk
        raise OutputError(f"{path}: cannot be written ({' '.join(str(error).split())})") from error
    scene = SCENE.replace("{name}", light.name.replace("--", "__")).replace("{map}", quoteattr(path.name))
    (folder / f"{light.name}.xml").write_text(scene, encoding="utf-8")
    return {"rows": "pole to pole: v = row / (rows - 1)", "to_world": "none: the roll is in the file"}
