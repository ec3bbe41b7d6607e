"""The npm package beside the page: lights a second, the first light, what is fetched for it.

    python benchmarks/web_package.py [--seconds 10] [--rounds 3] [--threads 1 2] [--clones NAME=CLONE ...]

Headless Chromium with a fake camera that shows the example; the page as `anyprobe serve --static` writes it,
the package as `npm pack` makes it in a plain page with an import map, both over WASM, with one thread and with
two. The rounds take turns, so that a slow minute of the machine is nobody's; of each figure the median, the
least and the most. worker_ms is the networks' processor time a light (Linux), memory_mb what page and workers
hold in the end. --clones adds page and package of other clones, an older one for instance, with the node_modules
of this one's web/. Needs Chromium, Node.js and
the packages of web/ and tests/browser. Prints one JSON object a line.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import numpy as np
from measure import cpu_model
from PIL import Image

ROOT = Path(__file__).parents[1]
ISOLATED = {"Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp"}
IMPORTS = {
    "anyprobe": "./node_modules/anyprobe/src/plain.js",
    "onnxruntime-web/": "./node_modules/onnxruntime-web/dist/",
}
PAGE = '<!doctype html><link rel="icon" href="data:,"><script type="importmap">{}</script>'


def package_site(clone: Path, folder: Path) -> Path:
    """A page with a clone's packed package beside it."""
    web = clone / "web"
    if not (web / "node_modules").exists():
        (web / "node_modules").symlink_to(ROOT / "web" / "node_modules")
    command = ["npm", "pack", "--silent", "--pack-destination", folder]
    subprocess.run(command, cwd=web, check=True, capture_output=True)
    safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # since 3.11.4
    with tarfile.open(next(folder.glob("*.tgz"))) as archive:
        archive.extractall(folder, **safely)
    (folder / "node_modules").mkdir()
    shutil.move(folder / "package", folder / "node_modules" / "anyprobe")
    (folder / "node_modules" / "onnxruntime-web").symlink_to(web / "node_modules" / "onnxruntime-web")
    (folder / "speed.html").write_text(PAGE.format(json.dumps({"imports": IMPORTS})))
    return folder


def page_site(clone: Path, folder: Path) -> Path:
    """What a clone's `anyprobe serve --static` writes."""
    program = "from anyprobe.cli.app import main; main()"
    command = [sys.executable, "-c", program, "serve", "--static", folder]
    subprocess.run(command, check=True, capture_output=True, env=os.environ | {"PYTHONPATH": str(clone / "src")})
    return folder


def main() -> None:
    sys.path.insert(0, str(ROOT / "tests"))
    from support.browser import run_steps, serve
    from support.camera import camera_flags, write_y4m

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--clones", nargs="*", default=[], metavar="NAME=CLONE")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sites = {}
        for clone_name, clone in [
            ("", ROOT),
            *((key, Path(path).resolve()) for key, path in (one.split("=") for one in given.clones)),
        ]:
            for kind, make in (("page", page_site), ("package", package_site)):
                site = folder / f"{kind} {clone_name}".strip()
                site.mkdir()
                sites[site.name] = make(clone, site)
        with Image.open(ROOT / "examples" / "vase.png") as image:
            frame = np.pad(np.asarray(image.convert("RGB")), ((0, 0), (80, 80), (0, 0)), mode="edge")
        noise = np.random.default_rng(7)
        frames = [np.clip(frame + noise.normal(0, 2, frame.shape), 0, 255).astype(np.uint8) for _ in range(30)]
        flags = [
            *camera_flags(write_y4m(folder / "camera.y4m", frames)),
            "--enable-blink-features=ForceEagerMeasureMemory",
        ]
        seen: dict[tuple[str, int], list[dict]] = {}
        for _ in range(given.rounds):
            for key, site in sites.items():
                for threads in given.threads:
                    steps = {"kind": key.split()[0], "threads": threads, "seconds": given.seconds}
                    with serve({"/": site}, headers=ISOLATED) as url:
                        found = run_steps("web_speed.mjs", url, steps, flags=flags, viewport=(1280, 900))
                    seen.setdefault((key, threads), []).append(found)
        for (key, threads), rounds in seen.items():
            row = {"what": key, "threads": threads, "cpu": cpu_model(), "rounds": len(rounds)}
            for measure in rounds[0]:
                values = sorted(one[measure] for one in rounds)
                row[measure] = [round(v, 2) for v in (statistics.median(values), values[0], values[-1])]
            print(json.dumps(row))


if __name__ == "__main__":
    main()
