"""Shapes that stand on y = 0, seen by three cameras each: rasterised once, kept in a folder, more as training goes on.

Shape number k is a function of (its part, k) alone, and so is each file of SHAPES of them: whoever needs a file that is
missing makes it.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from anyprobe.core.frames import normalize, world_from_camera
from anyprobe.files.objects import MESH_SUFFIXES, read_mesh
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Surface, frame_object, see
from anyprobe.render.voxels import SIDE as CELLS
from anyprobe.render.voxels import voxelize
from anyprobe_train.dataset.catalog import allows_commercial_use, listed_rows
from anyprobe_train.dataset.drawn_shapes import draw_shape, figure, part, stretched, transformed, waved
from anyprobe_train.world.kept import kept
from anyprobe_train.world.march import hidden_bits

VERSION = 3
"""Raised whenever the same shape number would give other views."""
SEEN_PX, COARSE = 96, 48
"""Sides of what is kept of a view, and of where cells are."""
MARGIN = 1.06
"""Side of a view over the longer side of the object's box."""
VIEW_AZIMUTHS, VIEW_RINGS = 16, 8
SHAPES, CAMERAS = 16, 3
"""Shapes in a file, and cameras that see each."""
PITCH_DEG = (1.0, 80.0)
TANGENT = (0.05, 0.62)
"""Bounds of the tangent that the unit sphere is seen under; even in the logarithm."""
KINDS = (0.64, 0.12, 0.12, 0.12)
"""Shares of real shapes, single solids, figures of several, and machined parts."""
STRETCH, BEND, RELIEF = 0.16, 0.35, 0.3
"""How real shapes, solids and figures are deformed, most of them: standard deviation of ln of what stretches them along
three random directions; largest slopes of the slow waves that bend them and of the fast ones that emboss them."""
AS_IS = 0.35
OWN = 0.055
"""Distance [radii] from the object's surface at which rays start, so that they leave the cells it lies in."""

VIEW = np.dtype(
    [
        ("normals", "i1", (SEEN_PX, SEEN_PX, 3)),
        ("depth", "f2", (SEEN_PX, SEEN_PX)),
        ("cover", "u1", (SEEN_PX, SEEN_PX)),
        ("hidden", "u8", (COARSE, COARSE, 2)),
        ("words", "u8", (CELLS, CELLS)),
        ("low", "f4", 3),
        ("cell", "f4", 3),
        ("camera", "f4", (3, 3)),
        ("eye", "f4", 3),
        ("tangent", "f4"),
        ("top", "f4"),
        ("shape", "i4"),
    ]
)
"""A view: normals x 127 in the camera's frame; depth along its axis less |eye - middle|; cover 0 to 255; hidden: bits
of the cells of `cell_middles`, in the world's frame, that the object hides from itself; words, low, cell of
render.voxels; camera: world_from_camera; tangent: of half the side; top: greatest y; shape: its number."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ShapeFiles:
    """The shapes of a part of the data: paths of meshes; part: its name."""

    part: str
    paths: tuple[Path, ...]


def shape_files(data: Path, part: str) -> ShapeFiles:
    """List the meshes that shipped weights may learn from ("train"), or those that they may not ("left-out")."""
    rows = listed_rows(data / "meshes" / "train", MESH_SUFFIXES)
    wanted = part == "train"
    return ShapeFiles(part=part, paths=tuple(p for p, row in rows if allows_commercial_use(row["licence"]) == wanted))


def cell_middles() -> np.ndarray:
    """Return the middles of the cells about +Y, [VIEW_RINGS * VIEW_AZIMUTHS, 3] float32; the lower half first."""
    ring, azimuth = np.divmod(np.arange(VIEW_RINGS * VIEW_AZIMUTHS), VIEW_AZIMUTHS)
    sine, angle = (ring + 0.5) * (2 / VIEW_RINGS) - 1, (azimuth + 0.5) * (2 * np.pi / VIEW_AZIMUTHS)
    cosine = np.sqrt(1 - sine**2)
    return np.stack([cosine * np.sin(angle), sine, -cosine * np.cos(angle)], axis=-1).astype(np.float32)


def draw_mesh(files: ShapeFiles, rng: np.random.Generator) -> Mesh:
    """Draw a shape, in the unit sphere."""
    kind = rng.choice(len(KINDS), p=KINDS) if files.part == "train" else 0
    if kind == 3:
        return part(rng)
    mesh = read_mesh(files.paths[rng.integers(len(files.paths))]) if kind == 0 else (draw_shape, figure)[kind - 1](rng)
    if rng.random() < AS_IS:
        return mesh
    slow, fast = _waves(rng, 3, (0.8, 3.0), BEND), _waves(rng, 3, (5.0, 18.0), RELIEF)
    mesh = waved(mesh, *(np.concatenate(pair) for pair in zip(slow, fast, strict=True)))
    return transformed(mesh, stretched(STRETCH, rng))


def _waves(
    rng: np.random.Generator, count: int, frequency: tuple[float, float], max_slope: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw pushes, waves [count, 3] and phases [count] for `waved`, whose slopes sum to at most max_slope."""
    along = normalize(rng.normal(size=(count, 3)))
    waves = along * np.exp(rng.uniform(np.log(frequency[0]), np.log(frequency[1]), size=(count, 1)))
    slopes = rng.dirichlet(np.ones(count)) * rng.uniform(0.0, max_slope)
    pushes = normalize(rng.normal(size=(count, 3))) * (slopes / np.linalg.norm(waves, axis=1))[:, None]
    return pushes, waves, rng.uniform(0, 2 * np.pi, count)


