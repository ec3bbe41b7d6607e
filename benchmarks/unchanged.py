"""Whether this tree answers as a commit does, after a change of names or places.

Each version answers in processes of its own: the graphs' outputs, estimates with every input, exports, requests, the
scores of pairs (with --data), pairs made on the fly and a short training. What differs is listed; the exit status is 1
then. The wording of messages may differ.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
import onnxruntime as ort
from PIL import Image

ROOT = Path(__file__).parents[1]
PHOTO = ROOT / "examples" / "table.png"
PORT = 8765
TIMED = ("seconds", "photo", "warnings", "notices")
"""Keys of a sidecar that no two runs share, and those whose wording may change."""

INPUTS = {
    "plain": [],
    "click": ["--click", "226,266"],
    "exclude": ["--click", "226,266", "--exclude", "20,20"],
    "box": ["--box", "130,100,325,385"],
    "mask": ["--mask", "{mask}"],
    "depth": ["--depth", "{depth}", "--near", "0.5", "--far", "1.5"],
    "fov": ["--fov", "50"],
    "pitch": ["--pitch", "25"],
    "normals": ["--normals", "sphere"],
    "material": ["--material", "gold"],
    "mirror": ["--material", "chrome", "--normals", "sphere"],
    "albedo": ["--albedo", "0.18"],
    "roughness": ["--roughness", "0.4"],
    "surroundings": ["--surroundings", "{panorama}"],
    "photo": ["--surroundings", "photo"],
    "none": ["--surroundings", "none"],
    "paper": ["--model", "paper"],
}
"""Options of `anyprobe estimate`, a photo each."""

PAIR_KINDS = {"frozen": ["--frozen", "--hints"], "world": ["--conditions", "world"], "textured": ["--textured"]}
"""Options of `anyprobe-train evaluate`."""

REQUESTS = (
    *("GET /v1/targets", "GET /openapi.json", "POST /v1/photo", "POST /v1/mask", "POST /v1/estimate"),
    *("POST /v1/estimate surroundings=none", "POST /v1/estimate material=gold"),
    "POST /v1/estimate box=1",
)
"""Each sends the example; of one that is refused the status counts."""

PAIRS = """
import dataclasses, hashlib
from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.dataset.pair import render_pair
from anyprobe_train.dataset.recipe import balanced_recipes, world_recipes
assets = load_asset_store(None, "train", procedural_maps=2, procedural_shapes=2)
recipes = [*balanced_recipes(assets, 4), *balanced_recipes(assets, 4, conditions=1), *world_recipes(assets, 8, 1)]
for number, recipe in enumerate(recipes):
    pair = render_pair(recipe, assets)
    for part in ("photo", "irradiance", "radiance", "map_from_camera", "gain"):
        print("exact", number, part, hashlib.sha256(getattr(pair, part).tobytes()).hexdigest())
from anyprobe_train.train.config import RUNS, smoke
from anyprobe_train.train.dataloader import make_pairs
from pathlib import Path
for name in ("lift", "whole"):
    if name not in RUNS: continue
    source = make_pairs(smoke(RUNS[name](), 20), None, Path(".") / name, "cpu", compiled=False)
    for step in (0, 1):
        batch = source.batch(step)
        for one in dataclasses.fields(batch):
            print(name, step, one.name, hashlib.sha256(getattr(batch, one.name).numpy().tobytes()).hexdigest())
"""
WEIGHTS = """
import hashlib, sys, torch
def leaves(value, name):
    if torch.is_tensor(value):
        print(name, hashlib.sha256(value.detach().contiguous().numpy().tobytes()).hexdigest())
    elif isinstance(value, dict):
        for key in value: leaves(value[key], f"{name}.{key}")
for key, value in torch.load(sys.argv[1], map_location="cpu", weights_only=False).items():
    leaves(value, key)
