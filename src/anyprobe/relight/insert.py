"""Insertion of a virtual object beside the real one of a photo, under the estimated light."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

from anyprobe.core.camera import MOST_STRETCH
from anyprobe.core.color import luminance
from anyprobe.core.resample import resample
from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InputError
from anyprobe.estimate.ground import Ground
from anyprobe.estimate.normals_hint import Part
from anyprobe.estimate.photo import Photo
from anyprobe.light.light_sources import softened_light
from anyprobe.notices import Notice, give
from anyprobe.relight.appearance import material_from_photo
from anyprobe.relight.camera_look import DRAWN_BLUR, CameraLook, blurred, grain_over, look_of
from anyprobe.relight.ground_view import View, view_of
from anyprobe.relight.near_ground import GroundPicture, Surroundings, draw_on_ground, hides_shadows, seen_ground
from anyprobe.relight.placement import Placement, check_foot, place_beside, real_body
from anyprobe.relight.shadow import NUM_DIRECTIONS, SHADOW_CELLS, GroundShadow
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera
from anyprobe.scatter.materials import Material, material_named

PERSPECTIVE, BILINEAR = Image.Transform.PERSPECTIVE, Image.Resampling.BILINEAR
BORDER_PX = 2
"""Border [px] around the object's window, for its soft edge."""
MOST_DRAWN = 512
"""Largest size [px] that an object is drawn at; in larger photos, whose pixels are hardly sharper, it is enlarged."""
ENLARGED_SUPERSAMPLE = 2
"""Samples of a pixel, along a side, of an object that is enlarged."""
LEAST_SINE = 1e-4
"""Smallest sine below the horizon, times the ray's length, of a pixel that shows ground."""
MIRRORED_DIRECTIONS, MIRRORED_GRID = 32, 64
"""Number of directions and grid side of the shadow on the ground that an object mirrors."""
MOST_WHITE = 0.1
"""Largest share of an object's pixels, of a material that is no metal, that may be brighter than the photo's white."""
LEAST_SHADOW = 1 / 1024
"""Smallest visible shadow, a quarter of a display step; weaker ones leave the photo unchanged."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectWindow:
    """Square part of the photo that the object covers: its corner and side [px], and its camera."""

    left: int
    top: int
    size: int
    camera: Camera

    def part(self, height: int, width: int) -> Part:
        """Return the slices of a photo of this size that show it."""
        bottom, right = self.top + self.size, self.left + self.size
        return slice(max(self.top, 0), min(bottom, height)), slice(max(self.left, 0), min(right, width))

    def shown(self, drawn: np.ndarray, mask: np.ndarray, behind: bool) -> tuple[Part, np.ndarray, np.ndarray]:
        """Return what a photo shows of an object drawn in the window [S, S, 4]: its part of the photo, radiance [R, C,
        3], coverage [R, C, 1]; mask: [H, W], that of the real object, which occludes it if it is behind."""
        height, width = mask.shape
        shown = self.part(height, width)
        drawn = drawn[within(shown, (slice(self.top, height), slice(self.left, width)))]
        return shown, drawn[..., :3], drawn[..., 3:] * (1.0 - mask[shown][..., None] if behind else 1.0)


def window_of(placement: Placement, view: View) -> ObjectWindow | None:
    """Return the smallest square of whole pixels around the visible part of the object; None if nothing is visible."""
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
        center=(float((middle[0] - view.width / 2) / view.focal), float((view.height / 2 - middle[1]) / view.focal)),
    )
    return ObjectWindow(left=int(low[0]), top=int(low[1]), size=size, camera=camera)


def cast_shadow(photo: Photo, view: View, shadow: GroundShadow, part: Part | None = None) -> np.ndarray:
    """Return a part of the photo [R, C, 3], or all of it, with the shadow on its ground.

    The real object and everything above the horizon stay unshadowed; pixels that lose nothing keep their bits. Only the
    pixels that show the shadow's square are read, and the part must contain them.
    """
    part = part or (slice(0, view.height), slice(0, view.width))
    picture = photo.rgb[part].copy()
    for strip in view.strips(view.part_around(shadow.foot, shadow.reach)):
        ratio = 1.0 - (1.0 - transmittance(view, shadow, strip)) * (1.0 - photo.mask[strip][..., None])
        touched = np.asarray((np.abs(ratio - 1.0) > LEAST_SHADOW).any(axis=-1))
        under = picture[within(strip, part)]
        at = tuple(side.start + index for side, index in zip(strip, np.nonzero(touched), strict=True))
        under[touched] = response(photo.linear(at) * ratio[touched])
    return picture


def transmittance(view: View, shadow: GroundShadow, part: Part) -> np.ndarray:
    """Return a shadow's transmittance in a part of the photo, [R, C, 3] float32; 1 above the horizon.

    A plane's picture is a homography of it: column, row and 1 of the shadow's grid, times the sine of the ray below the
    horizon, are linear in the photo's pixels.
    """
    rows, columns = part
    corners = view.rays(columns.start + np.array([0, 1, 0]), rows.start + np.array([0, 0, 1]))
    down = -(corners @ view.up)
    half = shadow.grid / 2
    sides = (shadow.side, shadow.across)
    cells = [(corners @ side - down * (shadow.foot @ side)) * half / shadow.reach + half * down for side in sides]
    first, *steps = np.stack([*cells, down], axis=-1)
    right, below = (one - first for one in steps)
    data = [number for k in (0, 1) for number in (right[k], below[k], first[k])] + [right[2], below[2]]
    size = columns.stop - columns.start, rows.stop - rows.start
    numbers = [one / first[2] for one in data]
    grids = (np.ascontiguousarray(1.0 - shadow.ratio[..., k], np.float32) for k in range(3))
    pictures = (Image.fromarray(grid).transform(size, PERSPECTIVE, numbers, BILINEAR) for grid in grids)
    lost = np.stack([np.asarray(picture) for picture in pictures], axis=-1)
    y, x = (0.5 + axis for axis in np.ogrid[: size[1], : size[0]])
    is_ground = first[2] + right[2] * x + below[2] * y > LEAST_SINE
    return 1.0 - np.where(is_ground[..., None], lost, np.float32(0.0))


def within(part: Part, outer: Part) -> Part:
    """Convert rows and columns of the photo to those of a part of it."""
    sides = zip(part, outer, strict=True)
    rows, columns = (slice(side.start - whole.start, side.stop - whole.start) for side, whole in sides)
    return rows, columns


def lay_object_over(
    picture: np.ndarray,
    part: Part,
    drawn: np.ndarray,
    window: ObjectWindow,
    photo: Photo,
    behind: bool = False,
    look: CameraLook | None = None,
) -> None:
    """Composite an object [S, S, 4] (linear radiance, coverage) over a part of a display picture, in place.

    Edges are mixed in linear light, as in compositors.

    Args:
        picture: [R, C, 3], those rows and columns of the photo; contains the window's visible part.
        behind: whether the real object occludes it.
        look: the photo's, whose grain it gets; None: no grain.
    """
    shown, color, coverage = window.shown(drawn, photo.mask, behind)
    under = picture[within(shown, part)]
    on = (coverage > 0)[..., 0]
    covered, behind_it = coverage[on], inverse_response(under[on])
    mixed = response(behind_it + covered * (color[on] - behind_it))
    if look is not None and look.grain > 0:
        mixed = np.clip(mixed + covered * grain_over(on.shape, look, photo)[on], 0.0, 1.0)
    under[on] = mixed


def mean_radiance(drawn: np.ndarray) -> np.ndarray:
    """Return the mean radiance [3] of a drawn object's lower half, which the ground sees, [S, S, 4]; highlights as
    white."""
    rows = np.flatnonzero(drawn[..., 3].any(axis=1))
    drawn = drawn[int(rows.mean()) if len(rows) else 0 :]
    coverage = drawn[..., 3:]
    return (np.minimum(drawn[..., :3], 1.0) * coverage).sum(axis=(0, 1)) / max(float(coverage.sum()), 1e-6)


def enlarged(drawn: np.ndarray, size: int) -> np.ndarray:
    """Enlarge a drawn object [S, S, 4] (linear radiance, coverage) bilinearly; unchanged if it is that large."""
    if drawn.shape[0] == size:
        return drawn
    parts = np.concatenate([drawn[..., :3] * drawn[..., 3:], drawn[..., 3:]], axis=-1).astype(np.float32)
    larger = resample(parts, (size, size), smooth=True)
    larger[..., :3] /= np.maximum(larger[..., 3:], 1e-6)
    return larger


PHOTO_MATERIAL = "photo"
"""Material name of the real object's own, as estimated from the photo (relight.appearance)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Arrangement:
    """Place of the virtual object.

    size: its height over the real object's. at: x, y of its foot in the photo [px]; None: beside the real object.
    turn_deg: rotation about its vertical axis. pitch_deg: camera pitch downwards; None: the ground's.
    ground, long_fov_deg: the photo's ground and lens as estimated (Light.ground, Light.origin); None: guessed, and the
    photo's. toward_light: direction of the dominant light in the camera's frame, so that the object is not put into the
    real one's shadow; None: not known. likely: probability that it shines from there.
    """

    size: float = 0.5
    at: tuple[float, float] | None = None
    turn_deg: float = 0.0
    pitch_deg: float | None = None
    ground: Ground | None = None
    long_fov_deg: float | None = None
    toward_light: np.ndarray | None = None
    likely: float = 1.0

    def __post_init__(self) -> None:
        if not 0.02 <= self.size <= 20:
            raise InputError(f"expected 0.02 to 20 times the real object, got {self.size:g}", subject="size")
        if not np.isfinite(self.turn_deg):
            raise InputError(f"expected degrees, got {self.turn_deg}", subject="turn_deg")


