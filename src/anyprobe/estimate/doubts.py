"""Warnings about doubtful estimates: one line each, with what to do."""

from __future__ import annotations

import numpy as np

from anyprobe.core import Float
from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.response import CLIPPED, inverse_response
from anyprobe.estimate.ground import (
    ESTIMATED,
    GIVEN_ERROR_DEG,
    USUAL_ERROR_DEG,
    USUAL_PITCH_DEG,
    Ground,
    pitch_words,
    up_of,
)
from anyprobe.light.harmonics import directionality, project
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.notices import Notice, give

_EXPOSURE: dict[str, float] = contract("exposure")["doubt"]
DARK, DARK_SHARE, _CLIPPED_SHARE = (_EXPOSURE[name] for name in ("dark", "dark_share", "clipped_share"))
"""Luminance of a dark pixel, and shares of the object's dark and of its clipped pixels that cause a warning."""
_MIDDLE = 0.4
"""Radiance that the median should have if it is too bright."""
_WHITE_SHARE = 0.6
"""Share of a photo's pixels above white at which a warning is given."""
_SAMPLES = 256
"""Pixels along a photo's longer side that are sampled."""
BELOW_DEG = 12.0
"""Angle [degrees] below the horizon, beyond the pitch's error, from which light hardly ever comes."""
UNSURE_DEG: float = contract("ground")["unsure_deg"]
"""Error of an estimated pitch at which a warning is given; that of a blind guess is USUAL_ERROR_DEG."""
DIRECTIONAL = 0.25
"""Smallest directionality at which the light's direction matters."""


COLORED = 2.5
"""Largest over smallest channel of an object's mean radiance above which it is coloured: tinted light gives grey ones
less."""
_FAINT = 0.005
"""Radiance below which a channel is noise."""


def scale_doubts(radiance: Float[np.ndarray, "H W 3"] | None, name: str) -> tuple[Notice, ...]:
    """Warn of a photo of linear radiance that is mostly above white: its unit may be another."""
    if radiance is None:
        return ()
    step = max(1, max(radiance.shape[:2]) // _SAMPLES)
    levels = luminance(radiance[::step, ::step])
    white = float((levels > 1).mean())
    if white < _WHITE_SHARE:
        return ()
    times = _MIDDLE / float(np.median(levels))
    text = f"{white:.0%} of the photo is above 1, which is white; multiply its radiance by {times:.2g}"
    return (Notice(text, code="above-white", source=name),)


def all_around_doubts(radiance: Float[np.ndarray, "H W 3"] | None, name: str) -> tuple[Notice, ...]:
    """Warn of linear radiance that is twice as wide as high, as environment maps are."""
    if radiance is None or radiance.shape[1] != 2 * radiance.shape[0]:
        return ()
    text = (
        "looks like an environment map, which shows all around, rather than a photo of an object; anyprobe export and "
        "relight --light take such a map, and anyprobe match a folder of them; if it is a photo, mark the object"
    )
    return (Notice(text, code="environment-map", source=name, remedy=give("box", "click", "mask")),)


def exposure_doubts(
    rgb: Float[np.ndarray, "N 3"], name: str, radiance: Float[np.ndarray, "N 3"] | None = None
) -> tuple[Notice, ...]:
    """Warn of an object's pixels [N, 3] that are mostly black or largely clipped; radiance: theirs, if known."""
    dark = float((luminance(rgb) <= DARK).mean())
    if dark >= DARK_SHARE:
        advice = "expose longer; if it is an .exr, multiply its values"
        text = f"{dark:.0%} of the object is nearly black; little can be estimated from it; {advice}"
        return (Notice(text, code="object-dark", source=name),)
    clipped = float(np.logical_and.reduce((rgb >= CLIPPED).T).mean())
    if clipped < _CLIPPED_SHARE:
        return ()
    advice = "expose shorter"
    if radiance is not None:
        advice = f"multiply its radiance by {_MIDDLE / np.median(luminance(radiance)):.2g}, so that white is 1"
    text = f"{clipped:.0%} of the object is clipped; where its light comes from is uncertain; {advice}"
    return (Notice(text, code="object-clipped", source=name),)


def grey_doubts(rgb: Float[np.ndarray, "N 3"], name: str) -> tuple[Notice, ...]:
    """Warn of an object's display pixels [N, 3] that are clearly coloured, where its albedo was given as grey."""
    mean = inverse_response(rgb).mean(axis=0)
    if mean.max() < COLORED * max(float(mean.min()), _FAINT):
        return ()
    text = "the object is coloured, but one number of albedo means grey, so its colour is taken for the light's"
    return (Notice(text, code="albedo-grey", source=name, remedy=give(albedo="R,G,B")),)


def backdrop_doubts(name: str) -> tuple[Notice, ...]:
    """Warn of a background that the networks do not take for the object's place: a studio's, a picture's."""
    text = "the background does not look like the object's surroundings, and is not used; if it is, ask for it"
    return (Notice(text, code="plain-backdrop", source=name, remedy=give(surroundings="photo")),)


def ground_doubts(ground: Ground | None, name: str) -> tuple[Notice, ...]:
    """Warn of a guessed pitch that the object's place contradicts, and of a badly estimated one."""
    if ground is not None and ground.source == ESTIMATED and ground.pitch_error_deg > UNSURE_DEG:
        text = f"the camera seems to look {pitch_words(ground.pitch_deg)}, give or take {ground.pitch_error_deg:.0f}"
        return (Notice(text, code="pitch-unsure", source=name, remedy=give("pitch_deg")),)
    if ground is None or not ground.is_doubtful:
        return ()
    text = (
        "the ground was guessed from how high the object stands in the photo: a camera that looks "
        f"{pitch_words(ground.pitch_deg)}"
    )
    return (Notice(text, code="ground-guessed", source=name, remedy=give("pitch_deg")),)


def light_doubts(
    radiance: Float[np.ndarray, "H 2*H 3"], ground: Ground | None, pitch_deg: float | None, name: str
) -> tuple[Notice, ...]:
    """Warn of a dominant light from below the horizon, in the camera's frame.

    ground: None for a cut-out, for which pitch_deg may be given.
    """
    if ground is not None:
        up, error = ground.up, ground.pitch_error_deg
    else:
        up = up_of(USUAL_PITCH_DEG if pitch_deg is None else pitch_deg)
        error = USUAL_ERROR_DEG if pitch_deg is None else GIVEN_ERROR_DEG
    main = find_dominant_light(radiance)
    below = -float(np.degrees(np.arcsin(np.clip(main.direction @ up, -1.0, 1.0))))
    if below < BELOW_DEG + error or directionality(project(radiance)) < DIRECTIONAL:
        return ()
    text = (
        f"the dominant light comes from {below:.0f} degrees below the horizon, which is rare; "
        "check the mask and the exposure"
    )
    return (Notice(text, code="light-below", source=name, remedy=give("pitch_deg")),)
