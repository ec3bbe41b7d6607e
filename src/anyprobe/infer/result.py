"""Light (noun): what an estimate returns. Frozen; every operation gives a new one."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import is_rotation
from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.errors import InputError, OutputError
from anyprobe.export.light import origin_of
from anyprobe.export.origin import check_front, map_from_camera, origin_turned, said_beside
from anyprobe.export.targets import export
from anyprobe.files.atomic import atomic_path
from anyprobe.files.images import write_png
from anyprobe.files.objects import open_object
from anyprobe.files.radiance import map_attributes, read_radiance, write_exr, write_hdr
from anyprobe.light.environment import check_radiance, integral, rotate
from anyprobe.light.harmonics import project
from anyprobe.light.main_light import MainLight, find_main_light
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.render.surface import frame_object
from anyprobe.scatter.brdf import Material
from anyprobe.scatter.presets import material_named

FRAME = "right-handed, +X right, +Y up, the camera looks along -Z; u = 0.5 + atan2(x, -z) / 2 pi, row 0 is +Y"
TURNED = (
    "right-handed, +X right, +Y up of a map that was turned by map_from_camera; u = 0.5 + atan2(x, -z) / 2 pi"
)
SCALE = "linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white"

OF_THE_MAP = (
    "frame map_from_camera scale exposure_ev response size confidence told sh9 main_light camera_from_crop warnings "
    "radiance stages"
).split()
"""What a sidecar, or the server's answer kept as one, says besides a light's info."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """The light around an object, in the frame of the photo's camera. Radiance and confidence cannot be written to.

    Attributes:
        radiance: [H, 2H, 3] linear Rec. 709, front (-Z) in the centre column, in the
            photo's exposure units: an object rendered with it fits the photo as it is.
        confidence: [H, 2H] in [0, 1]: how likely a pixel's display value is within 0.1 of the truth, or
            `told` everywhere from a model that does not say (`paper`); None where nothing is known.
        told: share of the object that told anything, in [0, 1]: neither black nor burnt out.
        warnings: one line each.
        stages: what the networks saw and said, in the crop's frame: photo [128, 128, 4],
            irradiance [128, 128, 3], ldr [64, 128, 3], ln_radiance [64, 128, 3].
        camera_from_crop: [3, 3] rotation from the crop's frame to the camera's.
        map_from_camera: [3, 3] rotation from the camera's frame to the map's: what rotate has done since.
        info: name of the photo, model, field of view, what was known of the object, seconds a step.
    """

    radiance: np.ndarray
    confidence: np.ndarray | None = field(default=None, repr=False)
    told: float = 1.0
    warnings: tuple[str, ...] = ()
    stages: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    camera_from_crop: np.ndarray = field(default_factory=lambda: np.eye(3), repr=False)
    map_from_camera: np.ndarray = field(default_factory=lambda: np.eye(3), repr=False)
    info: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in (
            ("radiance", check_radiance(self.radiance, "light")),
            ("confidence", self.confidence),
        ):
            if value is not None:
                own = np.array(value)  # a caller's array may change
                own.setflags(write=False)
                object.__setattr__(self, name, own)

    @classmethod
    def load(cls, path: str | Path) -> Light:
        """A light that save wrote as .exr or .hdr: its map, how it was turned, and what the .json beside it says.

        Of any other map of radiance with the front in its centre, the map alone. The confidence of each pixel and the
        stages are in none of the files: the light has none.

        Raises:
            InvalidEnvironment: no such file, or not a map.
            InputError: exported for another program, which would be turned; or a .json of save's that is damaged.
        """
        path = Path(path)
        radiance = read_radiance(path)
        check_front(path)
        said, turn = said_beside(path), map_from_camera(path)
        if said.get("scale") == SCALE and said.get("size") == [radiance.shape[1], radiance.shape[0]]:
            return cls(radiance=radiance, map_from_camera=turn, **_restored(said, path))
        model = map_attributes(path).get("model")
        return cls(radiance=radiance, map_from_camera=turn, info={"model": model} if model else {})

    def sh9(self) -> np.ndarray:
        """Radiance in nine real spherical harmonics, [9, 3]; order and signs of WebXR and three.js."""
        return project(self.radiance)

    def main_light(self) -> MainLight:
        """The lobe that a directional light stands for: direction, irradiance, colour."""
        return find_main_light(self.radiance)

    def rotate(self, rotation: np.ndarray) -> Light:
        """The light after the world is turned by rotation [3, 3]: new(d) = old(rotation^T d).

        With world_from_camera it becomes a map in the world's frame.

        Raises:
            InputError: not a rotation; a mirrored or scaled matrix would bend the light.
        """
        rotation = np.asarray(rotation, dtype=np.float64)
        if not is_rotation(rotation):
            raise InputError(
                f"rotation: expected a [3, 3] rotation matrix, got {' '.join(str(rotation).split())}; "
                "build it with anyprobe.core.frames"
            )
        turned = replace(
            self, radiance=rotate(self.radiance, rotation), map_from_camera=rotation @ self.map_from_camera
        )
        if self.confidence is None:
            return turned
        return replace(turned, confidence=rotate(self.confidence[..., None], rotation)[..., 0].clip(0.0, 1.0))

    def render(
        self,
        mesh: Mesh | str | Path,
        material: Material | str = "chrome",
        *,
        size: int = 256,
        fov_deg: float = 30.0,
        world_from_camera: np.ndarray | None = None,
    ) -> np.ndarray:
        """A mesh under this light: [S, S, 4] linear radiance in the light's units, and coverage.

        render.picture.draw_mesh has the details; core.response makes display values of it.

        Args:
            mesh: of render.shapes or render.mesh, a name of files.objects ("ball", "vase"), or a mesh file; +Y up,
                inside the unit sphere.
            material: of scatter.brdf, or a name of scatter.presets.
            size: pixels along a side. fov_deg: that the unit sphere fills.
            world_from_camera: [3, 3], the world being the light's frame; unless given the camera
                looks along -Z as the photo's did.
        """
        mesh = mesh if isinstance(mesh, Mesh) else open_object(str(mesh))
        material = material if isinstance(material, Material) else material_named(material)
        camera = frame_object(
            mesh, np.eye(3) if world_from_camera is None else world_from_camera, fov_deg, size=size
        )
        return draw_mesh(mesh, camera, self.radiance, material)

    def sidecar(self) -> dict[str, Any]:
        """Everything but the pixels, ready for JSON; lists of plain numbers."""
        main = self.main_light()
        return {
            **self.info,
            **self._frame(),
            "scale": SCALE,
            "exposure_ev": 0.0,
            "response": {"curve": "sigmoid", "exponent": MEAN_CURVE.exponent, "sigma": MEAN_CURVE.sigma},
            "size": [self.radiance.shape[1], self.radiance.shape[0]],
            "confidence": self._mean_confidence(),
            "told": round(float(self.told), 4),
            "sh9": _numbers(self.sh9()),
            "main_light": {
                "direction": _numbers(main.direction),
                "irradiance": _numbers(main.irradiance),
                "color": _numbers(main.color),
                "solid_angle_sr": round(main.solid_angle, 5),
                "confidence": round(main.confidence, 4),
            },
            "camera_from_crop": _numbers(self.camera_from_crop),
            "warnings": list(self.warnings),
        }

    def _frame(self) -> dict[str, Any]:
        """What the map's axes are, and how they are turned if they are not the camera's."""
        if np.allclose(self.map_from_camera, np.eye(3)):
            return {"frame": FRAME}
        return {"frame": TURNED, "map_from_camera": _numbers(self.map_from_camera)}

    def _mean_confidence(self) -> float | None:
        """Over the sphere."""
        if self.confidence is None:
            return None
        return round(float(integral(self.confidence[..., None])[0] / (4 * np.pi)), 4)

    def save(self, path: str | Path) -> Path:
        """Write .exr (half float, or float where half would clip), .hdr, .json or a tone-mapped .png; see load."""
        path = Path(path)
        kind = path.suffix.lower()
        turned = {name: str(value) for name, value in self._frame().items()}
        attributes = {"model": str(self.info.get("model", "")), **turned, "scale": SCALE}
        if kind == ".exr":
            write_exr(path, self.radiance, half=bool(self.radiance.max() < 65504), attributes=attributes)
        elif kind == ".hdr":
            write_hdr(path, self.radiance, attributes=attributes)
        elif kind == ".json":
            with atomic_path(path) as temporary:
                temporary.write_text(json.dumps(self.sidecar(), indent=1) + "\n", encoding="utf-8")
        elif kind == ".png":
            write_png(path, response(self.radiance))
        else:
            raise OutputError(f"{path}: expected .exr, .hdr, .json or .png, got {kind or 'no suffix'}")
        return path

    def export(
        self,
        target: str,
        folder: str | Path = "export",
        stem: str = "light",
        *,
        world_from_camera: np.ndarray | None = None,
        exposure_ev: float = 0.0,
    ) -> list[Path]:
        """Write the light for three, blender, unity, unreal, usd or another of docs/export.md's targets.

        All files, named <stem>_<target>, or none; anyprobe.export.targets.export has the rest.
        """
        return export(
            self.radiance,
            target,
            folder,
            stem,
            world_from_camera=world_from_camera,
            exposure_ev=exposure_ev,
            origin=origin_of(self.sidecar()) | origin_turned(self.map_from_camera),
        )


def _restored(said: dict[str, Any], path: Path) -> dict[str, Any]:
    """What a sidecar says of a Light's attributes (the page's says less); what it was told beside them is its info."""
    try:
        told, warnings = float(said.get("told", 1.0)), tuple(str(line) for line in said.get("warnings", ()))
        camera_from_crop = np.array(said.get("camera_from_crop", np.eye(3)), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        told, warnings, camera_from_crop = np.nan, (), np.zeros(0)
    if not (0 <= told <= 1 and is_rotation(camera_from_crop)):
        raise InputError(
            f"{path}: expected the .json beside it as it was written, got told or camera_from_crop changed; "
            "save the light again, or move the .json away"
        )
    info = {name: value for name, value in said.items() if name not in OF_THE_MAP}
    return {"told": told, "warnings": warnings, "camera_from_crop": camera_from_crop, "info": info}


def _numbers(array: np.ndarray) -> list:
    return np.round(np.asarray(array, dtype=np.float64), 6).tolist()


def told_share(image: np.ndarray) -> float:
    """Share of the object's pixels of a crop [S, S, 4] that are neither black nor burnt out."""
    inside = image[..., 3] > 0.5
    if not inside.any():
        return 0.0
    display = luminance(image[inside][:, :3] / image[inside][:, 3:])
    return float(((display > 0.02) & (display < 0.98)).mean())
