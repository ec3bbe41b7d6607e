"""How still a video's light is and how late: the filter of anyprobe.light.temporal beside frame by frame.

    python benchmarks/flicker.py [--json] [--seconds 3] [--only SCENE] [--cache FOLDER] [--web]

docs/how-to/video.md says what the figures mean. --json prints one object a line, medians over the scenes last.
--cache keeps the estimates, so that another filter is tried on the same ones in seconds. --web adds the npm package's
filter, in Node.js, on the same estimates. --drawn 200 208 takes eight drawn scenes instead, and the camera turns alone.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import tempfile
from collections.abc import Iterable
from collections.abc import Sequence as Run
from pathlib import Path
from typing import Any

import numpy as np
from sequences import FPS, Scene, Sequence, camera_pose, drawn_scene, film, scenes, sequences

from anyprobe.estimate.estimator import Estimator
from anyprobe.files.atomic import atomic_path
from anyprobe.light.dominant_light import find_dominant_light
from anyprobe.light.harmonics import project
from anyprobe.light.temporal import step
from anyprobe.render.spheres import silver, sphere_normals
from anyprobe_train.evaluate.metrics import color_angle_deg

SPHERE = 24
SETTLED = 0.1
"""A jump is followed when the silver sphere is within this share of the way."""

SETTLING_S = 1.0
"""Left out at the start of a sequence, where the filter knows nothing yet."""

LONGEST_LAG_S = 1.5

BRIGHT = 5.0
"""Radiance of a light source's pixels: those of the last light are counted."""


def spheres(maps: Iterable[np.ndarray]) -> np.ndarray:
    """The silver spheres [T, P, 3] of maps, the pixels on the sphere alone."""
    on = sphere_normals(SPHERE)[1]
    return np.array([silver(one, SPHERE)[on] for one in maps])


def angle_deg(p: np.ndarray, g: np.ndarray) -> float:
    return color_angle_deg(p, g, np.ones(p.shape[:-1], bool))


def steadiness(maps: Run[np.ndarray], shown: np.ndarray) -> dict[str, float]:
    """How much a run of lights changes from frame to frame; shown: its spheres [T, P, 3]."""
    mean = shown.mean(axis=0)
    sh = np.array([project(one) for one in maps])
    steps = np.linalg.norm(np.diff(sh, axis=0), axis=(1, 2)) / np.linalg.norm(sh.mean(axis=0))
    toward = np.array([find_dominant_light(one).direction for one in maps])
    turns = np.degrees(np.arccos(np.clip((toward[1:] * toward[:-1]).sum(axis=1), -1, 1)))
    return {
        "color_angle_std_deg": rounded(np.sqrt(np.mean([angle_deg(sphere, mean) ** 2 for sphere in shown]))),
        "color_angle_step_deg": rounded(np.mean([angle_deg(b, a) for a, b in zip(shown, shown[1:], strict=False)])),
        "sh_step_percent": rounded(100 * steps.mean()),
        "dominant_light_step_deg": rounded(turns.mean()),
        "dominant_light_step_max_deg": rounded(turns.max()),
        "bright_pixels": int((maps[-1].max(axis=-1) > BRIGHT).sum()),
    }


def lag_s(shown: np.ndarray, raw: np.ndarray) -> float:
    """How long ago the raw spheres looked as these do: the shift with the least squared difference."""
    times = np.arange(len(raw)) / FPS
    late = times >= LONGEST_LAG_S
    shifts = np.arange(0.0, LONGEST_LAG_S, 0.25 / FPS)
    flat = raw.reshape(len(raw), -1)

    def error(shift: float) -> float:
        at = (times[late] - shift) * FPS
        low = np.minimum(at.astype(int), len(raw) - 2)
        part = (at - low)[:, None]
        then = flat[low] * (1 - part) + flat[low + 1] * part
        return float(np.square(shown.reshape(len(raw), -1)[late] - then).sum())

    return float(shifts[np.argmin([error(shift) for shift in shifts])])


