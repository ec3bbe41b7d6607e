"""A camera for Chromium: frames in the file that --use-file-for-fake-video-capture plays in a loop."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

FROM_RGB = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255
"""ITU-R BT.601 luma and the two chroma differences, in their narrow ranges."""


def write_y4m(path: Path, frames: Iterable[np.ndarray], fps: int = 30, order: Sequence[int] | None = None) -> Path:
    """Write [H, W, 3] uint8 frames of even size as uncompressed 4:2:0.

    order: which frame is shown when; each once where it is not told.
    """
    frames = list(frames)
    pictures = [_planes(frame) for frame in frames]
    height, width = frames[0].shape[:2]
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{width} H{height} F{fps}:1 Ip A1:1 C420jpeg\n".encode())
        for index in range(len(pictures)) if order is None else order:
            file.write(b"FRAME\n" + pictures[index])
    return path


def _planes(frame: np.ndarray) -> bytes:
    height, width = frame.shape[:2]
    luma, *chroma = np.moveaxis(frame.astype(np.float64) @ FROM_RGB.T + (16, 128, 128), -1, 0)
    quarters = [c.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3)) for c in chroma]
    return b"".join(np.round(plane).astype(np.uint8).tobytes() for plane in (luma, *quarters))


def camera_flags(path: Path) -> tuple[str, ...]:
    """What makes a Chromium take the file for its camera and allow it."""
    return (
        "--use-fake-device-for-media-stream",
        "--use-fake-ui-for-media-stream",
        f"--use-file-for-fake-video-capture={path}",
    )
