"""Nine SH coefficients of radiance, as each consumer wants them.

Ours are those of WebXR and three.js (anyprobe.light.harmonics): L_i = integral of L Y_i dw, no
Condon-Shortley sign, [9, 3]. Consumers differ in three ways: what is multiplied in, the
handedness, and whether coefficients or channels come first.
"""

from __future__ import annotations

import numpy as np

from anyprobe.light.harmonics import COSINE_LOBE, K

ODD_IN_Z = (2, 5, 7)
"""z, yz and xz: they change sign when z does."""

ODD_IN_Y = (1, 4, 5)
"""y, xy and yz."""


def webxr(coefficients: np.ndarray) -> np.ndarray:
    """Radiance, coefficient after coefficient: [9, 3] -> [27] r0 g0 b0 r1 ...

    XRLightEstimate.sphericalHarmonicsCoefficients, three.js LightProbe.sh.fromArray, and ARCore's
    AmbientSphericalHarmonics as its Unity SDK reads them.
    """
    return coefficients.reshape(27)


def planar(coefficients: np.ndarray) -> np.ndarray:
    """Radiance, channel after channel: [9, 3] -> [27] r0 r1 ... r8 g0 ... (ARKit)."""
    return coefficients.T.reshape(27)


def irradiance(coefficients: np.ndarray) -> np.ndarray:
    """A_l L_i: E(n) = sum of these times Y_i(n), [9, 3]."""
    return coefficients * COSINE_LOBE[:, None]


def gltf(coefficients: np.ndarray) -> np.ndarray:
    """irradiance() with the signs of EXT_lights_image_based as Babylon.js reads them, [9, 3].

    It asks for (-x, y, z) with the signs of Condon and Shortley, which is ours with y turned round.
    """
    turned = irradiance(coefficients)
    turned[list(ODD_IN_Y)] *= -1
    return turned


def polynomial(coefficients: np.ndarray) -> np.ndarray:
    """A_l K_i L_i / pi: E(n) / pi = c0 + c1 y + c2 z + c3 x + c4 xy + ..., [9, 3].

    The polynomials are those of anyprobe.light.harmonics, 3z^2 - 1 and x^2 - y^2 among them.
    Uniform radiance 1 gives c0 = 1 (Filament's IndirectLight.irradiance(3, sh)).
    """
    return coefficients * (COSINE_LOBE * K / np.pi)[:, None]


def unity(coefficients: np.ndarray) -> np.ndarray:
    """SphericalHarmonicsL2[channel, i]: polynomial() with z turned round, [3, 9]."""
    turned = polynomial(coefficients)
    turned[list(ODD_IN_Z)] *= -1
    return turned.T
