"""An empty project around the packed npm package, and the ways to build it."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "web" / "examples"
THREE, RUNTIME = "three@0.187.0", "onnxruntime-web@1.30.0"

ESTIMATE = """
async function estimate(AnyProbe, options) {
  const probe = await AnyProbe.load(options);
  const light = await probe.estimate("./photo.png", { mask: await (await fetch("./mask.png")).blob(), fovDeg: 24 });
  document.body.dataset.light = JSON.stringify([...light.sh9]);
}
"""
"""What every project does with the package; the page waits for data-light."""
DEFAULT = f'import {{ AnyProbe }} from "anyprobe";\n{ESTIMATE}\nestimate(AnyProbe);\n'
FILES = '{ weights: { light: "anyprobe/light.onnx" }, runtime: "ort/" }'
CORE = f'import {{ AnyProbe }} from "anyprobe/core";\n{ESTIMATE}\nestimate(AnyProbe, {FILES});\n'
NEXT = f"""
"use client";
import {{ AnyProbe }} from "anyprobe";
import {{ useEffect }} from "react";
{ESTIMATE}
export default function Page() {{
  useEffect(() => void estimate(AnyProbe), []);
}}
"""
NEXT_LAYOUT = "export default ({ children }) => <html><body>{children}</body></html>;\n"
IMPORTS = {
    "anyprobe": "./node_modules/anyprobe/src/plain.js",
    "onnxruntime-web/": "./node_modules/onnxruntime-web/dist/",
}


def page(script: str, head: str = "") -> str:
    head = f'<link rel="icon" href="data:,">{head}<script type="module" src="{script}"></script>'
    return f"<!doctype html><html><head>{head}</head><body></body></html>"


@dataclass(frozen=True, kw_only=True, slots=True)
class Bundler:
    """packages: installed beside anyprobe. sources: of the project. command: builds it. site: what is served then.

    copied: with the core, which names no files: whether weights and runtime are put beside the program.
    """

    packages: tuple[str, ...]
    sources: dict[str, str]
    command: tuple[str, ...] = ()
    site: str = "."
    copied: bool = False

    def build(self, packed: Path, folder: Path) -> Path:
        """Install the package into an empty folder and build the project; the folder to serve."""
        write({"package.json": json.dumps({"private": True, "type": "module"}), **self.sources}, folder)
        install(folder, packed, RUNTIME, *self.packages)
        if self.command:
            run(folder, *self.command)
        site = folder / self.site
        if self.copied:
            shutil.copytree(folder / "node_modules/anyprobe/weights", site / "anyprobe")
            shutil.copytree(folder / "node_modules/onnxruntime-web/dist", site / "ort")
        return site


def write(sources: dict[str, str], folder: Path) -> None:
    for name, text in sources.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def install(folder: Path, *packages: str | Path) -> None:
    run(folder, "npm", "install", "--silent", "--no-audit", "--no-fund", "--prefer-offline", *packages)


def run(folder: Path, *command: str | Path) -> None:
    """Raises AssertionError with what the command said."""
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, f"{' '.join(map(str, command))}\n{ended.stdout[-2000:]}{ended.stderr[-2000:]}"


def pack(web: Path, folder: Path) -> Path:
    """What `npm pack` makes of the clone's web/."""
    run(web, "npm", "pack", "--silent", "--pack-destination", folder)
    return next(folder.glob("*.tgz"))


def build_example(name: str, packed: Path, folder: Path, source: str | None = None) -> Path:
    """An example of web/examples, built in an empty folder with the packed package; the folder to serve.

    source: in the place of its main.js.
    """
    shutil.copytree(EXAMPLES / "public", folder / "public")
    shutil.copytree(EXAMPLES / name, folder / name, ignore=shutil.ignore_patterns("node_modules", "dist"))
    about = json.loads((folder / name / "package.json").read_text())
    about["dependencies"]["anyprobe"] = f"file:{packed}"
    (folder / name / "package.json").write_text(json.dumps(about))
    if source is not None:
        (folder / name / "main.js").write_text(source)
    install(folder / name)
    run(folder / name, "npx", "vite", "build")
    return folder / name / "dist"


def _next(engine: str) -> Bundler:
    return Bundler(
        packages=("next@16.4.6", "react@19.2.0", "react-dom@19.2.0"),
        sources={
            "app/page.js": NEXT.lstrip(),
            "app/layout.js": NEXT_LAYOUT,
            "next.config.mjs": 'export default { output: "export" };\n',
        },
        command=("npx", "next", "build", f"--{engine}"),
        site="out",
    )


VITE = ("vite@8.3.8",)
WEBPACK = ("webpack@5.112.2", "webpack-cli@7.3.1")
BUNDLERS: dict[str, Bundler] = {
    "vite": Bundler(
        packages=VITE,
        sources={"index.html": page("/main.js"), "main.js": DEFAULT},
        command=("npx", "vite", "build"),
        site="dist",
    ),
    "webpack": Bundler(
        packages=WEBPACK,
        sources={"main.js": DEFAULT, "dist/index.html": page("main.js")},
        command=("npx", "webpack", "--mode", "production", "--entry", "./main.js"),
        site="dist",
    ),
    "esbuild": Bundler(
        packages=("esbuild@0.28.2",),
        sources={"main.js": CORE, "dist/index.html": page("main.js")},
        command=("npx", "esbuild", "main.js", "--bundle", "--format=esm", "--minify", "--outdir=dist"),
        site="dist",
        copied=True,
    ),
    "rollup": Bundler(
        packages=("rollup@4.68.8", "@rollup/plugin-node-resolve@16.0.3"),
        sources={"main.js": CORE, "dist/index.html": page("main.js")},
        command=("npx", "rollup", "main.js", "-p", "node-resolve", "-f", "es", "-d", "dist"),
        site="dist",
        copied=True,
    ),
    "next-turbopack": _next("turbopack"),
    "next-webpack": _next("webpack"),
    "import-map": Bundler(
        packages=(),
        sources={
            "index.html": page("main.js", f'<script type="importmap">{json.dumps({"imports": IMPORTS})}</script>'),
            "main.js": DEFAULT,
        },
    ),
}
"""By name; versions from the npm registry."""


def emitted(site: Path) -> list[str]:
    """Graphs and runtimes among the files of a build, without their hashes."""
    kinds = (".onnx", ".wasm")
    return sorted(path.name for path in site.rglob("*") if path.suffix in kinds and "node_modules" not in path.parts)
