"""Maps and models from Poly Haven (CC0) in the layout that training reads.

    hdri/manifest.csv    hdri/{train,test}/<slug>.hdr | .exr      as published
    meshes/manifest.csv  meshes/{train,test}/<slug>.glb           the triangles of its glTF

The API (https://api.polyhaven.com): /assets?type=T lists assets by slug, /files/<slug> names an
asset's files by resolution and format, each with address, size and MD5.
"""

import hashlib
import io
import re
import urllib.parse
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.files.objects import read_mesh
from anyprobe.maps.radiance import read_radiance
from anyprobe_train.assets.download import Client, DownloadError, md5_of
from anyprobe_train.assets.manifest import Manifest

API = "https://api.polyhaven.com"
PAGE = "https://polyhaven.com/a/"
LICENCE = "CC0-1.0 (Poly Haven)"
FOLDERS = {"hdris": "hdri", "models": "meshes"}
COLUMNS = "file slug category licence source url authors md5 split resolution files_hash".split()

_SLUG = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, kw_only=True, slots=True)
class Asset:
    """One entry of the list: `words` are all its categories, `files_hash` changes with its files."""

    kind: str
    slug: str
    category: str
    words: frozenset[str]
    authors: str
    files_hash: str

    @property
    def source(self) -> str:
        return PAGE + self.slug


def list_assets(client: Client, kind: str, api: str = API) -> list[Asset]:
    """Everything the API has of a kind, hdris or models."""
    listed = client.get_json(f"{api.rstrip('/')}/assets?type={kind}")
    if not listed:
        raise DownloadError(f"{api}: expected a list of {kind}, got an empty one")
    assets = []
    for slug, entry in listed.items():
        if not _SLUG.fullmatch(slug) or not isinstance(entry, dict):  # a slug becomes a file name
            raise DownloadError(f"{api}: expected a list of assets, got the entry {slug[:40]!r}")
        words = _words(entry)
        authors = entry.get("authors")
        assets.append(
            Asset(
                kind=kind,
                slug=slug,
                category=_place(words, entry) if kind == "hdris" else _path(entry),
                words=frozenset(words),
                authors=", ".join(authors) if isinstance(authors, dict) else "",
                files_hash=str(entry.get("files_hash") or ""),
            )
        )
    return assets


def choose(assets: Iterable[Asset], categories: Iterable[str]) -> list[Asset]:
    """Return the assets in all of the categories, in an order of no meaning.

    The order is that of a hash of the slug, so that the first are a fair sample, and more of them add to it.
    """
    wanted = {category.strip().casefold() for category in categories}
    return sorted((one for one in assets if wanted <= one.words), key=lambda one: _hash("order", one.slug))


def family(slug: str) -> str:
    """Return what near twins share: `venice_sunset_puresky` has the sky of `venice_sunset`, numbers count views."""
    return re.sub(r"(_puresky)?(_\d+[a-z]?)?(_puresky)?$", "", slug) or slug


def split_of(slug: str, share: float) -> str:
    """train or test: a function of the slug alone, alike for near twins; a larger share only adds to test."""
    return "test" if _hash("split", family(slug)) < share else "train"


@dataclass(frozen=True)
class Library:
    """A folder that fills with assets; asks the server only for what is not complete."""

    root: Path
    client: Client
    api: str = API
    resolution: str = "1k"
    map_format: str = "hdr"
    test_share: float = 0.1

    def fetch(self, asset: Asset) -> str:
        """Bring one asset into the folder; see download.Fetch."""
        manifest = Manifest(self.root / FOLDERS[asset.kind] / "manifest.csv", COLUMNS)
        split = split_of(asset.slug, self.test_share)
        folder = manifest.path.parent
        is_map = asset.kind == "hdris"
        resolution = self.resolution if is_map else ""  # a model's triangles do not depend on it
        target = folder / split / f"{asset.slug}.{self.map_format if is_map else 'glb'}"
        row = manifest.row(asset.source)
        old = folder / row["file"] if row else target
        if manifest.has_other(asset.source, asset.slug) or (row is None and target.is_file()):
            return "kept"
        whole = row is not None and old.is_file() and md5_of(old.read_bytes()) == row.get("md5")
        wanted = {"resolution": resolution, "files_hash": asset.files_hash}
        if whole and old == target and asset.files_hash and all(row.get(key) == one for key, one in wanted.items()):
            return "complete"
        sources = _sources(self.client.get_json(f"{self.api.rstrip('/')}/files/{asset.slug}"), asset.kind, self)
        parts = {path: self.client.download(*remote) for path, remote in sources.items()}
        body = parts[""] if is_map else _packed(parts)
        with atomic_path(target) as temporary:
            temporary.write_bytes(body)
            _check(temporary, target.name)
            manifest.put(  # before the rename: no file without its licence
                {
                    "file": f"{split}/{target.name}",
                    "slug": asset.slug,
                    "category": asset.category,
                    "licence": LICENCE,
                    "source": asset.source,
                    "url": sources[""][0],
                    "authors": asset.authors,
                    "md5": md5_of(body),
                    "split": split,
                    **wanted,
                }
            )
        if whole and old != target:
            old.unlink()
        return "fetched"


