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
from anyprobe.render.integrate import shading_pyramid
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.reflectance import SHADERS, radiance_by_maps

COUNTS = (4, 8, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512)
"""Samples a point that are tried; of the specular and the diffuse term alike."""
SIZES = (24, 32, 48, 64, 96, 128)
"""Of reflectance maps that are tried, beside shading every point by itself."""
MAP_COUNTS, MAP_DIFFUSE_COUNTS = COUNTS[:9], (8, 16, 24, 32, 64)
"""Samples of a map's normals that are tried, of either term."""
EMITTERS, LOOK_UP = 10, 16
"""Samples that cost about as much as a point's emitters, for either term, and as a lookup with emitters."""


INDUCTOR_OPTIONS: dict[str, Any] = {
    # By default the compiler writes every long expression to memory and reads it back, and
    # checks each index. 6,200 points x 64 samples on two cores: 27 ms so, 5 ms with these.
    "realize_opcount_threshold": 100_000,
    "realize_reads_threshold": 100_000,
    "assert_indirect_indexing": False,
}


def compile_kernel(function: Callable) -> Callable:
    """Apply torch.compile to shade_specular, shade_diffuse or look_up; one kernel for each size of arguments."""
    return torch.compile(function, options=INDUCTOR_OPTIONS, dynamic=False)


@dataclass(frozen=True, kw_only=True, slots=True)
class Way:
    """How a picture is shaded: samples of the specular and of the diffuse term, of each point or of each
    normal of maps of side size (None: of each point)."""

    samples: int
    diffuse_samples: int
    size: int | None = None

    def cost(self, points: int) -> int:
        """Samples in all, or what costs as much."""
        samples = self.samples + self.diffuse_samples
        if self.size:
            return samples * self.size**2 + LOOK_UP * points
        return (samples + EMITTERS * (2 if self.diffuse_samples else 1)) * points


def ways(kind: str, points: int, sizes: list[int]) -> list[Way]:
    """Every way that is tried, with maps of these sizes, the cheapest first."""
    metal = kind == "conductor"
    tried = [Way(samples=count, diffuse_samples=0 if metal else count) for count in COUNTS] + [
        Way(samples=count, diffuse_samples=diffuse, size=size)
        for size in sizes
        for count in MAP_COUNTS
        for diffuse in ((0,) if metal else MAP_DIFFUSE_COUNTS)
    ]
    return sorted(tried, key=lambda way: way.cost(points))


@dataclass(frozen=True, kw_only=True, slots=True)
class OurResult:
    """The way, seconds a picture, relative RMSE; reached: whether that is within the target."""

    way: Way
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
            torch._dynamo.config.recompile_limit = 256  # one for each way
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

    def picture(self, view: View, material: Material, way: Way, timed: bool = False) -> Callable[[], torch.Tensor]:
        """A call that shades every point: Lo [P, 3].

        timed: by the compiled kernels if there are any.
        """
        kernels = self._timed if timed else SHADERS
        n, wo = torch.from_numpy(view.n), torch.from_numpy(view.wo)
        u = torch.from_numpy(hammersley(way.samples))
        u_diffuse = torch.from_numpy(hammersley(way.diffuse_samples)) if way.diffuse_samples else None
        alpha = torch.full((len(n), 1), material.alpha)
        f0, albedo = torch.from_numpy(material.f0), torch.from_numpy(material.albedo)
        pyramid = self._pyramid(material.alpha)
        wide = self._pyramid(1.0) if way.diffuse_samples else None

        def by_maps() -> torch.Tensor:
            with torch.no_grad():
                return radiance_by_maps(
                    pyramid, n, wo, material, u, u_diffuse, size=way.size, wide=wide, shaders=kernels
                )

        def by_points() -> torch.Tensor:
            with torch.no_grad():
                _, specular, grazing = kernels[0](pyramid, n, wo, alpha, u)
                radiance = f0 * specular + (1.0 - f0) * grazing
                if u_diffuse is not None:
                    diffuse = kernels[1](wide, n, wo, u_diffuse)
                    radiance = radiance + albedo * (1.0 - f0) * diffuse
                return radiance

        return by_maps if way.size else by_points

    def reach(
        self,
        kind: str,
        view: View,
        material: Material,
        *,
        reference: np.ndarray,
        noise: float,
        target: float,
        seconds: float,
    ) -> OurResult:
        """The cheapest way whose error is within target, timed; else the best of them.

        reference [inner points, 3] and its noise: see measure.relative_rmse.
        """

        def error(way: Way, timed: bool = False) -> float:
            picture = self.picture(view, material, way, timed)().numpy()
            return relative_rmse(picture[view.inner], reference, noise)

        most = {"samples": MAP_COUNTS[-1], "diffuse_samples": MAP_DIFFUSE_COUNTS[-1] * (kind == "plastic")}
        sizes = [size for size in SIZES if error(Way(size=size, **most)) <= target]
        best, least = None, np.inf
        for way in ways(kind, len(view.n), sizes):
            found = error(way)
            if found < least:
                best, least = way, found
            if least <= target:
                break
        reached = error(best, timed=True)
        return OurResult(
            way=best,
            seconds=best_time(self.picture(view, material, best, timed=True), seconds=seconds),
            error=reached,
            reached=reached <= target,
        )