def followed_s(shown: np.ndarray, raw: np.ndarray, jump: int) -> float | None:
    """From the jump's first frame until the spheres stay near where the raw ones settle; None if not."""
    before, after = raw[jump - FPS // 2 : jump].mean(axis=0), raw[jump + 1 :].mean(axis=0)
    left = np.linalg.norm(shown[jump:] - after, axis=(1, 2)) / np.linalg.norm(after - before)
    outside = np.flatnonzero(left > SETTLED)
    if len(outside) == 0:
        return 0.0
    return None if outside[-1] == len(left) - 1 else rounded((outside[-1] + 1) / FPS)


def estimates(
    scene: Scene, sequence: Sequence, estimator: Estimator, cache: Path | None
) -> tuple[np.ndarray, np.ndarray]:
    """True and estimated lights of a sequence, [T, 64, 128, 3] each."""
    kept = cache and cache / f"{scene.name} {sequence.name} {sequence.seconds:g} {estimator.model_id}.npz"
    if kept and kept.is_file():
        with np.load(kept) as arrays:
            return arrays["truth"], arrays["found"]
    pairs = [(taken.truth, estimator.from_photo(taken.photo).radiance) for taken in film(scene, sequence)]
    truth, found = (np.array(part, np.float32) for part in zip(*pairs, strict=True))
    if kept:
        with atomic_path(kept) as temporary:
            np.savez(temporary, truth=truth, found=found)
    return truth, found


def measure(
    scene: Scene, sequence: Sequence, estimator: Estimator, cache: Path | None, web: bool
) -> Iterable[dict[str, Any]]:
    """A line for the true lights, frame by frame, and filtered."""
    truth, found = estimates(scene, sequence, estimator, cache)
    steady, state, held = [], None, 0
    for light in found:
        state = step(state, light, 1 / FPS)
        held += state.held
        steady.append(state.radiance)
    runs = {"truth": truth, "frame by frame": found, "filtered": steady}
    poses = [camera_pose(sequence.yaw(index / FPS)) for index in range(len(found))]
    if sequence.name == "camera turns":
        runs["filtered, pose known"] = filtered_in_the_world(found, poses)
    if web:
        runs["filtered, npm"] = filtered_by_node(found)
        if sequence.name == "camera turns":
            runs["filtered, npm, pose known"] = filtered_by_node(found, poses)
    start = round(SETTLING_S * FPS)
    shown = {name: spheres(run) for name, run in runs.items()}
    raw = shown["frame by frame"]
    for name, run in runs.items():
        line = {"part": "flicker", "scene": scene.name, "sequence": sequence.name, "lights": name}
        line |= steadiness(run[start:], shown[name][start:])
        if name == "filtered":
            line["held"] = held
        if sequence.name == "camera turns":
            line["wander_deg"] = wander_deg(run[start:], poses[start:])
        if name != "truth" and sequence.jump_s is not None:
            line["followed_s"] = followed_s(shown[name], raw, round(sequence.jump_s * FPS))
        elif name.startswith("filtered") and sequence.name != "still":
            line["lag_s"] = rounded(lag_s(shown[name], raw))
        yield line


def filtered_in_the_world(found: Run[np.ndarray], poses: Run[np.ndarray]) -> list[np.ndarray]:
    """As anyprobe video --poses does it: filtered in the world, and turned back into each camera."""
    steady, state = [], None
    for light, pose in zip(found, poses, strict=True):
        state = step(state, light, 1 / FPS, world_from_camera=pose)
        steady.append(state.seen_from(pose))
    return steady


def filtered_by_node(found: Run[np.ndarray], poses: Run[np.ndarray] | None = None) -> np.ndarray:
    """By web/src/light/temporal.js, [T, 64, 128, 3] in each frame's camera."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.asarray(found, np.float32).tofile(folder / "frames.f32")
        if poses is not None:
            np.asarray(poses, np.float64).tofile(folder / "poses.f64")
        script = Path(__file__).with_name("web_filter.mjs")
        subprocess.run(["node", script, folder, str(1 / FPS)], check=True)
        return np.fromfile(folder / "shown.f32", np.float32).reshape(np.shape(found))


def wander_deg(maps: Run[np.ndarray], poses: Run[np.ndarray]) -> float:
    """The furthest that the dominant light is from its mean direction in the world."""
    toward = np.array([pose @ find_dominant_light(one).direction for one, pose in zip(maps, poses, strict=True)])
    mean = toward.mean(axis=0) / np.linalg.norm(toward.mean(axis=0))
    return rounded(np.degrees(np.arccos(np.clip(toward @ mean, -1, 1))).max())


def summaries(lines: list[dict[str, Any]]) -> Iterable[dict[str, Any]]:
    """Medians over the scenes of every figure."""
    kinds = dict.fromkeys((line["sequence"], line["lights"]) for line in lines)
    for sequence, lights in kinds:
        alike = [line for line in lines if (line["sequence"], line["lights"]) == (sequence, lights)]
        figures = [key for key in alike[0] if key not in ("part", "scene", "sequence", "lights", "held")]
        line = {"part": "median", "sequence": sequence, "lights": lights}
        for key in figures:
            values = [one[key] for one in alike if one[key] is not None]
            line[key] = rounded(statistics.median(values)) if len(values) == len(alike) else None
        yield line


def rounded(value: float) -> float:
    return round(float(value), 3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.add_argument("--seconds", type=float, default=3.0, help="of each sequence, at least 3")
    parser.add_argument("--only", metavar="SCENE", action="append", help="vase, pebble or block")
    parser.add_argument("--cache", type=Path, metavar="FOLDER", help="keep the estimates here")
    parser.add_argument("--web", action="store_true", help="the npm package's filter too (Node.js)")
    parser.add_argument(
        "--drawn", type=int, nargs=2, metavar=("FROM", "TO"), help="scenes by number, camera turns alone"
    )
    options = parser.parse_args()
    estimator = Estimator()
    found = []
    chosen, shot = scenes(), sequences(max(options.seconds, 3.0))
    if options.drawn:
        chosen, shot = map(drawn_scene, range(*options.drawn)), [one for one in shot if one.name == "camera turns"]
    for scene in chosen:
        if options.only and scene.name not in options.only:
            continue
        for sequence in shot:
            for line in measure(scene, sequence, estimator, options.cache, options.web):
                found.append(line)
                tell(line, options.json)
    for line in summaries(found):
        tell(line, options.json)


def tell(line: dict[str, Any], as_json: bool) -> None:
    print(json.dumps(line) if as_json else ", ".join(f"{k} {v}" for k, v in line.items()), flush=True)


if __name__ == "__main__":
    main()
