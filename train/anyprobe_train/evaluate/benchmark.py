"""A test set for other programs: its photos as files, and the programs' maps read back to be scored."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.maps.radiance import read_radiance
from anyprobe.pictures.images import write_png
from anyprobe_train.dataset.catalog import MAP_SUFFIXES
from anyprobe_train.dataset.pair import Pair

_FRAME = (
    "map H x 2H in the camera's frame: +X right, +Y up, the camera looks along -Z; row 0 up, "
    "u = 0.5 + atan2(x, -z) / (2 pi), the photo's middle in the map's middle"
)
UNITS = "linear Rec. 709 radiance in the photo's exposure: 1 is where the photo clips to white"


def write_photo(folder: Path, key: str, picture: np.ndarray, mask: np.ndarray, fov_deg: float | None) -> None:
    """Write KEY.png, KEY_mask.png and KEY.json: all that a method may use.

    Args:
        picture: [H, W, 3 or 4] uint8 display values. mask: [H, W] bool.
        fov_deg: of the photo's longer side; None where it is not known.
    """
    height, width = mask.shape
    description = {
        "photo": f"{key}.png",
        "mask": f"{key}_mask.png",
        "prediction": f"{key}.exr",
        "width": width,
        "height": height,
        "fov_deg": fov_deg,
        "frame": _FRAME,
        "units": UNITS,
    }
    write_png(folder / description["photo"], picture)
    write_png(folder / description["mask"], mask * np.uint8(255))
    with atomic_path(folder / f"{key}.json") as temporary:
        temporary.write_text(json.dumps(description, indent=1) + "\n", encoding="utf-8")


def write_pair(folder: Path, pair: Pair) -> None:
    """Write a pair's photo, with the object on black, by write_photo."""
    fov_deg = 2.0 * np.degrees(np.arctan(pair.tan_half))
    write_photo(folder, pair.recipe.key, pair.photo[..., :3], pair.photo[..., 3] > 0, float(fov_deg))


def read_predictions(folder: Path, keys: Sequence[str]) -> dict[str, np.ndarray]:
    """Read the map of every key in a folder, KEY.exr or else KEY.hdr, as [64, 128, 3].

    Raises:
        InputError: a key has no map.
        InvalidEnvironment: a map is damaged or not H x 2H.
    """
    if not folder.is_dir():
        raise InputError(
            "expected a folder of maps named by key, got none; write KEY.exr or KEY.hdr there", source=folder
        )
    found = {key: [path for s in MAP_SUFFIXES if (path := folder / f"{key}{s}").is_file()] for key in keys}
    absent = [key for key, paths in found.items() if not paths]
    if absent:
        raise InputError(
            f"expected {len(found)} maps named by key, got none for {len(absent)} of them, such as "
            f"{absent[0]}; write {absent[0]}.exr or .hdr; where the program failed, its fallback",
            source=folder,
        )
    return {key: _read(paths[0]) for key, paths in found.items()}


def _read(path: Path) -> np.ndarray:
    """Read a map of any size as [64, 128, 3]: larger ones keep their integral, smaller ones are interpolated."""
    radiance = read_radiance(path)
    if not radiance.any():
        raise InvalidEnvironment("expected light, got a black map; write the program's estimate", source=path.name)
    if len(radiance) < MAP_HEIGHT:
        return bilinear(radiance, direction_to_uv(pixel_directions(MAP_HEIGHT)).astype(np.float32))
    return np.asarray(reduced(radiance, MAP_HEIGHT), np.float32)
