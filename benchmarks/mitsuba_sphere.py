"""The rival: Mitsuba 3 (llvm_ad_rgb) with its stock roughconductor, roughplastic and envmap.

Its picture integrates over the pixel (box filter); its error is taken over the pixels that the
sphere covers wholly. Multiple importance sampling is its default and stays on.
"""

from __future__ import annotations

import glob
import itertools
import os
import time
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from measure import Converging, best_time, relative_rmse
from sphere import ALBEDO, IOR, View

from anyprobe.errors import AnyprobeError

INTEGRATORS = ("direct", "path")
SAMPLERS = ("independent", "multijitter")
PROBE_SPP = (64, 256)
LARGEST_SPP = 1024
"""Samples a pixel in one launch; pictures that need more are means of several launches."""
LARGEST_TIMED_SPP = 8192
"""From here on the time is extrapolated in proportion to the samples."""
LIBRARIES = ("/usr/lib/*/libLLVM-19.so*", "/usr/lib/llvm-19/lib/libLLVM*.so*")
INSTALL = "pip install mitsuba, and LLVM 19 (Debian: apt-get install libllvm19)"


@dataclass(frozen=True, kw_only=True, slots=True)
class MitsubaResult:
    """integrator, sampler: the fastest found; spp, seconds, error of a picture within the target.

    extrapolated: the seconds are of LARGEST_TIMED_SPP, times spp / LARGEST_TIMED_SPP, and the error
    follows the power law of the two probes.
    """

    integrator: str
    sampler: str
    spp: int
    seconds: float
    error: float
    extrapolated: bool


def open_mitsuba(threads: int) -> ModuleType:
    """The module with its variant set; LLVM 14 and 16 end the process on AVX-512, so 19 is asked for."""
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(path for pattern in LIBRARIES for path in glob.glob(pattern))
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = found[0]
    try:
        import drjit
        import mitsuba
    except ImportError as error:
        raise AnyprobeError(f"expected Mitsuba 3 to compare with, found none; {INSTALL}") from error
    try:
        mitsuba.set_variant("llvm_ad_rgb")
        drjit.set_thread_count(threads)
        drjit.eval(drjit.arange(mitsuba.Float, 4) + 1)
    except (ImportError, RuntimeError) as error:
        raise AnyprobeError(f"expected an LLVM library that Mitsuba can use, found none; {INSTALL}") from error
    mitsuba.set_log_level(mitsuba.LogLevel.Error)  # multijitter tells of every count it rounds up
    return mitsuba