class Stage:
    """A photo with a place on its ground; renders many materials and lights of one object."""

    def __init__(self, photo: Photo, mesh: Mesh, arrangement: Arrangement | None = None) -> None:
        given = arrangement or Arrangement()
        check_foot(given.at, *photo.mask.shape)
        self.photo, self.likely = photo, given.likely
        self.view, pitch_deg = view_of(photo, given.pitch_deg, given.ground, given.long_fov_deg)
        self.placement: Placement = place_beside(
            mesh, photo, self.view, pitch_deg, given.size, given.at, given.turn_deg, given.toward_light
        )
        if self.placement.mesh.positions[:, 2].max() >= 0:
            text = "the object reaches behind the camera; make it smaller or place it farther away"
            raise InputError(text, subject="size")
        if (window := window_of(self.placement, self.view)) is None:
            raise InputError("the photo shows nothing of the object there; choose another place", subject="at")
        self.window: ObjectWindow = window
        self.look: CameraLook = look_of(photo)
        self.shows_ground: bool = photo.shows_place and photo.plate() is not None
        """Whether the photo is no cut-out, so that its ground shows the real object's shadow."""
        self.stops_down = 0.0
        """Most that a material drawn so far was exposed down, so that it is not white all over."""

    @property
    def warnings(self) -> tuple[Notice, ...]:
        """One line for each surprise about the place."""
        lines: list[tuple[str, tuple[str, ...]]] = []
        if self.placement.is_in_front:
            lines.append(("no room beside the object: the inserted one stands in front of it", ("at", "size")))
        if hides_shadows(self.photo, self.view, self.placement):
            text = "the ground is so dark there that its shadow hardly shows"
            lines.append((f"{text}: the inserted object may seem to float", ("at",)))
        pixels = self.view.pixels(self.placement.mesh.positions)
        if (pixels < -0.5).any() or (pixels > np.array([self.view.width, self.view.height]) + 0.5).any():
            lines.append(("part of the inserted object is outside the photo", ("at", "size")))
        if (stretch := self.view.stretch(*pixels.mean(axis=0))) > MOST_STRETCH:
            text = f"spheres are {stretch - 1:.0%} longer than wide there, at {self.view.long_fov_deg:.0f} degrees"
            lines.append((text, ("at", "fov_deg") if self.photo.fov_source == "default" else ("at",)))
        if self.stops_down > 0:
            text = f"the material is too bright for the photo's exposure, and drawn {self.stops_down:.1f} stops darker"
            lines.append((text, ("insert_material",)))
        if (self.photo.mask[-1] > 0.5).any():
            text = "the photo's lower border cuts the real object, so where it touches the ground is not seen"
            lines.append((text, ("at",)))
        return tuple(Notice(text, code="doubt", remedy=give(*names)) for text, names in lines)

    def on(self, photo: Photo) -> Stage:
        """Return the stage in another photo of the same camera, a frame of a video."""
        other = copy(self)
        other.photo = photo
        return other

    def shadow(self, radiance: np.ndarray, count: int = NUM_DIRECTIONS, grid: int = SHADOW_CELLS) -> GroundShadow:
        """Return the object's shadow under a map [H, 2H, 3] of the camera's frame, of light the real one lets pass, and
        as deep as the real one's where the photo shows that."""
        spot, beside = self.placement, self._real()
        shadow = GroundShadow(spot.mesh, spot.foot, spot.radius, self.view.up, radiance, count, grid, beside=beside)
        seen = seen_ground(self.photo, self.view, shadow.points(shadow.grid)) if self.shows_ground else None
        return shadow.as_seen(self.likely, seen)

    def _real(self) -> Mesh | None:
        return real_body(self.photo, self.view, self.placement)

    def relit(
        self,
        radiance: np.ndarray,
        material: str | Material,
        shadow: GroundShadow | None = None,
        drawn: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the photo with the object in it, [H, W, 3] display values in [0, 1]; see change for the arguments."""
        part, changed = self.change(radiance, material, shadow, drawn)
        picture = self.photo.rgb.copy()
        picture[part] = changed
        return picture

    def change(
        self,
        radiance: np.ndarray,
        material: str | Material,
        shadow: GroundShadow | None = None,
        drawn: np.ndarray | None = None,
    ) -> tuple[Part, np.ndarray]:
        """Return the rows and columns that object and shadow may change, and the new pixels there, [R, C, 3].

        Args:
            radiance: [H, 2H, 3], camera frame, the photo's exposure units.
            material: a name for material(), or a Material.
            shadow: result of shadow(radiance), if already computed.
            drawn: result of draw(...), if already drawn.
        """
        with ThreadPoolExecutor(1) as pool:  # while the object is drawn
            shading = pool.submit(lambda: shadow or self.shadow(radiance))
            drawn = self.draw(radiance, material, shadow) if drawn is None else drawn
        cast = shading.result().with_light(mean_radiance(drawn))
        both = self.view.part_around(cast.foot, cast.reach), self.window.part(*self.photo.mask.shape)
        rows, columns = (slice(min(a.start, b.start), max(a.stop, b.stop)) for a, b in zip(*both, strict=True))
        part = rows, columns
        picture = cast_shadow(self.photo, self.view, cast, part)
        lay_object_over(picture, part, drawn, self.window, self.photo, behind=self.is_behind(), look=self.look)
        return part, picture

    def draw(self, radiance: np.ndarray, material: str | Material, shadow: GroundShadow | None = None) -> np.ndarray:
        """Draw the object alone in its window, [S, S, 4] as render.picture.draw_mesh returns it; see relit.

        shadow: for the ground that it mirrors, if already computed.
        """
        if isinstance(material, str):
            material = self.material(material, radiance)
        camera = replace(self.window.camera, size=min(self.window.camera.size, MOST_DRAWN))
        finer = {} if camera.size == self.window.camera.size else {"supersample": ENLARGED_SUPERSAMPLE}
        cast = self.shadow(radiance, MIRRORED_DIRECTIONS, MIRRORED_GRID) if shadow is None else shadow
        if self.likely < 1.0 and np.any(material.albedo):
            radiance = softened_light(radiance, self.likely)
        ground = GroundPicture(self.photo, self.view, radiance)
        drawn = draw_on_ground(Surroundings(ground, self.placement, cast, self._real(), material), camera, **finer)
        if np.any(material.albedo) and (drawn[..., 3] > 0).any():
            white = max(1.0, float(np.quantile(luminance(drawn[drawn[..., 3] > 0][:, :3]), 1.0 - MOST_WHITE)))
            drawn[..., :3] /= white
            self.stops_down = max(self.stops_down, float(np.log2(white)))
        own = max(DRAWN_BLUR, 0.5 * self.window.size / camera.size)
        return blurred(enlarged(drawn, self.window.size), self.look, own)

    def material(self, name: str, radiance: np.ndarray) -> Material:
        """Return a material of scatter.materials, or "photo": the real object's own under a map."""
        if name == PHOTO_MATERIAL:
            return material_from_photo(self.photo, radiance)
        return material_named(name, PHOTO_MATERIAL)

    def is_behind(self) -> bool:
        """Return whether the real object's base is nearer to the camera, i.e. lower in the picture."""
        foot_row = self.view.pixels(self.placement.mesh.positions)[:, 1].max()
        rows = np.flatnonzero((self.photo.mask > 0.5).any(axis=1))
        return len(rows) > 0 and bool(foot_row < rows[-1])  # a video's frame may have no mask
