"""Run tests as on Windows and macOS, as far as Linux goes: python -m tests.other_system [pytest's arguments]

Where this is root's process and ntfs-3g is installed, all their files lie on an NTFS disk that ignores case and refuses
names that Windows does; support/other_system.py is the rest.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DISK_BYTES = 2 << 30


@contextlib.contextmanager
def disk(folder: Path) -> Iterator[Path | None]:
    """Yield a folder on an NTFS disk of its own, mounted for as long; None where none can be made."""
    image, place = folder / "disk", folder / "mounted"
    place.mkdir()
    with open(image, "wb") as stream:
        stream.truncate(DISK_BYTES)
    try:
        subprocess.run(["mkntfs", "-q", "-F", "-f", str(image)], check=True, capture_output=True)
        mount = ["lowntfs-3g", "-o", "ignore_case,windows_names,noatime", str(image), str(place)]
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"no disk that ignores case ({error}): apt install ntfs-3g, and run as root")
        yield None
        return
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=False)


def main() -> int:
    """Run the tests that are named, else all of the product; return pytest's status."""
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # so that the disk is given back
    asked = sys.argv[1:] or ["tests/product"]
    paths = os.pathsep.join(str(ROOT / name) for name in ("src", "tests", "."))
    with tempfile.TemporaryDirectory() as folder, disk(Path(folder)) as place:
        more = [] if place is None else ["--basetemp", str(place / "tests")]
        order = [
            sys.executable,
            "-X",
            "warn_default_encoding",
            "-m",
            "pytest",
            "-p",
            "support.other_system",
            *more,
            *asked,
        ]
        return subprocess.run(order, cwd=ROOT, env={**os.environ, "PYTHONPATH": paths}, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
