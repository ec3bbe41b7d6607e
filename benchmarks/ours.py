"""Our side of the equal-error part: the compiled shading, its error, the cheapest way that will do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from measure import best_time, relative_rmse
from sphere import View

from anyprobe.core.sampling import hammersley
from anyprobe.light.octahedral import Pyramid
from anyprobe.render.integrate import shade_diffuse, shade_specular, shading_pyramid
from anyprobe.scatter.materials import Material

COUNTS = (4, 8, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512)
"""Samples of each point that are tried; of the specular and the diffuse term alike."""
SHADERS = (shade_specular, shade_diffuse)


INDUCTOR_OPTIONS: dict[str, Any] = {
    # By default the compiler writes every long expression to memory and reads it back, and
    # checks each index. 6,200 points x 64 samples on two cores: 27 ms so, 5 ms with these.
    "realize_opcount_threshold": 100_000,
    "realize_reads_threshold": 100_000,
    "assert_indirect_indexing": False,
}


def compile_kernel(function: Callable) -> Callable:
    """Apply torch.compile to one of SHADERS; one kernel for each size of arguments."""
    return torch.compile(function, options=INDUCTOR_OPTIONS, dynamic=False)


@dataclass(frozen=True, kw_only=True, slots=True)
class OurResult:
    """Samples of each point, seconds a picture, relative RMSE; reached: whether that is within the target."""

    samples: int
    seconds: float
    error: float
    reached: bool


def _widths(kind: str, alpha: float) -> set[float]:
    """Alphas of the pyramids that a material needs."""
    return {alpha} if kind == "conductor" else {alpha, 1.0}


class OurRenderer:
    """Shades the sphere's points; compiled once for every way that is timed."""

    def __init__(self, compiled: bool = True) -> None:
        self._timed = SHADERS
        if compiled:
            torch._dynamo.config.recompile_limit = 256  # one for each number of samples
            self._timed = tuple(map(compile_kernel, SHADERS))
        self._map: torch.Tensor | None = None
        self._pyramids: dict[float, Pyramid] = {}

    def set_map(self, radiance: np.ndarray) -> None:
        """The light of all that follows."""
        self._map, self._pyramids = torch.from_numpy(np.ascontiguousarray(radiance)), {}

    def setup_seconds(self, kind: str, alpha: float) -> float:
        """What it takes to prepare the map for one material, the second time round."""

        def prepare() -> None:
            self._pyramids = {width: shading_pyramid(self._map, width) for width in _widths(kind, alpha)}

        prepare()
        return best_time(prepare, repetitions=3, seconds=0.0)

    def _pyramid(self, alpha: float) -> Pyramid:
        if alpha not in self._pyramids:
            self._pyramids[alpha] = shading_pyramid(self._map, alpha)
        return self._pyramids[alpha]

    def picture(self, view: View, material: Material, samples: int, timed: bool = False) -> Callable[[], torch.Tensor]:
        """A call that shades every point: Lo [P, 3].

        timed: by the compiled kernels if there are any.
        """
        specular_by, diffuse_by = self._timed if timed else SHADERS
        n, wo = torch.from_numpy(view.n), torch.from_numpy(view.wo)
        u = torch.from_numpy(hammersley(samples))
        alpha = torch.full((len(n), 1), material.alpha)
        f0, albedo = torch.from_numpy(material.f0), torch.from_numpy(material.albedo)
        pyramid = self._pyramid(material.alpha)
        wide = self._pyramid(1.0) if material.albedo.any() else None

        def by_points() -> torch.Tensor:
            with torch.no_grad():
                _, specular, grazing = specular_by(pyramid, n, wo, alpha, u)
                radiance = f0 * specular + (1.0 - f0) * grazing
                if wide is not None:
                    radiance = radiance + albedo * (1.0 - f0) * diffuse_by(wide, n, wo, u)
                return radiance

        return by_points

    def reach(
        self, view: View, material: Material, *, reference: np.ndarray, noise: float, target: float, seconds: float
    ) -> OurResult:
        """The fewest samples whose error is within target, timed; else the best of them.

        reference [inner points, 3] and its noise: see measure.relative_rmse.
        """

        def error(samples: int, timed: bool = False) -> float:
            picture = self.picture(view, material, samples, timed)().numpy()
            return relative_rmse(picture[view.inner], reference, noise)

        best, least = COUNTS[0], np.inf
        for samples in COUNTS:
            found = error(samples)
            if found < least:
                best, least = samples, found
            if least <= target:
                break
        reached = error(best, timed=True)
        return OurResult(
            samples=best,
            seconds=best_time(self.picture(view, material, best, timed=True), seconds=seconds),
            error=reached,
            reached=reached <= target,
        )
