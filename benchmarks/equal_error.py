"""Time to the same error: each renderer against its own model's converged picture, in one process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from measure import Converging, relative_rmse
from mitsuba_sphere import MitsubaSphere, open_mitsuba
from ours import OurRenderer
from reference import LightTable, build_table, converge, separable_coat
from sphere import Light, View, choose_lights, choose_view, material, sphere_points

from anyprobe.core.sampling import hammersley


@dataclass(frozen=True, kw_only=True, slots=True)
class Effort:
    """reference_seconds: limit for each converged picture; reference_noise: relative RMSE it stops at;
    timing_seconds: least time over which the best repetition is sought."""

    reference_seconds: float = 12.0
    reference_noise: float = 0.004
    timing_seconds: float = 2.0

    @classmethod
    def quick(cls) -> Effort:
        """For a dry run."""
        return cls(reference_seconds=3.0, reference_noise=0.01, timing_seconds=0.2)


def compare(
    data: Path | None,
    *,
    kinds: list[str],
    alphas: list[float],
    target: float,
    size: int,
    threads: int,
    compiled: bool,
    effort: Effort,
) -> Iterator[dict[str, Any]]:
    """One line for every light, kind and alpha."""
    mitsuba = open_mitsuba(threads)
    ours = OurRenderer(compiled)
    for light in choose_lights(data):
        view = choose_view(light.radiance, size)
        table = build_table(light.radiance)
        ours.set_map(light.radiance)
        for kind in kinds:
            for alpha in alphas:
                rival = MitsubaSphere(mitsuba, light.radiance, view, kind, alpha)
                bench = _Cell(light, view, table, kind, alpha, effort)
                yield bench.line(ours, rival, target) | {
                    "ours_setup_s": round(ours.setup_seconds(kind, alpha), 4),
                    "mitsuba_setup_s": round(rival.setup_seconds(), 4),
                }


class _Cell:
    """One light, kind and alpha."""

    def __init__(self, light: Light, view: View, table: LightTable, kind: str, alpha: float, effort: Effort) -> None:
        self.light, self.view, self.table, self.effort = light, view, table, effort
        self.kind, self.alpha, self.material = kind, alpha, material(kind, alpha)

    def _converge(self, points, **options) -> Converging:
        effort = self.effort
        return converge(
            self.table, points, self.material, seconds=effort.reference_seconds, noise=effort.reference_noise, **options
        )

    def our_reference(self) -> Converging:
        """At the pixels' centres, where our renderer shades."""
        n, wo = self.view.n[self.view.inner], self.view.wo[self.view.inner]
        return self._converge(lambda k: (n, wo))

    def mitsuba_model(self) -> Converging:
        """Our integral of Mitsuba's own conductor, averaged over the pixel as Mitsuba averages."""
        view = self.view
        shifts = hammersley(64) - 0.5
        row, column = np.nonzero(view.mask)
        wanted = np.zeros(view.mask.shape, bool)
        wanted[row[view.inner], column[view.inner]] = True

        def points(k: int) -> tuple[np.ndarray, np.ndarray]:
            # bit-reversed order of the shifts: any run of them covers the pixel
            right, down = shifts[(k * 37) % len(shifts)]
            distance = float(np.linalg.norm(view.position))
            n, wo, mask = sphere_points(view.tan_half, distance, len(view.mask), (float(right), float(down)))
            return n[wanted[mask]] @ view.rotation.T, wo[wanted[mask]] @ view.rotation.T

        return self._converge(points, brdf=separable_coat, samples=128)

    def line(self, ours: OurRenderer, rival: MitsubaSphere, target: float) -> dict[str, Any]:
        """Both renderers' samples, seconds and errors."""
        start = time.monotonic()
        truth = self.our_reference()
        theirs = rival.converge(seconds=self.effort.reference_seconds, noise=self.effort.reference_noise)
        our = ours.reach(
            self.view,
            self.material,
            reference=truth.mean,
            noise=truth.noise,
            target=target,
            seconds=self.effort.timing_seconds,
        )
        given = {"reference": theirs.mean, "noise": theirs.noise, "seconds": self.effort.timing_seconds}
        their = rival.reach(target=target, **given)
        line: dict[str, Any] = {
            "part": "equal-error",
            "place": self.light.place,
            "map": self.light.name,
            "kind": self.kind,
            "alpha": self.alpha,
            "pixels": int(self.view.mask.sum()),
            "target": target,
            "reached": our.reached,
            "ours_samples": our.samples,
            "ours_s": round(our.seconds, 6),
            "ours_error": round(our.error, 5),
            "mitsuba": f"{their.integrator}, {their.sampler}",
            "mitsuba_spp": their.spp,
            "mitsuba_s": round(their.seconds, 5),
            "mitsuba_error": round(their.error, 5),
            "mitsuba_extrapolated": their.extrapolated,
            "speedup": round(their.seconds / our.seconds, 2) if our.reached else None,
            "ours_reference_noise": round(truth.noise, 5),
            "mitsuba_reference_noise": round(theirs.noise, 5),
        }
        if not our.reached:
            there = rival.reach(target=our.error, **given)
            line["mitsuba_s_at_our_error"] = round(there.seconds, 5)
            line["speedup_at_our_error"] = round(there.seconds / our.seconds, 2)
        if self.kind == "conductor":
            same = self.mitsuba_model()
            between = float(np.hypot(same.noise, theirs.noise))
            line["same_model_difference"] = round(relative_rmse(same.mean, theirs.mean), 5)
            line["same_model_noise"] = round(between, 5)
        line["took_s"] = round(time.monotonic() - start, 1)
        return line
