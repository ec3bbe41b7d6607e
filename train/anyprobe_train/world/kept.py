"""Arrays that are made once and kept in files, shared by all processes."""

import fcntl
from collections.abc import Callable
from pathlib import Path

import numpy as np

from anyprobe.files.atomic import atomic_path


def kept(path: Path, make: Callable[[], np.ndarray]) -> np.ndarray:
    """Return the array of a file, which stays on disk; made if it is missing, by one process while others wait."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.is_file():
                with atomic_path(path) as temporary, open(temporary, "wb") as stream:
                    np.save(stream, make())
    return np.load(path, mmap_mode="r")
