"""The live page in headless Chromium with a fake camera: lights and pictures a second, stillness, following.

    python benchmarks/live_page.py [--seconds 20] [--engine wasm|webgpu] [--threads 2] [--cores 0,1] [--sway 0]
    python benchmarks/live_page.py --photo clay_teapot --data DATA --pictures FOLDER [--seconds 4] ...

The camera shows a shaded sphere with a little noise, and every four seconds the light on it turns by 90
degrees about +Y, there and back; a patch in the video's corner says when. With --sway the sphere goes to and fro
by so many pixels at 0.3 Hz, and its mask must be found anew all the time. With --photo the camera shows the clip of
swaying.py, there and back, before the photo's own background: one still light. --pictures keeps a picture of the page
every half second while it counts. It draws in software (SwiftShader)
where no GPU is, on the same cores as the networks. Needs Chromium, Node.js and the packages of
tests/browser; run it on a machine with nothing else to do. Prints one JSON object:

lights_per_s, frames_per_s   lights, each of them drawn, and the page's own count of the camera's pictures (of 30): the
                             mean of what it says twice a second, whole numbers over two seconds each
pictures                     the same counted one by one, a second: `delivered` by the camera, `presented` to the
                             display by the browser, `heard` by the page's own thread, which is what the page counts;
                             `unheard`, how many were presented and not heard in each second
ms                           means a light, in the networks' thread; `all` is their sum, `between` what the
                             thread waits for the next frame
std_color_angle_deg          of a white sphere in the light about its mean over time, one for each still stretch
dominant_light_step_max_deg  largest step of the dominant light between two lights, one for each still stretch
followed_in_s                from the first frame under the new light until the page's light stays within a
                             tenth of the way, one for each change; null where it did not
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from measure import cpu_model
from swaying import CLIPS, HIGH, WIDE, click_on, read_cutouts
from swaying import FPS as CLIP_FPS
from swaying import frames as clip_frames

from anyprobe.core.color import to_bytes
from anyprobe.core.frames import rotation_y
from anyprobe.core.response import response
from anyprobe.light.environment import rotate
from anyprobe.light.harmonics import irradiance
from anyprobe.render.spheres import diffuse, sphere_normals
from anyprobe_train.evaluate.metrics import color_angle_deg

ROOT = Path(__file__).parents[1]
FPS, WIDTH, HEIGHT, DIAMETER = 30, 640, 480, 220
CLICK = [0.5, 0.5]
NOISE = 1.5
"""Standard deviation of the camera's noise, of 255."""
DISTINCT = 100
"""Frames of a light; longer stretches repeat them."""
ADAPT_S = 1.5
"""After a change, what is not counted as a still scene."""
FOLLOWED = 0.1
"""Of the way between the two lights that may be left."""
WARM_LIGHTS = 10
"""After the click, before anything counts."""
PATIENCE_S = 60.0
"""How long they are waited for."""


def frames(radiance: np.ndarray, patch: int, count: int, rng: np.random.Generator, sway: float = 0.0):
    """[480, 640, 3] uint8: the sphere under a light over a dull ground, each frame with its own noise."""
    rows = np.arange(HEIGHT)[:, None, None]
    ground = 0.2 + 0.2 * rows / HEIGHT * np.array([0.2, 0.6, 1.0])
    top, middle = (HEIGHT - DIAMETER) // 2, (WIDTH - DIAMETER) // 2
    on = sphere_normals(DIAMETER)[1]
    sphere = response(0.8 * diffuse(radiance, DIAMETER))
    for index in range(count):
        left = middle + round(sway * np.sin(2 * np.pi * index / count))
        clean = np.broadcast_to(ground, (HEIGHT, WIDTH, 3)).copy()
        clean[top : top + DIAMETER, left : left + DIAMETER][on] = sphere[on]
        clean[:16, :16] = patch
        yield to_bytes(clean + rng.normal(0, NOISE / 255, clean.shape))


