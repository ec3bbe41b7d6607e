"""Our side of the equal-error part: the compiled shading, its error, the fewest samples that will do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from ball import View
from measure import best_time, relative_rmse

from anyprobe.core.sampling import hammersley
from anyprobe.light.octahedral import Pyramid, build_pyramid
from anyprobe.render.compiled import compile_kernel
from anyprobe.render.integrate import NUM_LAMPS, shade_diffuse, shade_specular
from anyprobe.scatter.brdf import Material

COUNTS = (4, 8, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512)
"""Samples a point that are tried."""


@dataclass(frozen=True, kw_only=True, slots=True)
class OurResult:
    """samples a point, seconds a picture, relative RMSE; reached: whether that is within the target.

    errors: of every count tried, uncompiled.
    """

    samples: int
    seconds: float
    error: float
    reached: bool
    errors: dict[int, float]


class OurRenderer:
    """Shades the ball's points; compiled once for every sample count that is timed."""

    def __init__(self, compiled: bool = True) -> None:
        self._plain = self._timed = (shade_specular, shade_diffuse)
        if compiled:
            torch._dynamo.config.recompile_limit = 64  # one for each sample count
            self._timed = (compile_kernel(shade_specular), compile_kernel(shade_diffuse))
        self._pyramid: Pyramid | None = None

    def set_map(self, radiance: np.ndarray) -> float:
        """The light of all that follows; returns the seconds it took to prepare, the second time round."""
        tensor = torch.from_numpy(np.ascontiguousarray(radiance))
        self._pyramid = build_pyramid(tensor, lamps=NUM_LAMPS)
        return best_time(lambda: build_pyramid(tensor, lamps=NUM_LAMPS), repetitions=3, seconds=0.0)

    def picture(
        self, kind: str, view: View, material: Material, samples: int, timed: bool = False
    ) -> Callable[[], torch.Tensor]:
        """A call that shades every point: Lo [P, 3], a conductor's without the diffuse term.

        timed: by the compiled kernels if there are any.
        """
        specular_terms, diffuse_term = self._timed if timed else self._plain
        n, wo = torch.from_numpy(view.n), torch.from_numpy(view.wo)
        alpha = torch.full((len(n), 1), material.alpha)
        u = torch.from_numpy(hammersley(samples))
        f0, albedo = torch.from_numpy(material.f0), torch.from_numpy(material.albedo)

        def call() -> torch.Tensor:
            with torch.no_grad():
                _, specular, grazing = specular_terms(self._pyramid, n, wo, alpha, u)
                radiance = f0 * specular + (1.0 - f0) * grazing
                if kind == "plastic":
                    radiance = radiance + albedo * (1.0 - f0) * diffuse_term(self._pyramid, n, wo, u)
                return radiance

        return call

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
        """The fewest samples of COUNTS whose error is within target, timed; else the best of them.

        reference [inner points, 3] and its noise: see measure.relative_rmse.
        """

        def error(samples: int, timed: bool = False) -> float:
            picture = self.picture(kind, view, material, samples, timed)().numpy()
            return relative_rmse(picture[view.inner], reference, noise)

        errors: dict[int, float] = {}
        for samples in COUNTS:
            errors[samples] = error(samples)
            if errors[samples] <= target:
                break
        samples = min(errors, key=errors.__getitem__)
        call = self.picture(kind, view, material, samples, timed=True)
        reached = error(samples, timed=True)
        return OurResult(
            samples=samples,
            seconds=best_time(call, seconds=seconds),
            error=reached,
            reached=reached <= target,
            errors=errors,
        )
