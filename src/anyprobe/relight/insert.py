"""A virtual object beside the real one of a photo, lit by the estimate of its light."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InputError, MissingExtra
from anyprobe.estimate.photo import Photo
from anyprobe.relight.appearance import material_from_photo
from anyprobe.relight.ground import View, view_of
from anyprobe.relight.path_traced import GROUND_RADII, NUM_PATHS, Ground, open_mitsuba, trace_mesh
from anyprobe.relight.placement import Placement, Side, place_beside
from anyprobe.relight.shadow import GRID, NUM_DIRECTIONS, GroundShadow, sky_irradiance
from anyprobe.render.mesh import Mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.render.surface import Camera
from anyprobe.scatter.materials import Material, material_named

BORDER_PX = 2
"""Kept around the object's window for its soft edge."""

MOST_DRAWN = 512
"""Pixels that an object is drawn across; in larger photos it is enlarged, as their own pixels are hardly sharper."""

ENLARGED_SUPERSAMPLE = 2
"""Points of a pixel, along a side, of an object that is enlarged."""

THREADS = 2
"""That darken strips of the ground at a time."""

MOST_PATHS = 1 << 25
"""Of the path tracer for one object."""

LEAST_SHADOW = 1 / 1024
"""A quarter of a display step; where less is missing the photo stays as it is."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """The square part of the photo that the object covers: its corner and side [px], and its camera."""

    left: int
    top: int
    size: int
    camera: Camera


def window_surroundings(placement: Placement, view: View) -> Window | None:
    """The smallest square of whole pixels around what the photo shows of the object; None where that is nothing."""
    pixels, sides = view.pixels(placement.mesh.positions), np.array([view.width, view.height])
    low = np.floor(np.clip(pixels.min(axis=0), 0, sides)).astype(int)
    high = np.ceil(np.clip(pixels.max(axis=0), 0, sides)).astype(int)
    if (low >= high).any():
        return None
    low -= BORDER_PX
    size = int((high - low).max()) + BORDER_PX
    middle = low + size / 2
    camera = Camera(
        world_from_camera=np.eye(3),
        position=np.zeros(3),
        tan_half=size / 2 / view.focal,
        size=size,
        center=(
            float((middle[0] - view.width / 2) / view.focal),
            float((view.height / 2 - middle[1]) / view.focal),
        ),
    )
    return Window(left=int(low[0]), top=int(low[1]), size=size, camera=camera)


def cast_shadow(photo: Photo, view: View, shadow: GroundShadow) -> np.ndarray:
    """The photo [H, W, 3] with the shadow on its ground.

    The real object and what lies above the horizon get none; pixels that lose nothing keep their bits. Of the photo
    only the part is looked at that shows the shadow's square.
    """
    picture = photo.rgb.copy()

    def darken(strip: tuple[slice, slice]) -> None:
        ground = view.ground_of(strip)
        ratio = shadow.at(ground.reshape(-1, 3)).reshape(ground.shape)
        ratio = 1.0 - (1.0 - ratio) * (1.0 - photo.mask[strip][..., None])
        touched = (ratio < 1.0 - LEAST_SHADOW).any(axis=-1)
        under = picture[strip]
        under[touched] = response(inverse_response(under[touched]) * ratio[touched])

    with ThreadPoolExecutor(THREADS) as pool:  # each strip is its own part of the picture
        list(pool.map(darken, view.strips(view.part_around(shadow.foot, shadow.reach))))
    return picture


def lay_over(
    picture: np.ndarray,
    drawn: np.ndarray,
    window: Window,
    photo: Photo,
    behind: bool = False,
) -> np.ndarray:
    """Lay an object [S, S, 4] (linear radiance, coverage) over a display picture [H, W, 3], which is changed.

    Args:
        behind: whether the real object hides it.
    """
    height, width = picture.shape[:2]
    top, left = max(window.top, 0), max(window.left, 0)
    bottom, right = min(window.top + window.size, height), min(window.left + window.size, width)
    if top >= bottom or left >= right:
        return picture
    part = drawn[top - window.top : bottom - window.top, left - window.left : right - window.left]
    coverage = part[..., 3:]
    if behind:
        coverage = coverage * (1.0 - photo.mask[top:bottom, left:right, None])
    under = picture[top:bottom, left:right]
    mixed = under + coverage * (response(part[..., :3]) - under)
    picture[top:bottom, left:right] = np.where(coverage > 0, mixed, under)
    return picture


def enlarged(drawn: np.ndarray, size: int) -> np.ndarray:
    """A drawn object [S, S, 4] (linear radiance, coverage) of more pixels, bilinearly; unchanged if it has them."""
    if drawn.shape[0] == size:
        return drawn
    parts = np.concatenate([drawn[..., :3] * drawn[..., 3:], drawn[..., 3:]], axis=-1).astype(np.float32)
    channels = [Image.fromarray(np.ascontiguousarray(parts[..., k])) for k in range(4)]
    larger = np.stack(
        [np.asarray(one.resize((size, size), Image.Resampling.BILINEAR)) for one in channels], axis=-1
    )
    larger[..., :3] /= np.maximum(larger[..., 3:], 1e-6)
    return larger


RENDERERS = ("auto", "own", "mitsuba")

NOT_BESIDE = {Side.front: "in front of it", Side.behind: "behind it"}
"""Said of a place that was not asked for."""

PHOTO_MATERIAL = "photo"
"""The real object's own, as estimated from the photo (relight.appearance)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Arrangement:
    """Where the virtual object stands, in the units of relight.ground.

    size: its height over the real object's. at: x, y of its foot in the photo [px], None for
    beside the real object. turn_deg: about its vertical axis. pitch_deg: how far the camera looks
    down, None for level or as far as the object's base asks.
    """

    size: float = 0.5
    at: tuple[float, float] | None = None
    turn_deg: float = 0.0
    pitch_deg: float | None = None


