"""Rendered clips: a shaded sphere under a light that may move, with its masks, as mp4 and folders."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.light.environment import rotate
from anyprobe.render.spheres import diffuse, sphere_normals

SIZE, DIAMETER = (128, 96), 40
LEFT_PX, TOP_PX = 20, 40


def sphere_frame(radiance: np.ndarray, noise: float = 0.0, rng: np.random.Generator | None = None) -> np.ndarray:
    """[96, 128, 3] uint8: the sphere on a dull ground."""
    rows = np.arange(SIZE[1])[:, None, None]
    picture = np.broadcast_to(0.2 + 0.2 * rows / SIZE[1] * np.array([0.2, 0.6, 1.0]), (*SIZE[::-1], 3)).copy()
    window = picture[TOP_PX : TOP_PX + DIAMETER, LEFT_PX : LEFT_PX + DIAMETER]
    on = sphere_normals(DIAMETER)[1]
    window[on] = response(0.8 * diffuse(radiance, DIAMETER))[on]
    if rng is not None:
        picture = picture + rng.normal(0, noise, picture.shape)
    return to_bytes(picture)


def sphere_mask() -> np.ndarray:
    mask = np.zeros(SIZE[::-1], np.uint8)
    mask[TOP_PX : TOP_PX + DIAMETER, LEFT_PX : LEFT_PX + DIAMETER] = 255 * sphere_normals(DIAMETER)[1]
    return mask


def write_masks(folder: Path, count: int) -> Path:
    folder.mkdir()
    for index in range(count):
        Image.fromarray(sphere_mask()).save(folder / f"{index:04d}.png")
    return folder


def write_clip(path: Path, frames: list[np.ndarray], fps: int = 24, rotation: int = 0) -> Path:
    """H.264; rotation as phones write it: degrees that a player turns the pictures by, counter-clockwise."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=fps, options={"crf": "10", "preset": "ultrafast"})
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for index, frame in enumerate(frames):
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
            picture.pts, picture.time_base = index, Fraction(1, fps)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def turned(radiance: np.ndarray, angle: float) -> np.ndarray:
    """The light after a turn about +Y by an angle [radians]."""
    from anyprobe.core.frames import rotation_y

    return np.maximum(rotate(radiance, rotation_y(angle)), 0)