class MitsubaSphere:
    """The sphere in Mitsuba, under one map, seen by one camera; `kind` and alpha as in sphere.material."""

    def __init__(self, mitsuba: ModuleType, radiance: np.ndarray, view: View, kind: str, alpha: float) -> None:
        self._mi, self._view, self._scenes = mitsuba, view, {}
        # Mitsuba's +Z lies in the centre column, ours has -Z there
        self._bitmap = mitsuba.Bitmap(np.roll(radiance, radiance.shape[0], axis=1).astype(np.float32))
        self._bsdf: dict[str, Any] = {"type": "roughconductor", "material": "none"}
        if kind == "plastic":
            self._bsdf = {
                "type": "roughplastic",
                "int_ior": IOR,
                "diffuse_reflectance": {"type": "rgb", "value": list(ALBEDO)},
            }
        self._bsdf |= {"distribution": "ggx", "alpha": alpha}
        self._seed = 0

    def _scene(self, integrator: str, sampler: str):
        if (integrator, sampler) not in self._scenes:
            self._scenes[integrator, sampler] = self._load(integrator, sampler)
        return self._scenes[integrator, sampler]

    def _load(self, integrator: str, sampler: str):
        view = self._view
        camera = self._mi.ScalarTransform4f().look_at(
            origin=view.position.tolist(), target=[0, 0, 0], up=view.rotation[:, 1].tolist()
        )
        return self._mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": integrator, "hide_emitters": True}
                | ({"max_depth": 2} if integrator == "path" else {}),
                "sensor": {
                    "type": "perspective",
                    "fov": float(np.degrees(2 * np.arctan(view.tan_half))),
                    "to_world": camera,
                    "film": {
                        "type": "hdrfilm",
                        "width": len(view.mask),
                        "height": len(view.mask),
                        "rfilter": {"type": "box"},
                        "pixel_format": "rgb",
                        "component_format": "float32",
                    },
                    "sampler": {"type": sampler},
                },
                "map": {"type": "envmap", "bitmap": self._bitmap},
                "sphere": {"type": "sphere", "bsdf": self._bsdf},
            }
        )

    def setup_seconds(self) -> float:
        """Time to load the scene once libraries and plugins are in memory."""
        return best_time(lambda: self._load(INTEGRATORS[0], SAMPLERS[0]), repetitions=3, seconds=0.0)

    def picture(self, integrator: str, sampler: str, spp: int) -> tuple[Any, int]:
        """A finished picture of at least spp samples a pixel with numbers of its own, and its samples."""
        import drjit

        scene = self._scene(integrator, sampler)
        launches = -(-spp // LARGEST_SPP)
        total, done = 0.0, 0
        for _ in range(launches):
            self._seed += 1
            total = total + self._mi.render(scene, seed=self._seed, spp=-(-spp // launches))
            drjit.eval(total)
            done += scene.sensors()[0].sampler().sample_count()
        drjit.sync_thread()
        return total / launches, done

    def points(self, picture) -> np.ndarray:
        """The wholly covered pixels [P, 3] of a picture."""
        return np.array(picture)[self._view.mask][self._view.inner]

    def converge(self, *, seconds: float, noise: float, passes: int = 4) -> Converging:
        """Its own reference: launches of LARGEST_SPP until noise is reached or the time is up."""
        result, start = Converging(), time.monotonic()
        spp = LARGEST_SPP
        while result.count < passes or (result.noise > noise and time.monotonic() - start < seconds):
            result.add(self.points(self.picture("direct", "multijitter", spp)[0]))
        return result

    def _error(self, how: tuple[str, str], spp: int, reference: np.ndarray, noise: float, repeat: int) -> float:
        """Root of the mean squared relative RMSE of several pictures."""
        errors = [relative_rmse(self.points(self.picture(*how, spp)[0]), reference, noise) for _ in range(repeat)]
        return float(np.sqrt(np.mean(np.square(errors))))

    def reach(
        self, *, reference: np.ndarray, noise: float, target: float, seconds: float, repeat: int = 3
    ) -> MitsubaResult:
        """The fastest integrator and sampler for a picture within target, with as few samples as do.

        Each is tried at PROBE_SPP; its error's power law foretells the samples, the probe's time the rest.
        """
        foretold = {}
        for how in itertools.product(INTEGRATORS, SAMPLERS):
            spps = [self.picture(*how, spp)[1] for spp in PROBE_SPP]  # warm, and as the sampler rounds it
            errors = [self._error(how, spp, reference, noise, repeat) for spp in spps]
            power = np.log(errors[0] / errors[1]) / np.log(spps[1] / spps[0])
            power = float(np.clip(power, 0.4, 1.0))
            spp = max(1, round(spps[1] * (errors[1] / target) ** (1 / power)))
            a_sample = best_time(lambda how=how: self.picture(*how, PROBE_SPP[1]), repetitions=3, seconds=0.0)
            foretold[how] = (a_sample / spps[1] * spp, spp, power)
        how = min(foretold, key=lambda key: foretold[key][0])
        _, spp, power = foretold[how]
        return self._at(how, spp, power, reference, noise, target, seconds, repeat)

    def _at(self, how, spp, power, reference, noise, target, seconds, repeat) -> MitsubaResult:
        """Go to spp, mend it by the error found there until that is within 5 % of target, take the time."""
        for attempt in range(3):
            timed = min(spp, LARGEST_TIMED_SPP)
            done = self.picture(*how, timed)[1]
            extrapolated = spp > LARGEST_TIMED_SPP
            spp = spp if extrapolated else done
            error = self._error(how, timed, reference, noise, repeat) * (done / spp) ** power
            wanted = max(1, round(spp * (error / target) ** (1 / power)))
            if abs(error / target - 1) < 0.05 or wanted == spp or attempt == 2:
                break
            spp = wanted
        elapsed = best_time(lambda: self.picture(*how, timed), seconds=seconds)
        return MitsubaResult(
            integrator=how[0],
            sampler=how[1],
            spp=spp,
            seconds=elapsed * spp / done,
            error=error,
            extrapolated=extrapolated,
        )
