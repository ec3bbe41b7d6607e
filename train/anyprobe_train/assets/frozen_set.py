"""The files that the frozen test set is rendered from, each made anew of its own source.

    DIR/hdri/test/*.exr      DIR/meshes/test/*.ply      with a manifest.csv in hdri/ and in meshes/
    DIR/frozen_public.txt    the frozen recipes whose map and shape are there

frozen_set.csv has a row a file: the repository, commit and path of its source, the source's MD5, and the SHA-256 of
what is made of it, by whose first eight digits recipes name it. Rows without an MD5 are shapes that cannot be made
anew: what decimated them, or closed their holes, was not recorded.
"""

import hashlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import OpenEXR

from anyprobe.errors import InvalidEnvironment
from anyprobe.files.atomic import atomic_path
from anyprobe.maps.exr import read_exr
from anyprobe.maps.radiance import decode_hdr
from anyprobe_train.assets.download import Client, DownloadError, Fetch
from anyprobe_train.assets.manifest import Manifest
from anyprobe_train.dataset.catalog import Row, read_table
from anyprobe_train.dataset.recipe import digest, read_recipes
from anyprobe_train.evaluate.scoring import FROZEN

TABLE = Path(__file__).with_name("frozen_set.csv")
HOST = "https://raw.githubusercontent.com"
RECIPES = "frozen_public.txt"
COLUMNS = "file category licence source url md5 split".split()
ROWS = 256
"""Rows of the maps that are made."""
MAX_PIXELS = 2**23
HALF_MAX = 65504.0
GRID = 1e-5
"""Vertices of a source that fall into one cell are one, in lengths of the longest side."""


def frozen_files(table: Path = TABLE) -> list[Row]:
    """Every row of the table.

    file: in DIR. md5: of the source, empty where the file cannot be made anew; sha256: of the file. axes: of a shape,
    which of the source's axes are x, y and z, as "x z -y". centre, radius: of the sphere, in the turned source, that
    becomes the unit sphere.
    """
    return read_table(table)[1]


def fetch_all(files: list[Row], to: Path, client: Client, host: str = HOST) -> Iterator[Fetch]:
    """Yield what makes each file, in turn; then write the recipes that the files suffice for."""
    there: set[str] = set()
    for one in files:
        yield one["file"], partial(_fetch, one, to, client, host)
        if _is_whole(one, to):
            there.add(one["sha256"][:8])
    recipes = [one for one in read_recipes(FROZEN) if {one.map_id, one.shape_id} <= there]
    lines = [f"# {digest(recipes)}", *(one.to_hex() for one in recipes)]
    with atomic_path(to / RECIPES) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii")


def _is_whole(one: Row, to: Path) -> bool:
    target = to / one["file"]
    return target.is_file() and hashlib.sha256(target.read_bytes()).hexdigest() == one["sha256"]


def _fetch(one: Row, to: Path, client: Client, host: str) -> str:
    source = f"{one['repository']}: {one['path']}"
    if _is_whole(one, to):
        return "complete"
    if not one["md5"]:
        return f"cannot be had: prepared by software that was not recorded, from {source}"
    target, url = to / one["file"], "/".join([host.rstrip("/"), one["repository"], one["commit"], one["path"]])
    data = client.download(url, one["md5"])
    with atomic_path(target) as temporary:
        (_make_map if target.suffix == ".exr" else _make_shape)(one, data, temporary)
        found = hashlib.sha256(temporary.read_bytes()).hexdigest()
        if found != one["sha256"]:
            raise DownloadError(
                f"expected SHA-256 {one['sha256']} after conversion, got {found}; OpenEXR or NumPy of this machine "
                "write other bytes"
            )
        manifest = Manifest(to / Path(one["file"]).parts[0] / "manifest.csv", COLUMNS)
        name = "/".join(Path(one["file"]).parts[1:])
        row = {"file": name, "category": one["category"], "licence": one["licence"], "source": source}
        manifest.put(row | {"url": url, "md5": one["md5"], "split": "test"})
    return "fetched"


def _make_map(one: Row, data: bytes, target: Path) -> None:
    pixels = small_map(data, Path(one["path"]).name)
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate("RGB")}
    OpenEXR.File(header, channels).write(str(target))


def _make_shape(one: Row, data: bytes, target: Path) -> None:
    vertices, faces = merged(*read_obj(data))
    centre = np.array([float(x) for x in one["centre"].split()])
    target.write_bytes(ply((turned(vertices, one["axes"]) - centre) / float(one["radius"]), faces))


def small_map(data: bytes, name: str) -> np.ndarray:
    """Return a published map as the test set has it: [ROWS, 2 ROWS, 3] half floats, means of squares of its pixels.

    Primaries stay as they are; what is no light is 0; a map with pixels above the largest half is halved until none is.
    """
    if name.endswith(".hdr"):
        radiance = decode_hdr(data, name, MAX_PIXELS)
    else:
        radiance = read_exr(data, name, InvalidEnvironment, MAX_PIXELS)[..., :3]
    step = len(radiance) // ROWS
    light = np.where(np.isfinite(radiance) & (radiance > 0), radiance, np.float32(0))
    small = light.reshape(ROWS, step, 2 * ROWS, step, 3).mean(axis=(1, 3))
    while small.max() > HALF_MAX:
        small = small / 2
    return small.astype(np.float16)


def read_obj(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] float64 and triangles [F, 3] of an .obj, in its order."""
    vertices, faces = [], []
    for line in data.decode("utf-8", "replace").splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif kind == "f":
            corners = [int(corner.split("/")[0]) - 1 for corner in rest]
            faces += [[corners[0], b, c] for b, c in zip(corners[1:], corners[2:], strict=False)]
    return np.array(vertices), np.array(faces)


def merged(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices one a cell of GRID, in the order of cells, and the triangles that still have three of them."""
    cells = np.round(vertices / (np.ptp(vertices, axis=0).max() * GRID)).astype(np.int64)
    _, first, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = number.reshape(-1)[faces]
    a, b, c = faces.T
    return vertices[first], faces[(a != b) & (b != c) & (c != a)]


def turned(vertices: np.ndarray, axes: str) -> np.ndarray:
    """Vertices [V, 3] in a frame whose axes are those named, as "x z -y"."""
    columns = [(-1.0 if name[0] == "-" else 1.0) * vertices[:, "xyz".index(name[-1])] for name in axes.split()]
    return np.stack(columns, axis=1)


def ply(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """Return a binary PLY file, float32."""
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    listed = np.zeros(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    listed["count"], listed["corners"] = 3, faces
    return head.encode("ascii") + vertices.astype("<f4").tobytes() + listed.tobytes()