def white_spheres(sh9: np.ndarray) -> np.ndarray:
    """What the pixels of a white sphere show, [N, P, 3], in lights of SH [N, 9, 3]."""
    normals = sphere_normals(16)[0].astype(np.float32)
    return np.array([irradiance(one, normals) for one in sh9]) / np.pi


def stillness(spheres: np.ndarray) -> float:
    """Degrees: root mean square over time of the colour angle to the mean, as benchmarks/flicker.py has it."""
    mean, on = spheres.mean(axis=0), np.ones(spheres.shape[1], bool)
    return float(np.sqrt(np.mean([color_angle_deg(sphere, mean, on) ** 2 for sphere in spheres])))


def describe(seen: dict) -> dict:
    """Rates and milliseconds while it counted; stillness and following from every change on."""
    start, end = seen["from"], seen["to"]
    counted = [light for light in seen["lights"] if start <= light["time"] <= end]
    rates = [float(re.search(r"(\d+) frames/s", one["text"])[1]) for one in seen["rates"] if one["time"] >= start]
    result = {
        "lights": len(counted),
        "lights_per_s": round(len(counted) / (end - start), 1),
        "frames_per_s": round(float(np.mean(rates)), 1) if rates else None,
        "page_says": seen["rates"][-1]["text"],
    }
    result["pictures"] = count_pictures(seen)
    if not counted:
        return result
    ms = {part: float(np.mean([light["ms"][part] for light in counted])) for part in counted[0]["ms"]}
    ms["between"] = 1000 * (end - start) / len(counted) - ms["all"]
    result["ms"] = {part: round(value, 1) for part, value in ms.items()}

    times = np.array([light["time"] for light in counted])
    spheres = white_spheres(np.array([light["sh9"] for light in counted]).reshape(-1, 9, 3))
    toward = np.array([light["direction"] for light in counted])
    turns = np.degrees(np.arccos(np.clip((toward[1:] * toward[:-1]).sum(axis=1), -1, 1)))
    changes = [time for time in seen["changes"] if start <= time < end]
    changes = changes or [start - ADAPT_S]  # the light does not turn (--half): one still stretch
    still, steps, followed = [], [], []
    for change, until in zip(changes, [*changes[1:], end], strict=True):
        before = np.flatnonzero(times < change)
        settled = np.flatnonzero((times > change + ADAPT_S) & (times < until))
        if len(settled) < 5:
            continue
        still.append(round(stillness(spheres[settled]), 3))
        steps.append(round(float(turns[settled[:-1]].max()), 2))
        if len(before) == 0:
            continue
        goal = spheres[settled].mean(axis=0)
        left = np.linalg.norm(spheres - goal, axis=(1, 2)) / np.linalg.norm(spheres[before[-1]] - goal)
        on_the_way = np.flatnonzero((times >= change) & (times < until) & (left > FOLLOWED))
        arrived = on_the_way[-1] + 1 if len(on_the_way) else before[-1] + 1
        followed.append(round(float(times[arrived] - change), 2) if arrived < len(times) else None)
    return result | {"std_color_angle_deg": still, "dominant_light_step_max_deg": steps, "followed_in_s": followed}


def count_pictures(seen: dict) -> dict:
    """Rates of the camera's pictures on their way while it counted, from one by one."""
    start, end = seen["from"], seen["to"]

    def pace(given: list[dict], count: str) -> float | None:
        given = [one for one in given if start <= one["time"] <= end]
        if len(given) < 2:
            return None
        return round((given[-1][count] - given[0][count]) / (given[-1]["time"] - given[0]["time"]), 2)

    heard = [one | {"heard": index} for index, one in enumerate(seen["pictures"])]
    unheard = [0] * math.floor(end - start)
    for one, after in itertools.pairwise(heard):
        if start <= after["time"] < start + len(unheard):
            unheard[int(after["time"] - start)] += after["presented"] - one["presented"] - 1
    return {
        "delivered": pace(seen["camera"], "delivered"),
        "presented": pace(heard, "presented"),
        "heard": pace(heard, "heard"),
        "unheard": unheard,
    }


