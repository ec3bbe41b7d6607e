"""Inputs and outputs of light.onnx, which holds the whole way from a photo's pixels to its light.

Inputs, float32, of one photo: N = 1.

    photo     [1, H, W, 5]      the photo, at most PHOTO_SIDE pixels long: RGB times cover, as displayed, above 1 linear
                                radiance; cover, 0 where pixels mean nothing; the object's mask. Each is the mean of
                                k x k pixels
    window    [1, h, w, 4]      every s-th pixel around the object, at most WINDOW_SIDE: display RGB, mask
    geometry  [1, 6]            width and height of the full photo, k; left and top of the window in it, s
    lens      [1, 2]            tangent of half the field of view of the longer side; 1 if it is known
    up        [1, 3]            away from the ground, camera frame; zero where it is not known
    normals   [1, n, m, 3]      the object's over the window, camera frame, unit or zero
    material  [1, 8]            of materials.material_input, or zero
    panorama  [1, 64, 128, 4]   known part of the map, camera frame: RGB times cover, cover
    sun       [1, 3]            towards the sun, camera frame, or zero
    believe   [1, 1]            1: the background is used whatever it looks like

Outputs, in the camera's frame but where a name says otherwise: see Said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core import Float
from anyprobe.core.contract import contract
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.masks.check import object_box
from anyprobe.scatter.materials import MATERIAL_INPUTS, Material, material_input

INPUTS = ("photo", "window", "geometry", "lens", "up", "normals", "material", "panorama", "sun", "believe")
OUTPUTS = tuple(
    "radiance confidence sh9 sources soft errors posture field_of_view outdoors believed seen object_normals "
    "object_material crop crop_frame well_exposed".split()
)
PHOTO_SIDE, WINDOW_SIDE = (int(contract("graph")[name]) for name in ("photo_side", "window_side"))
"""Longest sides of the photo and of the window [pixels]."""
SEEN_CONFIDENCE = 0.9
"""Confidence of a place that is seen."""
PLACE: float = contract("graph")["place"]
"""Least share of what is seen beside the object that its surroundings go on from, for it to be their place."""
CROP_MARGIN: float = contract("sizes")["crop_margin"]
"""Side of the square around the object over the longer side of its box."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Said:
    """Outputs of light.onnx for one photo; the paper's chain gives the map, the crop and the irradiance alone.

    Attributes:
        radiance: [64, 128, 3] the map, with all that is seen of it.
        confidence: [64, 128] probability that a pixel's display value is within 0.1 of the truth.
        sh9: [9, 3] of light.harmonics.
        sources: [S, 8] LightSource.exists, direction, angular radius [degrees], power RGB [sr]; the strongest first.
        soft: [1] probability that no source dominates.
        errors: [3] of the strongest source's direction [degrees], of ln of the level, of the mean colour [degrees].
        posture: [3] pitch downwards, roll, and the pitch's mean error [degrees].
        field_of_view: [2] of the longer side, and its mean error [degrees].
        outdoors: [1] probability.
        believed: [1] share of what is seen beside the object that the map goes on from.
        seen: [64, 128, 4] known part of the map: radiance times cover, cover.
        object_normals: [64, 64, 3] over the crop, in its frame.
        object_material: [5] probability of a metal, total reflectance RGB, mean error of its ln.
        crop: [128, 128, 4] the square around the object: RGB times mask, above 1 radiance; mask.
        crop_frame: [4, 3] camera_from_crop; tangent of half the crop's field of view, its centre [px].
        well_exposed: [1] share of the object's pixels.
        irradiance: [128, 128, 3] display, over the crop.
    """

    radiance: np.ndarray
    crop: np.ndarray
    crop_frame: np.ndarray
    irradiance: np.ndarray | None = None
    confidence: np.ndarray | None = None
    sh9: np.ndarray | None = None
    sources: np.ndarray | None = None
    soft: np.ndarray | None = None
    errors: np.ndarray | None = None
    posture: np.ndarray | None = None
    field_of_view: np.ndarray | None = None
    outdoors: np.ndarray | None = None
    believed: np.ndarray | None = None
    seen: np.ndarray | None = None
    object_normals: np.ndarray | None = None
    object_material: np.ndarray | None = None
    well_exposed: np.ndarray | None = None

    @property
    def is_placeless(self) -> bool:
        """Return whether what is seen beside the object is not its place: a cut-out's, a studio's backdrop."""
        return self.believed is None or float(self.believed[0]) <= PLACE

    @property
    def camera_from_crop(self) -> Float[np.ndarray, "3 3"]:
        """Rotation from the frame that looks at the crop's centre along -Z to the camera's."""
        return self.crop_frame[:3].astype(np.float64)

    @property
    def tan_half(self) -> float:
        """Tangent of half the crop's field of view."""
        return float(self.crop_frame[3, 0])

    @property
    def image(self) -> Float[np.ndarray, "128 128 4"]:
        """The crop as a display shows it."""
        return np.concatenate([np.minimum(self.crop[..., :3], self.crop[..., 3:]), self.crop[..., 3:]], axis=-1)