"""


EDGE = "one-part-after-another"


def form(photo: bytes, texts: dict[str, str]) -> bytes:
    """Return a form of a photo and texts."""
    head = f"--{EDGE}\r\nContent-Disposition: form-data; name="
    parts = [f'{head}"{name}"\r\n\r\n{text}\r\n'.encode() for name, text in texts.items()]
    last = f'{head}"photo"; filename="photo"\r\n\r\n'.encode() + photo + f"\r\n--{EDGE}--\r\n".encode()
    return b"".join([*parts, last])


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def lines(text: str) -> dict[str, str]:
    return dict(line.rsplit(" ", 1) for line in text.splitlines() if " " in line)


def steady(value):
    """A sidecar or answer without what is measured or named by chance."""
    if isinstance(value, dict):
        return {key: steady(one) for key, one in value.items() if key not in TIMED}
    return [steady(one) for one in value] if isinstance(value, list) else value


def answer_digest(data: bytes) -> str:
    try:
        return digest(json.dumps(steady(json.loads(data)), sort_keys=True).encode())
    except ValueError:
        return digest(data)


class Version:
    """One tree, asked from outside."""

    def __init__(self, tree: Path, folder: Path) -> None:
        self.tree, self.folder = tree, folder
        self.environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1"}
        folder.mkdir(parents=True)

    def run(self, *arguments: str) -> str:
        command, around = [sys.executable, *arguments], {"cwd": self.folder, "env": self.environment}
        ended = subprocess.run(command, capture_output=True, text=True, check=False, **around)
        if ended.returncode:
            raise SystemExit(f"{self.tree}: {' '.join(arguments)[:200]}: {ended.stderr[-2000:]}")
        return ended.stdout

    def graphs(self) -> dict[str, str]:
        found = {}
        for path in sorted((self.tree / "src/anyprobe/weights").rglob("*.onnx")):
            options = ort.SessionOptions()
            options.intra_op_num_threads = 1
            session, rng = ort.InferenceSession(str(path), options), np.random.default_rng(1)
            given = {
                one.name: rng.random([size if isinstance(size, int) else 1 for size in one.shape], np.float32)
                for one in session.get_inputs()
            }
            for one, value in zip(session.get_outputs(), session.run(None, given), strict=True):
                found[f"{path.stem} {one.name}"] = digest(np.ascontiguousarray(value).tobytes())
        return found

    def estimates(self, files: dict[str, str]) -> dict[str, str]:
        found = {}
        for name, options in INPUTS.items():
            photo = str(PHOTO)
            if name in ("plain", "click", "exclude", "box", "depth", "photo"):
                photo = files["whole"]
            if "sphere" in options:
                photo = files["sphere"]
            self.run("-m", "anyprobe", "estimate", photo, "-q", "-o", name, *(one.format(**files) for one in options))
            for path in sorted((self.folder / name).iterdir()):
                found[f"{name} {path.suffix}"] = answer_digest(path.read_bytes())
        return found

    def exports(self) -> dict[str, str]:
        """The example's light for every target."""
        self.run("-m", "anyprobe", "estimate", str(PHOTO), "-q", "-o", "exported")
        self.run("-m", "anyprobe", "export", "exported/table.exr", "--to", "all", "-o", "exports")
        found = sorted(path for path in (self.folder / "exports").rglob("*") if path.is_file())
        return {path.name: answer_digest(path.read_bytes()) for path in found}

    def requests(self) -> dict[str, str]:
        command = [sys.executable, "-m", "anyprobe", "serve", "--port", str(PORT), "--workers", "1"]
        server = subprocess.Popen(command, cwd=self.folder, env=self.environment, stdout=subprocess.DEVNULL)
        try:
            self._wait()
            found = {}
            for request in REQUESTS:
                method, path, *fields = request.split(" ")
                asked = urllib.request.Request(f"http://127.0.0.1:{PORT}{path}", method=method)
                if method == "POST":
                    texts = [text.split("=") for one in fields for text in one.split("&")]
                    asked.data = form(PHOTO.read_bytes(), dict(texts))
                    asked.add_header("Content-Type", f"multipart/form-data; boundary={EDGE}")
                try:
                    with urllib.request.urlopen(asked) as reply:
                        found[request] = f"{reply.status} {answer_digest(reply.read())}"
                except urllib.error.HTTPError as error:
                    found[request] = str(error.code)
            return found
        finally:
            server.terminate()
            server.wait()

    def _wait(self) -> None:
        for _ in range(120):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{PORT}/healthz").close()
                return
            except OSError:
                time.sleep(0.5)
        raise SystemExit(f"{self.tree}: the server does not start")

    def scores(self, data: Path, pairs: int) -> dict[str, str]:
        assets = ["--hdri", str(data / "hdri/test"), "--meshes", str(data / "meshes/test")]
        found = {}
        for name, kind in PAIR_KINDS.items():
            self.run("-m", "anyprobe", "evaluate", *assets, "--pairs", str(pairs), *kind, "-o", name)
            found[name] = answer_digest((self.folder / name / "scores.json").read_bytes())
        return found

    def training(self) -> dict[str, str]:
        pairs = PAIRS  # before the learning wing, its rooms stood in the package itself
        if not (self.tree / "train/anyprobe_train").is_dir():
            pairs = pairs.replace("anyprobe_train.", "anyprobe.")
        found = lines(self.run("-c", pairs))
        self.run("-m", "anyprobe_train", "run", "lift", "--dry-run", "20", "--no-compile")
        (checkpoint,) = (self.folder / "runs").rglob("checkpoint.pt")
        return found | lines(self.run("-c", WEIGHTS, str(checkpoint)))


