"""The live page in headless Chromium with a fake camera: lights and pictures a second, stillness, following.

    python benchmarks/live_page.py [--seconds 20] [--engine wasm|webgpu] [--cores 0,1] [--json]

The camera shows a shaded ball with a little noise for half of the video, and then the same ball after
the light has turned by 90 degrees about +Y; the video starts again. It draws in software (SwiftShader)
where no GPU is, on the same cores as the networks. Needs Chromium, Node.js and the packages of
tests/browser; run it on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from measure import cpu_model

from anyprobe.core.color import to_bytes
from anyprobe.core.frames import rotation_y
from anyprobe.core.response import response
from anyprobe.light.environment import rotate
from anyprobe.render.balls import ball_normals, diffuse

ROOT = Path(__file__).parents[1]
FPS, WIDTH, HEIGHT, DIAMETER = 30, 640, 480, 220
CLICK = [0.5, 0.5]
NOISE = 1.5
"""Standard deviation of the camera's noise, of 255."""
ADAPT_S = 1.5
"""After a change, what is not counted as a still scene."""
FOLLOWED = 0.2
"""Of the way between the two lights that may be left."""


def frames(radiance: np.ndarray, seconds: float, rng: np.random.Generator):
    """[480, 640, 3] uint8: the ball under a light over a dull ground, each frame with its own noise."""
    rows = np.arange(HEIGHT)[:, None, None]
    ground = 0.2 + 0.2 * rows / HEIGHT * np.array([0.2, 0.6, 1.0])
    clean = np.broadcast_to(ground, (HEIGHT, WIDTH, 3)).copy()
    top, left = (HEIGHT - DIAMETER) // 2, (WIDTH - DIAMETER) // 2
    on = ball_normals(DIAMETER)[1]
    clean[top : top + DIAMETER, left : left + DIAMETER][on] = response(0.8 * diffuse(radiance, DIAMETER))[on]
    for _ in range(round(FPS * seconds)):
        yield to_bytes(clean + rng.normal(0, NOISE / 255, clean.shape))


def color_angles(sh9: np.ndarray) -> np.ndarray:
    """Degrees between the mean colour of each light [N, 27] and that of all of them."""
    colors = sh9[:, :3] / np.linalg.norm(sh9[:, :3], axis=1, keepdims=True)
    mean = colors.mean(axis=0)
    return np.degrees(np.arccos(np.clip(colors @ (mean / np.linalg.norm(mean)), -1, 1)))


def describe(seen: dict, half_s: float) -> dict:
    """Rates of all of it; stillness and following from where the lights jump."""
    lights = seen["lights"]
    times = np.array([light["time"] for light in lights])
    sh9 = np.array([light["sh9"] for light in lights])
    steps = np.linalg.norm(np.diff(sh9, axis=0), axis=1)
    jump = next((i for i in np.argsort(-steps) if times[i] + 0.8 * half_s < times[-1]), None)
    result = {
        "lights_per_s": round(len(lights) / seen["took"], 1),
        "frames_per_s": round(seen["frames"] / seen["took"], 1),
        "ms_mask": round(float(np.mean([light["ms"]["mask"] for light in lights])), 1),
        "ms_networks": round(float(np.mean([light["ms"]["networks"] for light in lights])), 1),
        "ms_all": round(float(np.mean([light["ms"]["all"] for light in lights])), 1),
        "page_says": seen["rates"],
    }
    if jump is None:
        return result
    still = (times > times[jump] + ADAPT_S) & (times < times[jump] + 0.95 * half_s)
    if still.sum() > 2:
        end = sh9[still].mean(axis=0)
        way = np.linalg.norm(sh9 - end, axis=1) / max(np.linalg.norm(sh9[jump] - end), 1e-9)
        left = np.flatnonzero((way > FOLLOWED) & (times > times[jump]) & (times < times[still][-1]))
        settled = times[left[-1] + 1] if len(left) else times[jump + 1]
        result["std_color_angle_deg"] = round(float(color_angles(sh9[still]).std()), 3)
        result["followed_in_s"] = round(float(settled - times[jump]), 2)
    return result


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


def main() -> None:
    sys.path.insert(0, str(ROOT / "tests"))
    from support.browser import run_steps
    from support.camera import camera_flags, write_y4m
    from support.scenes import made_map

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--half", type=float, default=5.0, help="seconds until the light turns")
    parser.add_argument("--engine", choices=("wasm", "webgpu"), default="wasm")
    parser.add_argument("--cores", help="which ones all of it runs on, as 0,1")
    parser.add_argument("--screenshot", help="where to keep a picture of the page")
    parser.add_argument("--json", action="store_true", help="one object instead of lines")
    asked = parser.parse_args()
    if asked.cores:
        os.sched_setaffinity(0, {int(core) for core in asked.cores.split(",")})
    rng = np.random.default_rng(3)
    lights = [made_map(), np.maximum(rotate(made_map(), rotation_y(np.pi / 2)), 0)]
    steps = {"seconds": asked.seconds, "click": CLICK, "query": f"?engine={asked.engine}"}
    if asked.screenshot:
        steps["screenshot"] = str(Path(asked.screenshot).resolve())
    with tempfile.TemporaryDirectory() as folder, server() as url:
        clip = (frame for light in lights for frame in frames(light, asked.half, rng))
        video = write_y4m(Path(folder) / "camera.y4m", clip, FPS)
        flags = [*camera_flags(video)]
        if asked.engine == "webgpu":
            flags += ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"]
        seen = run_steps("page_camera.mjs", url, steps, flags=flags, viewport=(1280, 900), timeout_s=240)
    result = {"cpu": cpu_model(), "cores": len(os.sched_getaffinity(0)), "engine": asked.engine}
    result |= describe(seen, asked.half)
    print(
        json.dumps(result) if asked.json else "\n".join(f"{key:22} {value}" for key, value in result.items())
    )


if __name__ == "__main__":
    main()
