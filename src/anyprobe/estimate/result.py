"""Light: what an estimate returns. Frozen; every operation gives a new one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anyprobe.core import Float
from anyprobe.core.color import to_bytes
from anyprobe.core.frames import check_pose
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe.estimate.ground import GUESSED, Ground, levelled
from anyprobe.estimate.material_hint import MEASURED_CONFIDENCE
from anyprobe.estimate.sheet import draw_preview
from anyprobe.estimate.sidecar import (
    SCALE,
    SIDECAR_VERSION,
    Origin,
    error_stated,
    frame_of,
    json_numbers,
    restored,
    source_json,
)
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import check_radiance, integral, rotate
from anyprobe.light.harmonics import directionality, project
from anyprobe.light.light_sources import NO_SOURCE, LightSource, find_sources, turned_said
from anyprobe.maps.radiance import map_attributes
from anyprobe.notices import Notice, as_notice
from anyprobe.pictures.images import png_bytes
from anyprobe.place.panorama import DRAWN_ROWS, Panorama, check_rows, compose, in_frame, save_map
from anyprobe.place.plate import Plate

if TYPE_CHECKING:
    from anyprobe.match.library import Library
    from anyprobe.match.likeness import Shown
    from anyprobe.match.ranking import MatchedMap
    from anyprobe.render.mesh import Mesh
    from anyprobe.scatter.materials import Material

LEVEL, CAMERA = FRAMES = ("level", "camera")
"""Frames of panoramas and exports."""
MIRROR_ERROR_DEG = 180 / 64
"""A pixel of the map that a mirror is unwrapped to."""
SIDES = (("the left", "the right"), ("below", "above"), ("behind the object", "the camera's side"))
"""Names of directions along -X and +X, -Y and +Y, -Z and +Z."""
BEHIND = -0.5
"""z, in the crop's frame, of what a mirror shows near its rim."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Light:
    """The light around an object, in the frame of the photo's camera. Radiance and confidence are read-only.

    Attributes:
        radiance: [H, 2H, 3] linear Rec. 709, front (-Z) in the centre column, in the
            photo's exposure units: an object rendered with it fits the photo as it is.
        confidence: [H, 2H] in [0, 1]: probability that a pixel's display value is within 0.1 of the truth; None where
            unknown, as of the model `paper`.
        well_exposed_fraction: share of the object's pixels that are neither black nor clipped, in [0, 1].
        warnings: what is doubtful; each is a line of text with its code, subject and remedy, see notices.Notice.
        stages: the networks' inputs and outputs, in the crop's frame: photo [128, 128, 4],
            irradiance [128, 128, 3] of the model `paper`.
        camera_from_crop: [3, 3] rotation from the crop's frame to the camera's.
        map_from_camera: [3, 3] rotation from the camera's frame to the map's: what rotate has done since.
        origin: how the estimate came about.
        find_shown: gives `shown`; None where nothing is known of it.
        plate: what the photo shows beside its object, for panorama; None where that is nothing, or not kept.
        seen: [64, 128, 4] what the photo shows of the light, in the camera's frame: radiance times cover, and cover.
        said_error_deg: error of the dominant light's direction, by the networks or the .json of a light that was saved.
        said_sources: [S, 4] by the same: whether each source exists, in [0, 1], and its direction in the map's frame.
        soft: probability that no light source dominates, the output `soft` of light.onnx (light_graph.Said); None where
            that is not known.
        outdoors: probability that the place is outdoors; None where that is not known.
    """

    radiance: np.ndarray
    confidence: np.ndarray | None = None
    well_exposed_fraction: float = 1.0
    warnings: tuple[Notice, ...] = ()
    stages: dict[str, np.ndarray] = field(default_factory=dict)
    camera_from_crop: np.ndarray = field(default_factory=lambda: np.eye(3))
    map_from_camera: np.ndarray = field(default_factory=lambda: np.eye(3))
    origin: Origin = field(default_factory=Origin)
    find_shown: Callable[[], Shown | None] | None = None
    plate: Plate | None = None
    seen: np.ndarray | None = None
    said_error_deg: float | None = None
    said_sources: np.ndarray | None = None
    soft: float | None = None
    outdoors: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "warnings", tuple(map(as_notice, self.warnings)))
        for name, value in (("radiance", check_radiance(self.radiance, "light")), ("confidence", self.confidence)):
            if value is not None:
                own = np.array(value)  # a caller's array may change
                own.setflags(write=False)
                object.__setattr__(self, name, own)

    def __repr__(self) -> str:
        x, y, z = self.dominant_light().direction
        confidence, count = self._mean_confidence(), len(self.warnings)
        parts = [
            "Light {} x {}".format(*self.radiance.shape),
            *([self.origin.photo] if self.origin.photo else []),
            f"dominant light towards ({x:z.2f}, {y:z.2f}, {z:z.2f})",
            *([] if confidence is None else [f"confidence {confidence:.2f}"]),
            *([f"{count} warning{'s' if count > 1 else ''}"] if count else []),
        ]
        return f"<{', '.join(parts)}>"

    def _repr_png_(self) -> bytes:
        """Return the sheet of panorama and spheres, for notebooks."""
        return png_bytes(to_bytes(draw_preview(self.panorama())))

    @classmethod
    def load(cls, path: str | Path) -> Light:
        """Return a light that save wrote as .exr or .hdr: map, how it was turned, and info from the .json beside it.

        Of any other environment map with the front in its centre, the map alone. Per-pixel confidence and stages are
        in none of the files.

        Raises:
            InvalidEnvironment: no such file, or not an environment map.
            InputError: exported for another program, in whose frame it is; or a damaged .json beside it.
        """
        from anyprobe.export.exported_light import read_with_origin

        path = Path(path)
        radiance, said, turn = read_with_origin(path)
        if said.get("scale") == SCALE and said.get("size") == [radiance.shape[1], radiance.shape[0]]:
            return cls(radiance=radiance, map_from_camera=turn, **restored(said, path))
        model = map_attributes(path).get("model")
        return cls(radiance=radiance, map_from_camera=turn, origin=Origin(model=model or None))

    def sh9(self) -> Float[np.ndarray, "9 3"]:
        """Radiance in nine real, orthonormal spherical harmonics [9, 3]; order and signs of WebXR and three.js.

        The order is 1, y, z, x, xy, yz, 3z2-1, xz, x2-y2, see light.harmonics.
        """
        return project(self.radiance)

    def sources(self) -> tuple[LightSource, ...]:
        """Return the light's sources, the dominant one first: direction and its error, size, power, whether it exists.

        Of the others, those that are likely there; none of a black or even map.
        """
        main, *others = find_sources(self.radiance, self.said_sources) or (NO_SOURCE,)
        if main is NO_SOURCE:
            return ()
        error_deg = MIRROR_ERROR_DEG if self._is_measured(main.direction) else self.said_error_deg
        return (main if error_deg is None else replace(main, error_deg=error_deg), *others)

    def dominant_light(self) -> LightSource:
        """Return the first of sources; one without power, straight above, where there is none."""
        return next(iter(self.sources()), NO_SOURCE)

    def _is_measured(self, direction: np.ndarray) -> bool:
        """Return whether a mirror shows what is there, unclipped; its rim shows too little of what is behind it."""
        if self.confidence is None or not (self.origin.hints or {}).get("above_white"):
            return False
        in_crop = (self.map_from_camera @ self.camera_from_crop).T @ direction
        at = bilinear(self.confidence[..., None], direction_to_uv(direction))
        return bool(at[0] > 0.9 * MEASURED_CONFIDENCE and in_crop[2] > BEHIND)

    @property
    def is_soft(self) -> bool:
        """Whether no light source dominates, so that the light has no one direction."""
        return self.soft is not None and self.soft > 0.5

    def side_of(self, direction: np.ndarray) -> str:
        """Return the side that a direction points to, level as far as the ground is known: "above", "the left", ..."""
        toward = direction @ self.map_from_camera
        toward = toward if self.ground is None else self.ground.level_from_camera @ toward
        axis = int(np.abs(toward).argmax())
        return SIDES[axis][int(toward[axis] > 0)]

    def brightest_side(self) -> str:
        """Return the side that most light comes from, as side_of."""
        return self.side_of(self.sh9()[[3, 1, 2]].mean(axis=1))

    def rotate(self, rotation: np.ndarray) -> Light:
        """Return the light after the world is turned by rotation [3, 3]: new(d) = old(rotation^T d).

        With world_from_camera it becomes a map in the world's frame.

        Raises:
            InputError: not a rotation; a mirrored or scaled matrix would bend the light.
        """
        rotation = check_pose(rotation, "rotation")
        radiance, said = rotate(self.radiance, rotation), turned_said(self.said_sources, rotation)
        turned = replace(self, radiance=radiance, map_from_camera=rotation @ self.map_from_camera, said_sources=said)
        if self.confidence is None:
            return turned
        return replace(turned, confidence=rotate(self.confidence[..., None], rotation)[..., 0].clip(0.0, 1.0))

    def panorama(self, size: int = DRAWN_ROWS, *, frame: str = LEVEL, lit: bool = False) -> Panorama:
        """Return one picture of the place, `size` x 2 `size`: the photo where it is seen, and this light elsewhere.

        What is not known is smooth; its mean luminance is this light's.

        Args:
            size: rows, one of place.panorama.PANORAMA_SIZES.
            frame: "level", +Y is up as far as the camera's pitch and roll are known, or "camera", the frame of
                radiance. A light that was rotated keeps its own frame.
            lit: whether luminance has all nine harmonics of this light, to render with; it looks less like the place.
        Raises:
            InputError: another size or frame.
        """
        check_rows(size)
        is_level, turn = self._panorama_frame(frame)
        turned, from_camera = in_frame(self.radiance, turn), turn @ self.map_from_camera
        radiance, origin = compose(turned, self.plate, from_camera, size, lit=lit)
        said = {key: str(value) for key, value in frame_of(from_camera).items()}
        said |= {"scale": SCALE, "model": self.origin.model or ""}
        return Panorama(
            radiance=radiance, origin=origin, frame_from_camera=from_camera, is_level=is_level, attributes=said
        )

    def _panorama_frame(self, frame: str) -> tuple[bool, np.ndarray]:
        """Return whether a panorama is level, and the rotation [3, 3] from this map's frame to its own."""
        ground = self.ground
        if check_frame(frame) != LEVEL or ground is None or not np.allclose(self.map_from_camera, np.eye(3)):
            return False, np.eye(3)
        return True, ground.level_from_camera

    @property
    def ground(self) -> Ground | None:
        """The ground under the object, in the camera's frame; None where it is not known, as for a cut-out."""
        return self.origin.ground

    @property
    def info(self) -> dict[str, Any]:
        """How the estimate came about, ready for JSON."""
        return self.origin.as_json()

    @property
    def pitch_deg(self) -> float | None:
        """How far the camera looks down, where that was given, noted by the camera, or estimated from the photo."""
        given, ground = self.origin.pitch_deg, self.ground
        return ground.pitch_deg if given is None and ground is not None and ground.source != GUESSED else given

    @cached_property
    def shown(self) -> Shown | None:
        """Return the shown object, for match; None where it is not known."""
        return None if self.find_shown is None else self.find_shown()

    def match(self, folder: Library | str | Path, *, best: int | None = None) -> list[MatchedMap]:
        """Return a folder's .exr and .hdr panoramas, the one first that lights the object most as its photo shows it.

        Each with the rotation, exposure and tint that bring it into this light's frame; see match.ranking. A light
        that is not of one photo (of several, loaded from a file) is compared by its map, which is less certain. A
        camera's pitch that was given or noted is kept, with the noted roll; an estimated one moves within its error.

        Args:
            best: how many are returned; None: all.
        Raises:
            InputError: no such folder, or no panoramas in it.
        """
        from anyprobe.match.ranking import rank_maps

        is_known = self.origin.pitch_deg is not None or (self.ground is not None and self.ground.is_known)
        ranked = rank_maps(
            self.radiance,
            self.shown,
            folder,
            self.map_from_camera,
            self.pitch_deg,
            pitch_error_deg=0.0 if is_known or self.ground is None else self.ground.pitch_error_deg,
            roll_deg=self.ground.roll_deg if self.ground is not None and self.ground.is_known else 0.0,
            outdoors=self.outdoors,
        )
        return ranked[:best]

    def render(
        self, mesh: Mesh | str | Path, material: Material | str = "chrome", **camera: Any
    ) -> Float[np.ndarray, "S S 4"]:
        """Return a mesh under this light: [S, S, 4] linear radiance and coverage; see files.objects.draw_under.

        mesh: a Mesh, a shape's name ("sphere", "vase") or a mesh file. material: a Material or a name ("gold").
        camera: size in pixels, fov_deg that the object fills, world_from_camera.
        """
        from anyprobe.files.objects import draw_under

        return draw_under(self.radiance, mesh, material, **camera)

    def export(self, target: str, folder: str | Path = "export", stem: str = "light", **settings: Any) -> list[Path]:
        """Write the light for three, blender, unity, unreal, usd or another of docs/how-to/export.md's targets.

        All files, named <stem>_<target>, or none. It is level as far as the camera's pitch and roll are known.
        settings: frame ("camera" leaves it in the camera's frame), world_from_camera, exposure_ev.
        """
        from anyprobe.export.exported_light import origin_of, origin_turned
        from anyprobe.export.targets import export

        said, is_estimate = self.sidecar(), self.origin.model is not None
        origin = origin_of(said) | origin_turned(self.map_from_camera)
        frame = check_frame(settings.pop("frame", LEVEL))
        if settings.get("world_from_camera") is None and (is_estimate or self.ground is not None):
            turn, level = levelled(self.ground, self.map_from_camera, is_wanted=frame == LEVEL)
            settings["world_from_camera"] = turn
            origin |= level
        if is_estimate:
            settings.setdefault("error_deg", error_stated(said))
            settings.setdefault("said_sources", self.said_sources)
        return export(self.radiance, target, folder, stem, origin=origin, **settings)

    def sidecar(self) -> dict[str, Any]:
        """Everything but the pixels, ready for JSON; lists of plain numbers."""
        main, sh9 = self.dominant_light(), self.sh9()
        return {
            "version": SIDECAR_VERSION,
            **self.info,
            **frame_of(self.map_from_camera),
            "scale": SCALE,
            "exposure_ev": 0.0,
            "response": {"curve": "sigmoid", "exponent": MEAN_CURVE.exponent, "sigma": MEAN_CURVE.sigma},
            "size": [self.radiance.shape[1], self.radiance.shape[0]],
            "confidence": self._mean_confidence(),
            "well_exposed_fraction": round(float(self.well_exposed_fraction), 4),
            "sh9": json_numbers(sh9),
            "dominant_light": {
                "direction": json_numbers(main.direction),
                "irradiance": json_numbers(main.irradiance),
                "color": json_numbers(main.color),
                "solid_angle_sr": round(main.solid_angle, 5),
                "directionality": round(directionality(sh9), 4),
                "error_deg": round(main.error_deg, 1),
            },
            "sources": [source_json(one) for one in self.sources()],
            **({} if self.soft is None else {"soft": round(float(self.soft), 3)}),
            **({} if self.outdoors is None else {"outdoors": round(float(self.outdoors), 3)}),
            **({"brightest_side": self.brightest_side()} if self.is_soft else {}),
            "camera_from_crop": json_numbers(self.camera_from_crop),
            "warnings": list(self.warnings),
            "notices": [one.as_json() for one in self.warnings],
        }

    def _mean_confidence(self) -> float | None:
        """Over the sphere."""
        if self.confidence is None:
            return None
        return round(float(integral(self.confidence[..., None])[0] / (4 * np.pi)), 4)

    def save(self, path: str | Path, *, colorspace: str = "rec709") -> Path:
        """Write .exr (half float, or float where half would clip), .hdr, .json or a tone-mapped .png; see load.

        colorspace: of an .exr, linear: rec709 or acescg; its header says which, and load turns it back.
        """
        path = Path(path)
        if path.suffix.lower() == ".json":
            with atomic_path(path) as temporary:
                temporary.write_text(json.dumps(self.sidecar(), indent=1) + "\n", encoding="utf-8")
            return path
        own_frame = {name: str(value) for name, value in frame_of(self.map_from_camera).items()}
        attributes = {"model": self.origin.model or "", **own_frame, "scale": SCALE}
        return save_map(path, self.radiance, lambda: response(self.radiance), attributes, colorspace)


def check_frame(frame: str) -> str:
    """Return one of FRAMES; InputError for another."""
    if frame not in FRAMES:
        advice = did_you_mean(frame, FRAMES) or "; choose one"
        raise InputError(f"expected {' or '.join(FRAMES)}, got {frame!r}{advice}", subject="frame")
    return frame
