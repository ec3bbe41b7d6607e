"""Write the lights of a clip as one JSON file, and keep on disk what a run needs to resume."""

import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from anyprobe.errors import InputError
from anyprobe.estimate.sidecar import FRAME, SCALE, json_numbers, source_json
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import open_regular
from anyprobe.light.harmonics import project
from anyprobe.light.light_sources import find_sources, split_dominant_light
from anyprobe.light.steady import Steady
from anyprobe.light.temporal import FilterState, Track
from anyprobe.notices import RESTART, Notice, Remedy

STATE = ".state.npz"

PIECES = ".pieces"
"""Folder, within the result's, of the pieces of light.mp4 and relit.mp4."""

BLOCKS, BLOCK_BYTES = 64, 1 << 16
"""Number and size [bytes] of the blocks of a large file that are hashed, spread evenly over it."""

KINDS = {kind.__name__: kind for kind in (FilterState, Track, Steady)}
"""Classes of saved values."""


@dataclass(kw_only=True)
class Progress:
    """How far a clip is done.

    settings: what the result depends on; a run resumes only with the same.
    next_index: the first frame to do. frames: records of those done.
    light: the filter's state, and time_s of the light it last saw.
    last: MaskFollower.last, around which the object is found anew.
    pieces: number written of light.mp4, and of relit.mp4.
    stage_index: the frame that the virtual object was placed in. stage_last: as it was before that frame, by
    which its mask is found again. ground, long_fov_deg: of that frame's light, Ground.info and the lens; toward_light:
    its dominant direction; likely: how likely it shines from there.
    material: the object's, as plain numbers.
    gain: of the relit clip's light, see relight.appearance.least_scale.
    preview_ev: exposure of the spheres in light.mp4, by the first light; None before it.
    panorama: [64, 128, 4] of the surroundings in all frames so far, in the world: linear radiance times cover, and
    cover.
    notes: warnings of the first frame.
    """

    settings: dict[str, Any]
    next_index: int = 0
    frames: list[dict] = field(default_factory=list)
    light: FilterState | None = None
    light_time_s: float = 0.0
    last: list[float] | None = None
    pieces: int = 0
    stage_index: int | None = None
    stage_last: list[float] | None = None
    toward_light: list[float] | None = None
    ground: dict | None = None
    long_fov_deg: float | None = None
    likely: float = 1.0
    material: dict | None = None
    gain: float = 1.0
    preview_ev: float | None = None
    panorama: np.ndarray | None = None
    notes: list[Notice] = field(default_factory=list)


def save_progress(folder: Path, progress: Progress) -> None:
    """Write it completely or not at all."""
    arrays: list[np.ndarray] = []
    words = {one.name: _words_of(getattr(progress, one.name), arrays) for one in fields(progress)}
    words["notes"] = [note.as_json() for note in progress.notes]
    with atomic_path(folder / STATE) as temporary:
        np.savez(temporary, *arrays, words=np.array(json.dumps(words)))


def _words_of(value: Any, arrays: list[np.ndarray]) -> Any:
    """Return a value as data for JSON; arrays in it are appended to `arrays` and named as np.savez names them."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"is": "array", "of": f"arr_{len(arrays) - 1}"}
    if isinstance(value, tuple):
        return {"is": "tuple", "of": [_words_of(one, arrays) for one in value]}
    if is_dataclass(value):
        parts = {one.name: _words_of(getattr(value, one.name), arrays) for one in fields(value)}
        return {"is": type(value).__name__, "of": parts}
    return value


def _value_of(words: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Return the value that _words_of described."""
    if not isinstance(words, dict) or "is" not in words:
        return words
    kind, parts = words["is"], words["of"]
    if kind == "array":
        return arrays[parts]
    if kind == "tuple":
        return tuple(_value_of(one, arrays) for one in parts)
    return KINDS[kind](**{name: _value_of(one, arrays) for name, one in parts.items()})


