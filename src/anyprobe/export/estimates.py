"""Light estimates as the augmented-reality interfaces name them: WebXR, ARCore, ARKit.

Code written for a phone's estimate then runs on ours. The SH are those without the main light,
which these interfaces give beside it; <name>.json has the full ones too.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.export.light import ExportedLight, numbers, primary_light, write_json
from anyprobe.export.sh_layouts import planar, webxr

ARKIT_NEUTRAL = 1000.0
"""ARKit's lumens of a neutrally lit scene; our radiance 1 stands for it."""


def write_webxr(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.estimate.json: the three attributes of an XRLightEstimate, in the probe's space."""
    estimate = {
        **primary_light(light),
        "sphericalHarmonicsCoefficients": numbers(webxr(light.sh_ambient)),
    }
    write_json(folder / f"{light.name}.estimate.json", estimate)
    return {}


def write_arcore(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.estimate.json: what ARCore's LightEstimate returns in its Environmental HDR mode.

    SH by WebXR's definition, to which ARCore's Unity SDK agrees; ARCore's samples in C and
    Kotlin turn the signs of x and y round when they read them.
    """
    estimate = {
        "environmentalHdrMainLightDirection": numbers(light.main.direction),
        "environmentalHdrMainLightIntensity": numbers(light.main.irradiance),
        "environmentalHdrAmbientSphericalHarmonics": numbers(webxr(light.sh_ambient)),
    }
    write_json(folder / f"{light.name}.estimate.json", estimate)
    return {}


def write_arkit(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.estimate.json: what ARKit's ARDirectionalLightEstimate holds, 27 SH planar.

    ambientIntensity is that of a white surface averaged over all directions: mean radiance
    times 1000.
    """
    mean = light.sh_full[0] * np.sqrt(1 / (4 * np.pi))
    estimate = {
        "ambientIntensity": numbers(ARKIT_NEUTRAL * luminance(mean)),
        "primaryLightDirection": numbers(light.main.direction),
        "primaryLightIntensity": numbers(ARKIT_NEUTRAL * luminance(light.main.irradiance) / np.pi),
        "sphericalHarmonicsCoefficients": numbers(ARKIT_NEUTRAL * planar(light.sh_ambient)),
    }
    write_json(folder / f"{light.name}.estimate.json", estimate)
    return {"arkit": {"lumens_of_radiance_1": ARKIT_NEUTRAL}}