class Stage:
    """A photo with a place on its ground; renders many materials and lights of one object."""

    def __init__(self, photo: Photo, mesh: Mesh, arrangement: Arrangement | None = None) -> None:
        arrangement = arrangement or Arrangement()
        if not 0.02 <= arrangement.size <= 20:
            raise InputError(f"--scale: expected 0.02 to 20 times the real object, got {arrangement.size:g}")
        self.photo = photo
        self.view: View
        self.view, pitch_deg = view_of(photo, arrangement.pitch_deg)
        if not np.isfinite(arrangement.turn_deg):
            raise InputError(f"--turn: expected degrees, got {arrangement.turn_deg}")
        self.placement: Placement = place_beside(
            mesh, photo, self.view, pitch_deg, arrangement.size, arrangement.at, arrangement.turn_deg
        )
        if self.placement.mesh.positions[:, 2].max() >= 0:
            raise InputError(
                "--scale: expected an object in front of the camera, got one that reaches behind it; make it smaller "
                "or stand it farther away with --at"
            )
        window = window_surroundings(self.placement, self.view)
        if window is None:
            x, y = self.view.pixels(self.placement.foot[None])[0]
            raise InputError(
                f"--at: expected a place where the photo shows the object, got one around {x:.0f},{y:.0f} of "
                f"{self.view.width} x {self.view.height} pixels; choose another"
            )
        self.window: Window = window

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line each for what of the place is not as one would expect: not beside the real object, or cut off."""
        said = []
        side = self.placement.side
        if side in NOT_BESIDE:
            said.append(
                f"no room beside the object: the inserted one stands {NOT_BESIDE[side]}; choose a place with --at, "
                "or a smaller --scale"
            )
        pixels = self.view.pixels(self.placement.mesh.positions)
        if (pixels < -0.5).any() or (pixels > np.array([self.view.width, self.view.height]) + 0.5).any():
            said.append(
                "part of the inserted object is outside the photo; choose another place with --at or a smaller --scale"
            )
        return tuple(said)

    def on(self, photo: Photo) -> Stage:
        """The same place in another photo of the same camera, a frame of a video."""
        other = copy(self)
        other.photo = photo
        return other

    def shadow(self, radiance: np.ndarray, count: int = NUM_DIRECTIONS, grid: int = GRID) -> GroundShadow:
        """The object's shadow under a map [H, 2H, 3] of the camera's frame."""
        spot = self.placement
        return GroundShadow(spot.mesh, spot.foot, spot.radius, self.view.up, radiance, count, grid)

    def relit(
        self,
        radiance: np.ndarray,
        material: str | Material,
        renderer: str = "auto",
        shadow: GroundShadow | None = None,
        drawn: np.ndarray | None = None,
    ) -> np.ndarray:
        """The photo with the object in it, [H, W, 3] display values in [0, 1].

        Args:
            radiance: [H, 2H, 3], camera frame, the photo's exposure units.
            material: a name that material() takes, or a Material.
            renderer: of RENDERERS; "auto" takes Mitsuba where it is installed.
            shadow, drawn: what shadow(radiance) and draw(...) gave, where they are at hand.
        """

        def shaded() -> np.ndarray:
            return cast_shadow(self.photo, self.view, shadow or self.shadow(radiance))

        with ThreadPoolExecutor(1) as pool:  # while the object is drawn
            picture = pool.submit(shaded)
            drawn = self.draw(radiance, material, renderer) if drawn is None else drawn
        return lay_over(picture.result(), drawn, self.window, self.photo, behind=self._behind())

    def draw(self, radiance: np.ndarray, material: str | Material, renderer: str = "auto") -> np.ndarray:
        """The object alone in its window, [S, S, 4] as render.picture.draw_mesh has it; see relit."""
        if isinstance(material, str):
            material = self.material(material, radiance)
        mesh, camera = self.placement.mesh, self.window.camera
        camera = replace(camera, size=min(camera.size, MOST_DRAWN))
        if uses_mitsuba(renderer):
            paths = min(NUM_PATHS, MOST_PATHS // camera.size**2)
            drawn = trace_mesh(mesh, camera, radiance, material, self._ground(radiance), paths)
        else:
            finer = {} if camera.size == self.window.camera.size else {"supersample": ENLARGED_SUPERSAMPLE}
            drawn = draw_mesh(mesh, camera, radiance, material, **finer)
        return enlarged(drawn, self.window.size)

    def material(self, name: str, radiance: np.ndarray) -> Material:
        """A material of scatter.materials, or "photo": the real object's own under a map."""
        if name == PHOTO_MATERIAL:
            return material_from_photo(self.photo, radiance)
        return material_named(name, PHOTO_MATERIAL)

    def _behind(self) -> bool:
        """Whether the real object's base is nearer to the camera, that is lower in the picture."""
        foot_row = self.view.pixels(self.placement.mesh.positions)[:, 1].max()
        rows = np.flatnonzero((self.photo.mask > 0.5).any(axis=1))
        return len(rows) > 0 and bool(foot_row < rows[-1])  # a video's frame may have no mask

    def _ground(self, radiance: np.ndarray) -> Ground:
        """A ground whose radiance under the map is what the photo shows around the object's foot."""
        foot, reach = self.placement.foot, 2 * self.placement.radius
        colors = [self.photo.rgb[-1]]
        for strip, ground in self.view.ground_strips(self.view.part_around(foot, reach)):
            near = (np.linalg.norm(ground - foot, axis=-1) < reach) & (self.photo.mask[strip] < 0.05)
            colors.append(self.photo.rgb[strip][near])
        seen = np.concatenate(colors[1:]) if any(len(one) for one in colors[1:]) else colors[0]
        irradiance = np.maximum(sky_irradiance(radiance, self.view.up), 1e-6)
        albedo = np.clip(np.pi * inverse_response(seen).mean(axis=0) / irradiance, 0.0, 0.95)
        radius = GROUND_RADII * self.placement.radius
        return Ground(foot=foot, up=self.view.up, radius=radius, albedo=albedo)


def uses_mitsuba(renderer: str) -> bool:
    """Whether a renderer of RENDERERS is Mitsuba here and now.

    Raises:
        InputError: no such renderer. MissingExtra: "mitsuba" where it cannot run.
    """
    if renderer not in RENDERERS:
        raise InputError(f"--renderer: expected one of {', '.join(RENDERERS)}, got {renderer!r}")
    if renderer == "own":
        return False
    try:
        open_mitsuba()
    except MissingExtra:
        if renderer == "mitsuba":
            raise
        return False
    return True
