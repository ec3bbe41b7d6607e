"""`anyprobe video` with a click, beside the same with U2-Net-p looking twice at every frame: time, agreement of masks.

    python benchmarks/video_masks.py [--clip examples/table.mp4] [--frames 48] [--move 0]

Frames are enlarged to 640 x 480. With --move the camera moves: the frame is cut out of an enlarged one, by so many
pixels further from frame to frame. Uses U2-Net-p where its weights are (docs/how-to/masks.md), else the small network
that ships. Prints one JSON object:

masks, whole   frames a second of processor time: of finding masks alone, and from decoding to the filtered light
by_clock       frames a second by the clock after the first STARTED ones, on all cores
rival_...      the same with two looks at every frame
iou            of each frame's mask to the rival's: median, least, and frames below .9
refused        frames without a mask
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command sets it

import numpy as np
from PIL import Image

from anyprobe.estimate.estimator import Estimator
from anyprobe.masks.networks import shared_network
from anyprobe.video.clip import Frame, open_clip, read_frames, write_piece
from anyprobe.video.following import MaskFollower
from anyprobe.video.run import ClipRun

SIZE = (640, 480)
STARTED = 8
SPARE = 0.2
"""Of the frame, by which it is enlarged further where the camera moves."""


class Timed(MaskFollower):
    """Keeps every frame's mask and the processor seconds it took."""

    def __init__(self, click: tuple[float, float]) -> None:
        super().__init__({}, {"click": click}, {})
        self.masks: dict[int, np.ndarray] = {}
        self.seconds = 0.0

    def photo(self, frame: Frame):
        start = time.thread_time()  # other threads work on the frame before
        try:
            photo = super().photo(frame)
        finally:
            self.seconds += time.thread_time() - start
        self.masks[frame.index] = photo.mask > 0.5
        return photo


class EveryFrame(Timed):
    """Finds each frame's mask as a photo's is found."""

    def _followed(self, rgb):
        return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clip", type=Path, default=Path(__file__).parents[1] / "examples/table.mp4")
    parser.add_argument("--click", type=float, nargs=2, default=(0.35, 0.62), help="in shares of the frame")
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--move", type=float, default=0.0, help="pixels a frame")
    asked = parser.parse_args()
    estimator, network = Estimator(), shared_network().name
    with tempfile.TemporaryDirectory() as folder:
        clip = Path(folder) / "clip.mp4"
        write_piece(clip, list(enlarged(asked.clip, asked.frames, asked.move)))
        click = asked.click[0] * SIZE[0], asked.click[1] * SIZE[1]
        ours, rival = Timed(click), EveryFrame(click)
        rates = {}
        for name, follower in (("", ours), ("rival_", rival)):
            start = time.process_time()
            done: list[float] = []
            run = ClipRun(open_clip(clip), Path(folder) / f"{name}lights", estimator, follower, {})
            outcome = run(lambda _, done=done: done.append(time.perf_counter()))
            whole = time.process_time() - start
            rates |= {f"{name}masks": outcome.frames / follower.seconds, f"{name}whole": outcome.frames / whole}
            rates[f"{name}by_clock"] = (len(done) - STARTED) / (done[-1] - done[STARTED - 1])
    both = sorted(ours.masks.keys() & rival.masks.keys())
    values = [float((ours.masks[k] & rival.masks[k]).sum() / (ours.masks[k] | rival.masks[k]).sum()) for k in both]
    print(
        json.dumps(
            {"network": network, "frames": outcome.frames, "move": asked.move}
            | {name: round(rate, 2) for name, rate in rates.items()}
            | {"iou": [round(float(np.median(values)), 3), round(min(values), 3), sum(v < 0.9 for v in values)]}
            | {"refused": outcome.frames - len(ours.masks)}
        )
    )


def enlarged(clip: Path, count: int, move: float):
    """Seconds and frames [480, 640, 3] uint8."""
    spare = SPARE if move else 0.0
    for frame, _ in zip(read_frames(open_clip(clip), []), range(count), strict=False):
        size = [round(length * (1 + spare)) for length in SIZE]
        picture = np.asarray(Image.fromarray(frame.rgb).resize(size, Image.Resampling.BICUBIC))
        way = move * frame.index % (2 * spare * SIZE[0]) if move else 0.0
        x = round(min(way, 2 * spare * SIZE[0] - way))
        y = round(x * SIZE[1] / SIZE[0])
        yield frame.time_s, np.ascontiguousarray(picture[y : y + SIZE[1], x : x + SIZE[0]])


if __name__ == "__main__":
    main()
