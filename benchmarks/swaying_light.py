"""How still the light of a swaying object is, and how soon it follows: the clips of swaying.py, found by a click.

    python benchmarks/swaying_light.py --data DATA [--only NAME] [--clips CLIP] [--developed | --others] [--json]
        [--cache FOLDER] [--true-masks]

What each clip's line says, of the lights after the first half second:

step, raw_step: largest step of the dominant light from frame to frame, degrees, filtered and of single frames.
over_10: steps over 10 degrees. spread: the dominant light's root mean square angle to its mean, degrees.
bright: most pixels above radiance 5 in a filtered light over most in a single frame's (of clips with 20 there).
followed_s: after the light turned by 90 degrees, until the dominant light is within 15 degrees of where single
    frames settle in the second after; null where those turn by less than 30. turned_s: with single frames' lights that
    are turned by 90 degrees around the vertical at half time, until it is within 15 degrees of what is shown without
    that, turned, and by a filter that is not told whether the object looks the same.
rate: frames a second, masks, networks and filter, of processor time; without the first frame, which opens the networks.

--cache keeps single frames' lights, so that another filter is tried on the same. --true-masks: with each frame's own
mask in the place of the found one. Lines of all clips come last: the worst of each.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from swaying import CLIPS, DEVELOPED_ON, FPS, JUMP_S, OTHERS, Cutout, click_on, frames, read_cutouts

from anyprobe.core.frames import rotation_y
from anyprobe.errors import AnyprobeError
from anyprobe.estimate.estimator import Estimator
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.light.temporal import step
from anyprobe.video.clip import Frame
from anyprobe.video.following import MaskFollower

SETTLING_S = 0.5
BRIGHT, LEAST_BRIGHT = 5.0, 20
NEAR_DEG, LEAST_TURN_DEG = 15.0, 30.0


def single_lights(cutout: Cutout, clip: str, estimator: Estimator, true_masks: bool = False) -> dict[str, np.ndarray]:
    """maps [T, 64, 128, 3] of single frames, iou [T] of their masks, same [T]: whether the object looks as before, and
    seconds [T] of processor time."""
    follower = MaskFollower({}, {"click": click_on(cutout, clip)}, {})
    maps, iou, same, seconds = [], [], [], []
    for index, shown in enumerate(frames(cutout, clip)):
        start = time.process_time()
        try:
            photo = follower.photo(Frame(index=index, time_s=shown.time_s, rgb=shown.rgb))
            if true_masks:
                photo = replace(photo, mask=shown.cover)
            maps.append(estimator.from_photo(photo, plate=False).radiance)
            mask, cover = photo.mask > 0.5, shown.cover > 0.5
            iou.append((mask & cover).sum() / (mask | cover).sum())
            same.append(follower.looks_same)
        except AnyprobeError as error:
            print(f"{cutout.name} {clip} {index}: {error}", flush=True)
            maps.append(maps[-1])
            iou.append(0.0)
            same.append(False)
        seconds.append(time.process_time() - start)
    return {
        "maps": np.array(maps, np.float32),
        "iou": np.array(iou),
        "same": np.array(same),
        "seconds": np.array(seconds),
    }


def filtered(maps: np.ndarray, same: np.ndarray | None = None) -> tuple[np.ndarray, float]:
    """Lights as shown, and the processor seconds of one."""
    shown, state = [], None
    start = time.process_time()
    for one, looks_same in zip(maps, np.zeros(len(maps), bool) if same is None else same, strict=True):
        state = step(state, one, 1 / FPS, looks_same=bool(looks_same))
        shown.append(state.radiance)
    return np.array(shown), (time.process_time() - start) / len(maps)


def toward(maps: np.ndarray) -> np.ndarray:
    """Directions of the dominant lights [T, 3]."""
    return np.array([find_dominant_light(one).direction for one in maps], np.float64)


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip((one * other).sum(axis=-1), -1.0, 1.0)))


def settled(directions: np.ndarray) -> np.ndarray:
    """Where most of the directions are: the one with the least sum of angles to the others."""
    return directions[np.argmin([angles(directions, one).sum() for one in directions])]


def followed_s(shown: np.ndarray, wanted: np.ndarray) -> float:
    """Seconds until directions shown [T, 3] are near those wanted, [3] or [T, 3]; infinite: never."""
    near = np.flatnonzero(angles(shown, wanted) <= NEAR_DEG)
    return round(float(near[0]) / FPS, 3) if len(near) else float("inf")


def measure(found: dict[str, np.ndarray], clip: str) -> dict[str, Any]:
    """The figures of one clip."""
    single = toward(found["maps"])
    maps, filter_s = filtered(found["maps"], found["same"])
    shown = toward(maps)
    start = round(SETTLING_S * FPS)
    jump = round(JUMP_S * FPS)
    line: dict[str, Any] = {"iou": round(float(found["iou"].min()), 3)}
    if clip == "light turns":
        before, after = settled(single[jump - FPS : jump]), settled(single[jump : jump + FPS])
        is_turned = angles(before, after) >= LEAST_TURN_DEG
        line["followed_s"] = followed_s(shown[jump : jump + FPS], after) if is_turned else None
    else:
        steps = angles(shown[1:], shown[:-1])[start:]
        mean = shown[start:].mean(axis=0)
        apart = angles(shown[start:], mean / np.linalg.norm(mean))
        line |= {"step": steps.max(), "over_10": int((steps > 10).sum()), "spread": np.sqrt((apart**2).mean())}
        line["raw_step"] = angles(single[1:], single[:-1])[start:].max()
        bright = [(part[start:].max(axis=-1) > BRIGHT).sum(axis=(1, 2)) for part in (maps, found["maps"])]
        line["bright"] = bright[0].max() / bright[1].max() if bright[1].max() >= LEAST_BRIGHT else None
        turn = rotation_y(np.pi / 2)
        turned = [np.maximum(rotate(one, turn), 0.0) for one in found["maps"][jump:]]
        both = np.concatenate([found["maps"][:jump], turned])
        unturned = toward(filtered(found["maps"])[0][jump:])
        line["turned_s"] = followed_s(toward(filtered(both)[0][jump:]), unturned @ turn.T)
    line["rate"] = 1.0 / (float(found["seconds"][1:].mean()) + filter_s)
    return {name: round(float(v), 3) if isinstance(v, float | np.floating) else v for name, v in line.items()}


def worst(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """The worst of each figure."""
    least = ("iou", "rate")
    names = dict.fromkeys(name for line in lines for name in line if name not in ("photo", "clip"))
    values = {name: [line[name] for line in lines if line.get(name) is not None] for name in names}
    return {name: (min if name in least else max)(all_) for name, all_ in values.items() if all_}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder with photos/ and real_masks/; without it the shipped photo")
    parser.add_argument("--only", metavar="NAME", action="append", help="of a photo")
    parser.add_argument("--clips", metavar="CLIP", action="append", choices=CLIPS)
    parser.add_argument("--developed", action="store_const", dest="only", const=list(DEVELOPED_ON))
    parser.add_argument("--others", action="store_const", dest="only", const=list(OTHERS))
    parser.add_argument("--cache", type=Path, metavar="FOLDER", help="keep single frames' lights here")
    parser.add_argument("--true-masks", action="store_true")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    asked = parser.parse_args()
    estimator, lines = Estimator(), []
    for cutout in read_cutouts(asked.data, asked.only):
        for clip in asked.clips or CLIPS:
            kind = " true" if asked.true_masks else ""
            kept = asked.cache and asked.cache / f"{cutout.name} {clip}{kind}.npz"
            if kept and kept.is_file():
                with np.load(kept) as arrays:
                    found = dict(arrays)
            else:
                found = single_lights(cutout, clip, estimator, asked.true_masks)
                if kept:
                    with atomic_path(kept) as temporary:
                        np.savez(temporary, **found)
            lines.append({"photo": cutout.name, "clip": clip, **measure(found, clip)})
            tell(lines[-1], asked.json)
    for clip in asked.clips or CLIPS:
        part = [line for line in lines if line["clip"] == clip]
        tell({"photo": "worst", "clip": clip, **worst(part)}, asked.json)


def tell(line: dict[str, Any], as_json: bool) -> None:
    print(json.dumps(line) if as_json else ", ".join(f"{k} {v}" for k, v in line.items()), flush=True)


if __name__ == "__main__":
    main()