def _sources(files: dict, kind: str, library: Library) -> dict[str, tuple[str, str]]:
    """Return address and MD5 of what an asset is of: "" is the map or the .gltf, other keys are paths beside it."""
    try:
        if kind == "hdris":
            tree = files["hdri"]
            if library.map_format not in tree.get(library.resolution, {}):
                there = ", ".join(sorted(tree, key=_pixels))
                raise DownloadError(f"expected {library.resolution} in {library.map_format}, the asset has {there}")
            return {"": _remote(tree[library.resolution][library.map_format])}
        entry = files["gltf"][min(files["gltf"], key=_pixels)]["gltf"]
        include = entry.get("include", {})
        beside = {path: _remote(include[path]) for path in sorted(include) if path.endswith(".bin")}
        return {"": _remote(entry), **beside}
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise DownloadError(f"the API's list of files is not understood ({error!r})") from error


def _remote(entry: dict) -> tuple[str, str]:
    return str(entry["url"]), entry["md5"]


def _pixels(resolution: str) -> int:
    return int(resolution.removesuffix("k"))


def _packed(parts: dict[str, bytes]) -> bytes:
    """Make one GLB of a glTF and the buffers beside it: triangles and where they are, without normals and materials."""
    import trimesh

    beside = {urllib.parse.quote(path): body for path, body in parts.items()} | parts
    given = {"file_type": "gltf", "resolver": beside, "process": False, "skip_materials": True}
    try:
        return trimesh.load_scene(io.BytesIO(parts[""]), **given).export(file_type="glb", include_normals=False)
    except Exception as error:  # trimesh raises whatever its parsers raise
        raise DownloadError(f"its glTF and its buffers do not fit together ({error!r})") from error


def _check(path: Path, name: str) -> None:
    """Refuse a map or a mesh that training would refuse."""
    try:
        (read_mesh if path.suffix == ".glb" else read_radiance)(path)
    except InputError as error:
        raise DownloadError(f"as published, but {str(error).replace(path.name, name)}") from error


def _words(entry: dict) -> set[str]:
    """Its categories in lower case: the old list, the new path with all its parts, the attributes."""
    words = set(map(str, entry.get("categories") or ()))
    steps = _path(entry).split("/") if entry.get("category") else []
    words |= {"/".join(steps[:end]) for end in range(1, len(steps) + 1)} | set(steps)
    attributes = entry.get("attributes")
    for value in attributes.values() if isinstance(attributes, dict) else ():
        words |= {str(one) for one in (value if isinstance(value, list) else [value]) if isinstance(one, str)}
    return {word.casefold() for word in words}


def _path(entry: dict) -> str:
    return str(entry.get("category") or ", ".join(map(str, entry.get("categories") or ())))


def _place(words: set[str], entry: dict) -> str:
    """indoor, outdoor or studio, as the catalog knows them."""
    if any(word.startswith("studio") for word in words):
        return "studio"
    for known in ("outdoor", "indoor"):
        if known in words:
            return known
    return "indoor" if "indoor" in (entry.get("tags") or ()) else "outdoor"


def _hash(purpose: str, text: str) -> float:
    """Return a number in [0, 1) that looks random and never changes."""
    digest = hashlib.sha256(f"{purpose} {text}".encode()).digest()
    return int.from_bytes(digest[:6], "big") / 2**48