@contextlib.contextmanager
def server():
    """Address of an `anyprobe serve` of its own."""
    program = Path(sys.executable).with_name("anyprobe")
    command = [str(program), "serve", "--port", "0", "--workers", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield re.search(r"http://\S+/", process.stderr.readline())[0]
        finally:
            process.terminate()


def spheres_in_turn(half_s: float, sway: float) -> tuple[list[np.ndarray], int, list[int]]:
    """Frames of the sphere under two lights, frames a second, and which is shown when: so long under each."""
    from support.scenes import made_map

    rng = np.random.default_rng(3)
    lights = [made_map(), np.maximum(rotate(made_map(), rotation_y(np.pi / 2)), 0)]
    pictures = [one for patch, light in enumerate(lights) for one in frames(light, patch, DISTINCT, rng, sway)]
    stretch = np.arange(round(FPS * half_s)) % DISTINCT
    return pictures, FPS, [*stretch, *(DISTINCT + stretch)]


def main() -> None:
    sys.path.insert(0, str(ROOT / "tests"))
    from support.browser import run_steps
    from support.camera import camera_flags, write_y4m

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--half", type=float, default=4.0, help="seconds until the light turns")
    parser.add_argument("--engine", choices=("wasm", "webgpu"), default="wasm")
    parser.add_argument("--threads", type=int, default=0, help="of the networks; one a core where not told")
    parser.add_argument("--cores", help="which ones all of it runs on, as 0,1")
    parser.add_argument("--sway", type=float, default=0.0, help="pixels by which the sphere goes to and fro")
    parser.add_argument("--photo", metavar="NAME", help="a real photo's object, not a sphere; needs --data")
    parser.add_argument("--data", type=Path, help="folder with photos/ and real_masks/")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="pictures of the page, one every half second")
    parser.add_argument("--screenshot", type=Path, help="where to keep a picture of the page")
    asked = parser.parse_args()
    if asked.cores:
        os.sched_setaffinity(0, {int(core) for core in asked.cores.split(",")})
    query = f"?engine={asked.engine}" + (f"&threads={asked.threads}" if asked.threads else "")
    steps = {"seconds": asked.seconds, "lights": WARM_LIGHTS, "patience_s": PATIENCE_S, "click": CLICK}
    if asked.screenshot:
        steps["screenshot"] = str(asked.screenshot.resolve())
    if asked.pictures:
        asked.pictures.mkdir(parents=True, exist_ok=True)
        steps["pictures"] = str(asked.pictures.resolve())
    with tempfile.TemporaryDirectory() as folder, server() as url:
        path = Path(folder) / "camera.y4m"
        if asked.photo:
            (cutout,) = read_cutouts(asked.data, [asked.photo])
            pictures = [shown.rgb for shown in clip_frames(cutout, CLIPS[0])]
            x, y = click_on(cutout, CLIPS[0])
            steps["click"] = [x / WIDE, y / HIGH]
            video = write_y4m(path, pictures, CLIP_FPS, [*range(len(pictures)), *reversed(range(len(pictures)))])
        else:
            video = write_y4m(path, *spheres_in_turn(asked.half, asked.sway))
        flags = [*camera_flags(video)]
        if asked.engine == "webgpu":
            flags += ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"]
        seen = run_steps(
            "page_camera.mjs", url, steps | {"query": query}, flags=flags, viewport=(1280, 900), timeout_s=200
        )
    result = {"cpu": cpu_model(), "cores": len(os.sched_getaffinity(0)), "engine": asked.engine}
    print(json.dumps(result | describe(seen)))


if __name__ == "__main__":
    main()
