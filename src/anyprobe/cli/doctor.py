"""anyprobe doctor: check the installation."""

from __future__ import annotations

import contextlib
import importlib.metadata
import platform
import re
import time

import numpy as np
from rich.console import Console

from anyprobe import __version__
from anyprobe.cli.options import OPTIONS, ModelOption
from anyprobe.core.latlong import pixel_directions
from anyprobe.errors import ModelError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.runtime import file_hashes
from anyprobe.files.graphs import local_providers
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.masks.weights import SHA256, find_weights
from anyprobe.notices import FETCH_MASKS
from anyprobe.render.spheres import diffuse, sphere_normals


def doctor(*, model: ModelOption = DEFAULT_MODEL) -> None:
    """Check the installation.

    Prints versions and model hashes, and estimates the light of a rendered sphere.
    """
    console = Console(markup=False, emoji=False, highlight=False)
    console.print(f"python {platform.python_version()} on {platform.system()} {platform.machine()}")
    console.print(f"anyprobe {__version__}")
    for extra, packages in packages_by_extra().items():
        console.print(_installed(extra, packages), soft_wrap=True)
    console.print(f"providers {', '.join(local_providers())}")
    for stage, digest in file_hashes(model).items():
        console.print(f"model {model}/{stage} sha256 {digest}")
    console.print(mask_network(), soft_wrap=True)
    seconds, error = self_test(model)
    console.print(f"self-test: dominant light {error:.0f} degrees off, {seconds * 1e3:.0f} ms a photo")
    if error > SELF_TEST_DEG:
        raise ModelError(
            f"self-test: expected the dominant light within {SELF_TEST_DEG} degrees, got {error:.0f}; "
            "reinstall anyprobe"
        )
    console.print("OK")


SELF_TEST_DEG = 45
"""Largest error of self_test's dominant light [degrees]."""
OTHERS = ("dev", "judge")
"""Extras for developing anyprobe itself."""


def packages_by_extra() -> dict[str, list[str]]:
    """Return the packages of each extra, "" for the base install."""
    found: dict[str, list[str]] = {"": []}
    for requirement in importlib.metadata.requires("anyprobe") or ():
        match = re.match(r"([\w.-]+)(?:.*extra\s*==\s*['\"](\w+))?", requirement)
        if match and match[2] not in OTHERS:
            found.setdefault(match[2] or "", []).append(match[1])
    return found


def _installed(extra: str, packages: list[str]) -> str:
    """Return one line on an extra's packages: their versions, and which are missing."""
    versions: dict[str, str] = {}
    for package in packages:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[package] = importlib.metadata.version(package)
    missing = ", ".join(package for package in packages if package not in versions)
    line = ", ".join(f"{package} {version}" for package, version in versions.items())
    if missing:
        line += f"{'; ' if line else ''}missing {missing}; from a clone: pip install '.[{extra}]'"
    return f"{extra or 'packages'}: {line}"


def mask_network() -> str:
    """Return one line on the network that finds objects in photos here."""
    if (weights := find_weights()) is None:
        advice = OPTIONS.action(FETCH_MASKS)
        return f"masks by the small network alone; for U2-Net-p, which is right far more often, {advice}"
    return f"masks by U2-Net-p, {weights.source}: {weights.path} sha256 {SHA256}"


def self_test(model: str) -> tuple[float, float]:
    """Estimate the light of a rendered white sphere, lit from the upper left.

    Returns:
        Seconds for one photo, and the error of the dominant light's direction [degrees].
    """
    toward = np.array([-0.6, 0.6, 0.53])
    toward /= np.linalg.norm(toward)
    level = 0.12 + 9.0 * (pixel_directions(64) @ toward > np.cos(np.radians(15.0)))
    radiance = level[..., None].repeat(3, axis=-1).astype(np.float32)
    mask = sphere_normals(128)[1]
    photo = np.concatenate([np.clip(diffuse(radiance, len(mask)), 0, 1), mask[..., None]], axis=-1).astype(np.float32)
    estimator = Estimator(model)
    estimator(photo)
    start = time.perf_counter()
    light = estimator(photo)
    seconds = time.perf_counter() - start
    return seconds, float(np.degrees(np.arccos(np.clip(light.dominant_light().direction @ toward, -1.0, 1.0))))
