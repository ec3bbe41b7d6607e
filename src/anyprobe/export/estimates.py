"""Light estimates as the augmented-reality interfaces name them: WebXR, ARCore, ARKit.

Code written for a phone's estimate then runs on ours. WebXR's and ARCore's SH are those without the
main light, which they give beside it; ARKit's are of all light. <name>.json has both.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import REC709_CHROMATICITIES, luminance, xyz_from_rgb
from anyprobe.export.light import ExportedLight, numbers, primary_light, write_json
from anyprobe.export.sh_layouts import planar, webxr

ARKIT_NEUTRAL = 1000.0
"""ARKit's lumens of a neutrally lit scene; our radiance 1 stands for it."""

ARKIT_WHITE_K = 6500.0
"""ARKit's colour temperature of white light [K]."""

TEMPERATURES_K = np.arange(1000.0, 15001.0, 10.0)
"""The range of Krystek's approximation of black bodies."""


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
    """<name>.estimate.json: what ARKit's ARDirectionalLightEstimate holds, 27 SH planar, of all light.

    ambientIntensity is that of a white surface averaged over all directions: mean radiance
    times 1000. ambientColorTemperature is that of the same light [K].
    """
    mean = light.sh_full[0] * np.sqrt(1 / (4 * np.pi))
    estimate = {
        "ambientIntensity": numbers(ARKIT_NEUTRAL * luminance(mean)),
        "ambientColorTemperature": correlated_temperature(mean),
        "primaryLightDirection": numbers(light.main.direction),
        "primaryLightIntensity": numbers(ARKIT_NEUTRAL * luminance(light.main.irradiance) / np.pi),
        "sphericalHarmonicsCoefficients": numbers(ARKIT_NEUTRAL * planar(light.sh_full)),
    }
    write_json(folder / f"{light.name}.estimate.json", estimate)
    return {"arkit": {"lumens_of_radiance_1": ARKIT_NEUTRAL}}


def correlated_temperature(rgb: np.ndarray) -> float:
    """Temperature [K] of the black body whose colour is nearest in CIE 1960 u, v, from 1000 to 15000.

    Black bodies by Krystek 1985. Coloured light has one too, however far from it: a green lamp some 6000 K.

    Args:
        rgb: [3] linear Rec. 709; black gives ARKit's white.
    """
    x, y, z = xyz_from_rgb(REC709_CHROMATICITIES) @ np.asarray(rgb, dtype=np.float64)
    total = x + 15.0 * y + 3.0 * z
    if total <= 0.0:
        return ARKIT_WHITE_K
    t = TEMPERATURES_K
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (
        1.0 + 8.42420235e-4 * t + 7.08145163e-7 * t**2
    )
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (
        1.0 - 2.89741816e-5 * t + 1.61456053e-7 * t**2
    )
    return float(t[np.argmin((u - 4.0 * x / total) ** 2 + (v - 6.0 * y / total) ** 2)])
