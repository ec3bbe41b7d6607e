"""The vectors of registration that Python and JavaScript are held to: python -m support.registration_cases (in tests/).

One JSON file: pictures of a made-up object before a wall as base64 of bytes, R = G = B, what moved them, and where
anyprobe.video.registration finds it.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.video.registration import Motion, begin_key, locate_key

FILE = Path(__file__).parents[1] / "product" / "cases" / "registration.json"
STILL = Motion()
CENTER = np.array([64.0, 50.0])
"""Of the object, in the key's picture, 120 x 100."""

CASES: dict[str, dict[str, Any]] = {
    "stands still": {},
    "a fraction of a pixel": {"truth": Motion(x=0.4, y=-0.3)},
    "everything": {"truth": Motion(x=5.3, y=-4.6, angle=0.08, scale=0.07), "gain": 1.15, "bias": 4.0, "noise": 2.0},
    "further than its outline is wide": {"truth": Motion(x=15.5, y=9.25), "noise": 2.0},
    "in a window elsewhere": {
        "truth": Motion(x=21.6, y=13.2, angle=-0.05),
        "start": Motion(x=14, y=9),
        "offset": (19, 10),
    },
    "a shadow over a third": {"truth": Motion(x=-2.2, y=1.7, angle=0.03), "shadow": 0.8, "noise": 2.0},
    "partly out of the picture": {"truth": Motion(x=-19.0, y=0.5), "noise": 1.0},
    "another picture": {"other": True, "noise": 2.0},
}
"""offset: of the second picture's first pixel, else 0, 0. start: where the search begins, else where the key is."""


def drawn(motion: Motion = STILL, *, gain=1.0, bias=0.0, noise=0.0, shadow=1.0, other=False, offset=(0, 0), seed=1):
    """Luma [100, 120] uint8 and cover [100, 120] of a moved object, half of its pixels' edges covered."""
    y, x = np.mgrid[0:100, 0:120] + 0.5
    at = np.stack([x, y], axis=-1) + offset
    u, v = np.moveaxis((at - CENTER - (motion.x, motion.y)) @ np.linalg.inv(motion.matrix()).T, -1, 0)
    outline = 24.0 + 6.0 * np.cos(3.0 * np.arctan2(v, u) + 0.4)
    cover = np.clip(outline - np.hypot(u, v) + 0.5, 0.0, 1.0)
    object_ = 90.0 + 1.1 * u - 0.8 * v + 18.0 * np.sin(0.21 * u + 0.5) * np.cos(0.17 * v)
    object_ = np.where(u > 8.0, object_ * shadow, object_)
    if other:
        object_ = 120.0 + 30.0 * np.sin(0.5 * u * v / 10.0)
    wall = 205.0 + 0.1 * at[..., 0] + 8.0 * np.sin(0.3 * at[..., 1])
    seen = gain * (cover * object_ + (1.0 - cover) * wall) + bias
    seen = seen + np.random.default_rng(seed).normal(0.0, 1.0, seen.shape) * noise
    return np.clip(np.round(seen), 0, 255).astype(np.uint8), cover


def write_cases(path: Path = FILE) -> None:
    """Write the file anew."""
    key_picture, cover = drawn()
    mask = np.round(255 * cover).astype(np.uint8)
    key = begin_key(key_picture.astype(np.float32), mask.astype(np.float32) / 255)
    levels = [{"points": len(level.rows), "rows_sum": level.rows.sum(axis=0).tolist()} for level in key.levels]
    cases = []
    for name, given in CASES.items():
        asked = dict(given)
        truth, start = asked.pop("truth", STILL), asked.pop("start", STILL)
        picture, offset = drawn(truth, **asked, seed=2)[0], asked.get("offset", (0, 0))
        found = locate_key(key, picture.astype(np.float32), start, offset)
        case: dict[str, Any] = {"name": name, "picture": _text(picture), "offset": list(offset)}
        case |= {"start": _words(start), "truth": None if asked.get("other") else _words(truth)}
        case["motion"] = _words(found.motion)
        case |= {part: getattr(found, part) for part in ("alike", "inside", "agreed", "error_px")}
        cases.append({**case, "is_sure": bool(found.is_sure)})
    about = {"width": 120, "height": 100, "picture": _text(key_picture), "mask": _text(mask)}
    about |= {"center": key.center.tolist(), "radius": key.radius, "fine": key.fine, "coarse": key.coarse}
    path.write_text(json.dumps({"key": {**about, "levels": levels}, "cases": cases}, indent=1) + "\n", encoding="utf-8")


def _words(motion: Motion) -> list[float]:
    return [motion.x, motion.y, motion.angle, motion.scale]


def _text(picture: np.ndarray) -> str:
    return base64.b64encode(picture.tobytes()).decode()


if __name__ == "__main__":
    write_cases()