def standing_mesh(files: ShapeFiles, rng: np.random.Generator) -> Mesh:
    """Draw a shape, its middle over the origin and its lowest point on y = 0."""
    mesh = draw_mesh(files, rng)
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(mesh, positions=(mesh.positions - foot).astype(np.float32))


def shape_rng(files: ShapeFiles, number: int) -> np.random.Generator:
    """Return what shape `number` and its views are drawn by."""
    return np.random.default_rng((VERSION, len(files.part), number))


def shape_views(files: ShapeFiles, number: int) -> np.ndarray:
    """Return the views [CAMERAS] VIEW of shape `number`."""
    rng = shape_rng(files, number)
    standing = standing_mesh(files, rng)
    high = standing.positions.max(axis=0)
    voxels = voxelize(standing)
    middle = np.array([0.0, high[1] / 2, 0.0])
    centred = replace(standing, positions=standing.positions - middle)
    result = np.zeros(CAMERAS, VIEW)
    for view in result:
        sine = rng.uniform(*np.sin(np.radians(PITCH_DEG)))
        rotation = world_from_camera(rng.uniform(0, 2 * np.pi), float(np.arcsin(sine)))
        fov_deg = 2 * np.degrees(np.arctan(np.exp(rng.uniform(*np.log(TANGENT)))))
        camera = frame_object(centred, rotation, fov_deg, MARGIN, 2 * SEEN_PX)
        cover, normals, depth = _pooled(see(centred, camera))
        view["cover"], view["normals"] = cover, np.round(127 * normals)
        view["eye"] = camera.position + middle
        view["depth"] = np.where(cover > 0, depth[..., 0] - np.linalg.norm(view["eye"]), 0.0)
        view["camera"], view["tangent"] = camera.world_from_camera, camera.tan_half
        view["words"], view["low"], view["cell"] = voxels.words, voxels.low, voxels.cell
        view["top"], view["shape"] = high[1], number
        view["hidden"] = _hidden(view, int(rng.integers(2**31)))
    return result


def _pooled(surface: Surface) -> tuple[np.ndarray, ...]:
    """Return cover [SEEN_PX, SEEN_PX] uint8, and normals in the camera's frame and depth of the nearest of each pixel's
    four points."""
    normals = np.zeros((*surface.mask.shape, 3), np.float32)
    depth = np.full(surface.mask.shape, np.inf)
    normals[surface.mask], depth[surface.mask] = surface.normals, surface.depth

    def four(values: np.ndarray) -> np.ndarray:
        return values.reshape(SEEN_PX, 2, SEEN_PX, 2, -1).transpose(0, 2, 1, 3, 4).reshape(SEEN_PX, SEEN_PX, 4, -1)

    near = four(depth)[..., 0].argmin(axis=2)[..., None, None]
    nearest = (np.take_along_axis(four(one), near, axis=2)[:, :, 0] for one in (normals, depth))
    cover = np.round(255 * four(surface.mask.astype(np.float32)).mean(axis=2)[..., 0]).astype(np.uint8)
    return cover, *nearest


def view_points(view: np.void) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return row and column numbers, points and normals [N, 3] in the world's frame of a view's covered pixels."""
    rows, columns = np.nonzero(view["cover"])
    camera = view["camera"]
    n = view["normals"][rows, columns].astype(np.float32)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1.0)
    depth = view["depth"][rows, columns].astype(np.float32) + np.linalg.norm(view["eye"])
    x, y = ((one.astype(np.float32) * (2 / SEEN_PX) + (1 / SEEN_PX - 1)) * view["tangent"] for one in (columns, rows))
    plane = np.stack([x, -y, -np.ones_like(x)], axis=1)
    points = view["eye"] + (plane * depth[:, None]) @ camera.T
    return rows, columns, points.astype(np.float32), n @ camera.T


def _hidden(view: np.void, seed: int) -> np.ndarray:
    """Return bits [COARSE, COARSE, 2] of the cells that the object hides from itself."""
    rows, columns, points, normals = view_points(view)
    half = SEEN_PX // COARSE
    place = (rows // half) * COARSE + columns // half
    _, first = np.unique(place, return_index=True)
    result = np.zeros((COARSE * COARSE, 2), np.uint64)
    shape = view["words"], view["low"], view["cell"]
    result[place[first]] = hidden_bits(*shape, points[first], normals[first], VIEW_AZIMUTHS, VIEW_RINGS, OWN, seed)
    return result.reshape(COARSE, COARSE, 2)


class Views:
    """Views in files of a folder, each of SHAPES * CAMERAS, made where they are missing."""

    def __init__(self, files: ShapeFiles, cache: Path) -> None:
        """Keep where files are; none is made yet."""
        self.files, self.folder = files, cache / f"views-{VERSION}-{files.part}"
        self._open: dict[int, np.ndarray] = {}

    def __getitem__(self, number: int) -> np.void:
        """Return view `number`."""
        which, row = divmod(number, SHAPES * CAMERAS)
        if which not in self._open:
            numbers = range(which * SHAPES, (which + 1) * SHAPES)
            self._open[which] = kept(
                self.folder / f"{which:05d}.npy",
                lambda: np.concatenate([shape_views(self.files, number) for number in numbers]),
            )
        return self._open[which][row]