def sphere() -> np.ndarray:
    """A photo [96, 128, 4] of a matte sphere on nothing."""
    y, x = (np.mgrid[:96, :128] - np.array([[[47.5]], [[63.5]]])) / 40.0
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, None))
    grey = 200 * np.clip(0.6 * z - 0.5 * y + 0.3 * x, 0.05, 1)
    return np.dstack([grey, 0.9 * grey, 0.8 * grey, 255 * (z > 0)]).astype(np.uint8)


def hint_files(folder: Path) -> dict[str, str]:
    """Files that the options name, made of the example and of numbers."""
    folder.mkdir()
    picture = np.asarray(Image.open(PHOTO).convert("RGBA"))
    rng = np.random.default_rng(2)
    made = {
        "whole": picture[..., :3],
        "mask": picture[..., 3],
        "panorama": (rng.random((64, 128, 4)) * 255).astype(np.uint8),
        "sphere": sphere(),
    }
    for name, pixels in made.items():
        Image.fromarray(np.ascontiguousarray(pixels)).save(folder / f"{name}.png")
    np.save(folder / "depth.npy", np.where(picture[..., 3] > 127, 1.0, 2.0).astype(np.float32))
    return {name: str(folder / f"{name}.png") for name in made} | {"depth": str(folder / "depth.npy")}


def main() -> None:
    """Ask both, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit", help="what to compare with")
    parser.add_argument("--data", type=Path, help="folder with hdri/test and meshes/test, for the frozen scores")
    parser.add_argument("--pairs", type=int, default=20, help="frozen pairs to score")
    parser.add_argument(
        "--only", nargs="*", default=["graphs", "estimates", "exports", "requests", "scores", "training"]
    )
    options = parser.parse_args()
    options.data = options.data and options.data.resolve()  # commands run in a folder of their own
    differing = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(["git", "worktree", "add", "--detach", folder / "then", options.commit], cwd=ROOT, check=True)
        try:
            files = hint_files(folder / "files")
            then, now = Version(folder / "then", folder / "a"), Version(ROOT, folder / "b")
            for part in options.only:
                if part == "scores" and options.data is None:
                    continue
                extra = {"estimates": (files,), "scores": (options.data, options.pairs)}.get(part, ())
                before, after = (getattr(version, part)(*extra) for version in (then, now))
                wrong = sorted(key for key in before.keys() | after.keys() if before.get(key) != after.get(key))
                differing += len(wrong)
                print(f"{part}: {len(before)} compared, {len(wrong)} differ", *wrong, sep="\n  ", flush=True)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", folder / "then"], cwd=ROOT, check=True)
    sys.exit(differing > 0)


if __name__ == "__main__":
    main()