def forget_run(folder: Path) -> None:
    """Delete what a run left in its folder, and nothing else."""
    if not (folder / STATE).is_file():
        return
    for left in (folder / STATE, folder / "track.json", folder / "light.mp4", folder / "relit.mp4"):
        left.unlink(missing_ok=True)
    for light in (folder / "lights").glob("[0-9]" * 6 + ".exr"):
        light.unlink()
    shutil.rmtree(folder / PIECES, ignore_errors=True)


def forget_progress(folder: Path) -> None:
    """Delete what save_progress wrote, and the folder if it is then empty."""
    (folder / STATE).unlink(missing_ok=True)
    with suppress(OSError):  # not empty, or never made
        folder.rmdir()


def load_progress(folder: Path, settings: dict[str, Any]) -> Progress | None:
    """Return the progress of an earlier run; None if there is none.

    Raises:
        InputError: it is of a run with other settings, or is damaged.
    """
    path = folder / STATE
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream, np.load(stream) as kept:
            words = json.loads(str(kept["words"]))
            words["notes"] = [Notice.from_json(note) for note in words["notes"]]
            found = Progress(**{name: _value_of(one, kept) for name, one in words.items()})
    except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, BadZipFile) as error:
        text = "expected what a run of this version left, got another or damaged file; choose another folder with -o"
        raise InputError(text, source=path, remedy=(Remedy("run", RESTART),)) from error
    now = json.loads(json.dumps(settings))
    then = found.settings
    if then != now:
        differing = _differing(then, now)
        other, one = ("another or none", "that") if len(differing) == 1 else ("others", "those")
        text = f"{folder} holds a run begun with {other}; choose another -o; repeat {one}"
        raise InputError(text, subject=differing, remedy=(Remedy("run", RESTART),))
    return found


def _differing(then: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return the names of settings that differ; of a setting that holds others, of those."""
    names = []
    for name in {**then, **now}:
        one, other = then.get(name), now.get(name)
        if isinstance(one, dict) and isinstance(other, dict):
            names += _differing(one, other)
        elif one != other:
            names.append(name)
    return names


def digest_of(parts: Iterable[bytes]) -> str:
    """Return 16 hexadecimal digits that identify these parts in this order."""
    whole = hashlib.sha256()
    for part in parts:
        whole.update(hashlib.sha256(part).digest())
    return whole.hexdigest()[:16]


def sampled_digest(path: Path) -> str:
    """Return the digest of a file's size and of BLOCKS blocks of it, which are all its bytes where it is small."""
    with open_regular(path, InputError) as stream:
        size = os.fstat(stream.fileno()).st_size
        parts = [str(size).encode()]
        for number in range(BLOCKS):
            stream.seek(max(number * BLOCK_BYTES, number * (size - BLOCK_BYTES) // (BLOCKS - 1)))
            parts.append(stream.read(BLOCK_BYTES))
    return digest_of(parts)


def describe(radiance: np.ndarray) -> dict[str, Any]:
    """Return a light in a few numbers: SH of all of it and without the dominant light, that light, and all sources."""
    main, ambient = split_dominant_light(radiance)
    return {
        "sh9": json_numbers(project(radiance), 5),
        "sh9_ambient": json_numbers(project(ambient), 5),
        "dominant_light": {
            "direction": json_numbers(main.direction, 5),
            "irradiance": json_numbers(main.irradiance, 5),
            "solid_angle_sr": round(float(main.solid_angle), 5),
        },
        "sources": [source_json(one, 5) for one in find_sources(radiance)],
    }


def write_track(path: Path, progress: Progress, fps: float, size: tuple[int, int]) -> None:
    """Write all records as one JSON file; the run's settings stand apart, since some of their names mean something else
    outside."""
    track = {
        "frame": FRAME,
        "scale": SCALE,
        "sh9": "radiance, order and signs of WebXR and three.js; sh9_ambient is without the dominant light",
        "fps": fps,
        "size": list(size),
        "settings": progress.settings,
        "frames": progress.frames,
    }
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(track) + "\n", encoding="utf-8")
