"""Camera and Surface: which pixels see the object, with which normal and view direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core import Float
from anyprobe.core.frames import turn_towards
from anyprobe.render.mesh import Mesh

CRACKS = 0.01
"""Share of an object's pixels that may show the back of a face without its normal being flipped.

Cracks of nearly closed meshes always show a few; flipping these would change data that is already rendered.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Camera:
    """A square pinhole picture.

    world_from_camera: [3, 3] rotation; position: [3] in the world.
    tan_half: tangent of half the field of view.
    center: x right, y up of the picture's centre on the plane at depth 1; if not (0, 0), the picture is a window of a
        larger one, whose pixels it shares.
    """

    world_from_camera: np.ndarray
    position: np.ndarray
    tan_half: float
    size: int = 128
    center: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Surface:
    """Visible points of an object, in the camera's frame.

    mask: [S, S] bool; normals, wo: [P, 3] for the P pixels in the mask, row by row; depth: [P], along the camera's
    axis.
    """

    mask: np.ndarray
    normals: np.ndarray
    wo: np.ndarray
    tan_half: float
    depth: np.ndarray


def pixel_rays(tan_half: float, size: int, center: tuple[float, float] = (0.0, 0.0)) -> Float[np.ndarray, "S S 3"]:
    """Return wo [S, S, 3] of every pixel: from the point towards the eye, camera frame."""
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * tan_half
    right, up = np.meshgrid(center[0] + x, center[1] - x)
    ray = np.stack([-right, -up, np.ones_like(right)], axis=-1)
    return (ray / np.linalg.norm(ray, axis=-1, keepdims=True)).astype(np.float32)


def frame_object(
    mesh: Mesh, world_from_camera: Float[np.ndarray, "3 3"], fov_deg: float, margin: float = 1.1, size: int = 128
) -> Camera:
    """Place a camera so that the unit sphere fills fov_deg, turn it to the object and crop to it.

    The window matches a crop of a photo: its centre is the centre of the object's
    bounding box, its side margin times the box's longer side.
    """
    position = world_from_camera @ np.array([0.0, 0.0, 1.0 / np.sin(np.radians(fov_deg) / 2)])
    rotation = world_from_camera
    for _ in range(3):  # the box changes a little as the camera turns
        projected = _project(mesh.positions, rotation, position)
        low, high = projected[:, :2].min(axis=0), projected[:, :2].max(axis=0)
        centre = (low + high) / 2
        rotation = rotation @ turn_towards(np.array([centre[0], centre[1], -1.0]))
    tan_half = float((high - low).max() / 2 * margin)
    return Camera(world_from_camera=rotation, position=position, tan_half=tan_half, size=size)


def _project(points: np.ndarray, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Project world points to (x / depth, y / depth, 1 / depth), [V, 3]."""
    in_camera = (points - position) @ rotation
    inverse = 1.0 / np.maximum(-in_camera[:, 2], 1e-6)  # behind the eye: far outside the picture
    return np.stack([in_camera[:, 0] * inverse, in_camera[:, 1] * inverse, inverse], axis=-1)


def see(mesh: Mesh, camera: Camera) -> Surface:
    """Rasterise with a depth buffer; normals interpolated perspective-correctly.

    Faces seen from behind (open meshes, cards, meshes of the opposite winding) have the normals of the visible side;
    see CRACKS. Normals that the interpolation turned away from the eye are bent back to the silhouette, so that n.wo >
    0 everywhere.
    """
    size = camera.size
    projected = _project(mesh.positions, camera.world_from_camera, camera.position)
    x, y = ((projected[:, i] - camera.center[i]) / camera.tan_half for i in (0, 1))
    screen = np.stack([(x + 1) * size / 2, (1 - y) * size / 2], axis=-1)
    triangle, weights, pixel = cover(screen[mesh.faces], size)
    weights = weights * projected[:, 2][mesh.faces[triangle]]
    depth_key = weights.sum(axis=1)
    order = np.argsort(depth_key, kind="stable")  # nearest last: it wins the assignment
    nearest = np.full(size * size, -1, dtype=np.int64)
    nearest[pixel[order]] = order
    seen = np.nonzero(nearest >= 0)[0]
    hit = nearest[seen]
    barycentric = weights[hit] / depth_key[hit][:, None]
    normals = (mesh.normals[triangle[hit]] * barycentric[:, :, None]).sum(axis=1) @ camera.world_from_camera
    corners = screen[mesh.faces[triangle[hit]]]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    behind = ax * by - ay * bx > 0  # clockwise in the picture, whose y is down
    if behind.sum() > CRACKS * len(hit):
        normals[behind] *= -1.0
    wo = pixel_rays(camera.tan_half, size, camera.center).reshape(-1, 3)[seen]
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    facing = (normals * wo).sum(axis=1, keepdims=True)
    normals = np.where(facing < 0.01, normals + (0.02 - facing) * wo, normals)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    mask = np.zeros(size * size, dtype=bool)
    mask[seen] = True
    return Surface(
        mask=mask.reshape(size, size),
        normals=normals.astype(np.float32),
        wo=wo,
        tan_half=camera.tan_half,
        depth=(1.0 / depth_key[hit]).astype(np.float32),
    )


def cover(corners: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """List pixel centres inside each triangle: (triangle [K], barycentric weights [K, 3], pixel [K]).

    Triangles are grouped by bounding-box size, each group in one array operation.
    """
    low = np.ceil(corners.min(axis=1) - 0.5).astype(np.int64)  # a centre on the box's side is inside
    high = np.floor(corners.max(axis=1) - 0.5).astype(np.int64) + 1
    low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    extent = (high - low).max(axis=1)
    visible = ((high - low) > 0).all(axis=1)
    found = []
    side = 1
    while side < 2 * size:
        members = np.nonzero(visible & (extent <= side) & (extent > side // 2))[0]
        for some in np.array_split(members, max(1, len(members) * side * side // 2_000_000)):
            if len(some) == 0:
                continue
            step = np.arange(side)
            x = low[some, 0][:, None, None] + step[None, None, :]
            y = low[some, 1][:, None, None] + step[None, :, None]
            px, py = x + 0.5, y + 0.5
            a, b, c = (corners[some, k][:, :, None, None] for k in range(3))
            wa = (b[:, 0] - px) * (c[:, 1] - py) - (b[:, 1] - py) * (c[:, 0] - px)
            wb = (c[:, 0] - px) * (a[:, 1] - py) - (c[:, 1] - py) * (a[:, 0] - px)
            wc = (a[:, 0] - px) * (b[:, 1] - py) - (a[:, 1] - py) * (b[:, 0] - px)
            area = wa + wb + wc
            inside = ((wa * area >= 0) & (wb * area >= 0) & (wc * area >= 0)) & (np.abs(area) > 1e-12)
            inside &= (x < size) & (y < size)
            which, row, column = np.nonzero(inside)
            w = np.stack([wa[inside], wb[inside], wc[inside]], axis=-1) / area[inside][:, None]
            found.append((some[which], w, (low[some[which], 1] + row) * size + low[some[which], 0] + column))
        side *= 2
    if not found:
        return np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0, np.int64)
    face, weights, pixel = (np.concatenate(part) for part in zip(*found, strict=True))
    return face, weights, pixel