def graph_inputs(
    rgb: Float[np.ndarray, "H W 3"],
    mask: Float[np.ndarray, "H W"],
    long_fov_deg: float,
    *,
    is_lens_known: bool = False,
    cover: Float[np.ndarray, "H W"] | None = None,
    radiance: Float[np.ndarray, "H W 3"] | None = None,
    up: Float[np.ndarray, " 3"] | None = None,
    normals: Float[np.ndarray, "H W 3"] | None = None,
    material: Material | None = None,
    panorama: Float[np.ndarray, "64 128 4"] | None = None,
    believe: bool = False,
) -> dict[str, np.ndarray]:
    """Return INPUTS of one photo.

    Args:
        rgb, mask: the full photo and its object.
        cover: where pixels beside the object may be used; None: everywhere.
        radiance: the photo's, where it holds it above white.
    """
    height, width = mask.shape
    k = -(-max(height, width) // PHOTO_SIDE)
    x0, y0, x1, y1 = window_box(mask)
    s = -(-max(x1 - x0, y1 - y0) // WINDOW_SIDE)
    rows, columns = slice(y0 + s // 2, y1, s), slice(x0 + s // 2, x1, s)
    shown, opaque = _above_white(rgb, radiance), np.broadcast_to(np.float32(1), mask.shape)
    if cover is not None:
        opaque = np.maximum(cover, mask)
        shown = shown * opaque[..., None]
    photo = [block_means(part, k) for part in (shown, opaque, mask)]
    near = [_above_white(rgb[rows, columns], None if radiance is None else radiance[rows, columns])]
    given = np.zeros((1, 1, 3)) if normals is None else normals[rows, columns] * mask[rows, columns, None]
    values = {
        "photo": np.dstack(photo),
        "window": np.dstack([*near, mask[rows, columns]]),
        "geometry": np.array([width, height, k, x0, y0, s]),
        "lens": np.array([np.tan(np.radians(long_fov_deg) / 2), is_lens_known]),
        "up": np.zeros(3) if up is None else up,
        "normals": given,
        "material": np.zeros(MATERIAL_INPUTS) if material is None else material_input(material),
        "panorama": np.zeros((MAP_HEIGHT, 2 * MAP_HEIGHT, 4)) if panorama is None else panorama[..., :4],
        "sun": np.zeros(3),
        "believe": np.array([believe]),
    }
    return {name: np.ascontiguousarray(values[name], np.float32)[None] for name in INPUTS}


def window_box(mask: Float[np.ndarray, "H W"]) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom of the window: the square around the object, as far as the photo goes."""
    height, width = mask.shape
    if not (mask > 0.5).any():
        return 0, 0, 1, 1
    x0, y0, x1, y1 = object_box(mask)
    half = CROP_MARGIN * max(x1 - x0, y1 - y0) / 2
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    least, most = np.floor([x - half, y - half]).astype(int), np.ceil([x + half, y + half]).astype(int)
    return max(least[0], 0), max(least[1], 0), min(most[0], width), min(most[1], height)


def block_means(picture: np.ndarray, k: int) -> np.ndarray:
    """Return means over k x k pixels, [ceil(H / k), ceil(W / k), ...]; the last blocks are cut at the border."""
    if k == 1:
        return picture
    for axis in (0, 1):
        first = np.arange(0, picture.shape[axis], k)
        count = np.minimum(first + k, picture.shape[axis]) - first
        shape = [1] * picture.ndim
        shape[axis] = len(count)
        picture = np.add.reduceat(picture, first, axis=axis, dtype=np.float32) / count.reshape(shape)
    return picture


def _above_white(rgb: np.ndarray, radiance: np.ndarray | None) -> np.ndarray:
    return rgb if radiance is None else np.where(radiance > 1, radiance, rgb)
