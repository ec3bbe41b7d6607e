"""Which wheels the newest releases of the dependencies have for each system: python -m tests.wheels

Ask the index that PIP_INDEX_URL names, else PyPI, once a package; print the table of docs/reference/systems.md.
"""

from __future__ import annotations

import datetime
import json
import os
import re
import tomllib
import urllib.request
from pathlib import Path

INDEX = os.environ.get("PIP_INDEX_URL", "https://pypi.org/simple").rstrip("/")
EXTRAS = ("", "video", "serve", "heic", "raw")
SYSTEMS = {
    "Linux x64": r"manylinux.*x86_64",
    "Linux arm64": r"manylinux.*aarch64",
    "Windows x64": r"win_amd64",
    "macOS arm64": r"macosx.*(arm64|universal2)",
    "macOS x64": r"macosx.*(x86_64|universal2)",
}
PYTHONS = (11, 12, 13, 14)


def wanted() -> dict[str, list[str]]:
    """Return the direct dependencies by extra; "" is what is always needed."""
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {"": project["dependencies"], **project["optional-dependencies"]}
    return {extra: [re.split(r"[><=;\[ ]", one)[0] for one in listed[extra]] for extra in EXTRAS}


def newest(package: str) -> tuple[str, list[str]]:
    """Return the newest final release and its files' names."""
    request = urllib.request.Request(f"{INDEX}/{package}/", headers={"Accept": "application/vnd.pypi.simple.v1+json"})
    with urllib.request.urlopen(request, timeout=60) as stream:
        found = json.load(stream)
    names = [file["filename"] for file in found["files"] if not file.get("yanked")]
    by_version: dict[str, list[str]] = {}
    for name in names:
        if match := re.match(r"[A-Za-z0-9_.]+?-(\d[\d.]*)-.*\.whl$", name):
            by_version.setdefault(match[1], []).append(name)
    version = max(by_version, key=lambda one: tuple(int(part) for part in one.split(".") if part))
    return version, by_version[version]


def pythons(names: list[str], system: str) -> str:
    """Return the Pythons 3.x whose wheels are among these; "all" for a wheel of any."""
    fits = []
    for minor in PYTHONS:
        for name in names:
            python, abi, platform = name.removesuffix(".whl").split("-")[-3:]
            own = f"cp3{minor}" in python.split(".") and abi in (f"cp3{minor}", "none")
            older = [int(one[3:]) for one in python.split(".") if re.fullmatch(r"cp3\d+", one)]
            stable = abi == "abi3" and older and min(older) <= minor
            if (own or stable or "py3" in python) and (platform == "any" or re.search(SYSTEMS[system], platform)):
                fits.append(minor)
                break
    if len(fits) == len(PYTHONS):
        return "all"
    return ", ".join(f"3.{minor}" for minor in fits) or "none"


def main() -> None:
    """Print the table."""
    print(f"Newest releases on {datetime.date.today().isoformat()}.\n")
    print(f"| extra | package | {' | '.join(SYSTEMS)} |")
    print(f"|---|---|{'---|' * len(SYSTEMS)}")
    for extra, packages in wanted().items():
        for package in packages:
            version, names = newest(package)
            cells = " | ".join(pythons(names, system) for system in SYSTEMS)
            print(f"| {extra} | {package} {version} | {cells} |")


if __name__ == "__main__":
    main()
