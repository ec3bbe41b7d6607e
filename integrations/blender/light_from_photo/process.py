# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that estimates: Blender's own Python, apart from Blender, so that it can be watched and ended."""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WORKER = Path(__file__).with_name("worker.py")
ANSWER = "answer.json"
CAN_MATCH = any((Path(path) / "anyprobe" / "match" / "ranking.py").is_file() for path in sys.path if path)
"""Whether the library compares a user's panoramas with a photo; looked up without importing it."""


class Failed(Exception):
    """One line for the user."""


def scratch() -> Path:
    """A new folder."""
    return Path(tempfile.mkdtemp(prefix="light_from_photo_"))


def remove(folder: Path) -> None:
    """A folder and what it holds."""
    shutil.rmtree(folder, ignore_errors=True)


class Process:
    """One order to the worker, in a folder that `close` removes."""

    def __init__(self, order: dict, folder: Path | None = None) -> None:
        self.folder = folder or scratch()
        self._log = (self.folder / "log.txt").open("wb")
        (self.folder / "order.json").write_text(json.dumps({**order, "python_path": sys.path}), encoding="utf-8")
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW} if sys.platform == "win32" else {}
        self._process = subprocess.Popen(
            [sys.executable, "-I", str(WORKER), str(self.folder)],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            **hidden,
        )

    def progress(self) -> tuple[float, str]:
        """Share done in [0, 1] and what is being done."""
        try:
            share, text = (self.folder / "progress.txt").read_text(encoding="utf-8").split(" ", 1)
            return float(share), text
        except (OSError, ValueError):  # not there yet
            return 0.0, "Starting"

    def running(self) -> bool:
        return self._process.poll() is None

    def answer(self) -> dict:
        """What the ended process found; Failed with its message."""
        try:
            found = json.loads((self.folder / ANSWER).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            lines = (self.folder / "log.txt").read_text(encoding="utf-8", errors="replace").strip().splitlines()
            last = lines[-1] if lines else f"code {self._process.returncode}"
            raise Failed(f"The estimate ended without a result: {last}") from None
        if "error" in found:
            raise Failed(found["error"])
        return found

    def wait(self, seconds: float = 60) -> dict:
        """The answer, waited for: of short orders only."""
        end = time.monotonic() + seconds
        while self.running():
            if time.monotonic() > end:
                raise Failed(f"No answer within {seconds:g} seconds; try again")
            time.sleep(0.01)
        return self.answer()

    def close(self) -> None:
        """Ends the process where it still runs, and removes its files."""
        if self.running():
            self._process.kill()
        self._process.wait()
        self._log.close()
        remove(self.folder)


def ask(order: dict) -> dict:
    """The answer to a short order."""
    process = Process(order)
    try:
        return process.wait()
    finally:
        process.close()
