"""A vase on a round table in a room, as a photo and as a 20-second clip with an emitter that moves; no camera needed.

    python examples/table.py photo        # examples/table.jpg, and table.png with the vase cut out
    python examples/table.py clip         # examples/table.mp4
    python examples/table.py relit        # docs/relit.webp made of it

The light, the table and the vase are anyprobe's own. The clip goes through `anyprobe video`, which gets
no hint of the light; docs/relit.webp shows the clip beside the result.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.photo import Photo
from anyprobe.files.objects import open_object
from anyprobe.light.environment import reduced
from anyprobe.relight.insert import Arrangement, Stage, lay_object_over, within
from anyprobe.relight.shadow import sky_irradiance
from anyprobe.render.picture import draw_mesh
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import direction_at, soft_cap

HERE = Path(__file__).parent
DOCS = HERE.parent / "docs"

PITCH_DEG, LONG_FOV_DEG = 16.0, 42.0
TABLE_RADIUS, TABLE_DEPTH = 0.8, 2.4
"""In heights of the camera over the table; the depth is that of its middle."""

PORCELAIN = Material(albedo=np.array([0.60, 0.58, 0.54]), f0=np.full(3, 0.045), alpha=0.2)
WOOD = np.array([0.42, 0.27, 0.16])
ROOM_SHARE = 0.45
EMITTER_POWER, EMITTER_RADIUS = 14.0, 0.5
WARM, COLD = np.array([1.25, 1.0, 0.65]), np.array([0.75, 1.0, 1.35])

ANYPROBE = (sys.executable, "-c", "from anyprobe.cli.app import main; main()")
CLIP_SIZE, FPS, SECONDS = (320, 240), 8, 20


@dataclass(frozen=True, kw_only=True, slots=True)
class Lit:
    """By one light: the vase [S, S, 4] as draw_mesh gives it, and the table's irradiance [H, W, 3]."""

    drawn: np.ndarray
    ground: np.ndarray


class Table:
    """The scene at one size; everything that does not change with the emitter is kept."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        mask = np.zeros((height, width), np.float32)
        x0, x1 = round(0.25 * width), round(0.47 * width)
        y0, y1 = round(0.24 * height), round(0.76 * height)
        mask[y0:y1, x0:x1] = 1.0  # how large the vase is to be
        rgb = np.zeros((height, width, 3), np.float32)
        photo = Photo(rgb=rgb, mask=mask, long_fov_deg=LONG_FOV_DEG, fov_source="given", name="table", warnings=())
        place = Arrangement(size=1.0, at=((x0 + x1) / 2, y1 - 0.03 * height), pitch_deg=PITCH_DEG)
        self.stage = Stage(photo, open_object("vase"), place)
        self.fine = ROOM_SHARE * room(np.random.default_rng(29), height=1024)
        self.coarse = reduced(self.fine, 128)

    def emitter(self, azimuth_deg: float) -> np.ndarray:
        """A white emitter 50 degrees up; azimuth 0 is ahead, 90 to the right: [128, 256, 3]."""
        d = pixel_directions(self.coarse.shape[0]).astype(np.float64)
        cap = soft_cap(d, direction_at(np.radians(azimuth_deg), np.radians(50)), EMITTER_RADIUS)
        return np.broadcast_to(EMITTER_POWER * cap, self.coarse.shape).astype(np.float32)

    @cached_property
    def surroundings(self) -> tuple[np.ndarray, np.ndarray]:
        """What is seen past the table [H, W, 3], and the table's albedo [H, W, 3], 0 elsewhere."""
        rows, columns = np.mgrid[0 : 2 * self.height, 0 : 2 * self.width] / 2 + 0.25
        rays = self.stage.view.rays(columns, rows)
        past = bilinear(self.fine, direction_to_uv(rays / np.linalg.norm(rays, axis=-1, keepdims=True)))
        up = self.stage.view.up
        ahead = np.array([0.0, up[2], -up[1]])  # along the table, away from the camera
        points = np.nan_to_num(self.stage.view.on_ground(columns, rows), nan=1e6)
        x, z = points[..., 0], points @ ahead
        inside = np.hypot(x, z - TABLE_DEPTH) < TABLE_RADIUS
        plank = np.floor(9 * x / TABLE_RADIUS)
        grain = np.sin(14 * z + 3 * np.sin(5 * plank) + 2 * np.sin(31 * x)) * np.sin(90 * x + 9 * np.sin(2 * z))
        tone = 1 + 0.16 * np.sin(2.4 * plank) + 0.07 * grain
        tone = np.where(np.abs(9 * x / TABLE_RADIUS - plank - 0.5) > 0.47, 0.6, tone)
        albedo = np.where(inside, tone, 0.0)[..., None] * WOOD
        past = np.where(inside[..., None], 0.0, past)
        return tuple(part.reshape(self.height, 2, self.width, 2, 3).mean(axis=(1, 3)) for part in (past, albedo))

    @lru_cache(maxsize=4)  # noqa: B019
    def lit(self, azimuth_deg: float | None) -> Lit:
        """By the emitter alone; by the room alone for None."""
        light = self.coarse if azimuth_deg is None else self.emitter(azimuth_deg)
        stage = self.stage
        drawn = draw_mesh(stage.placement.mesh, stage.window.camera, light, PORCELAIN)
        shadow = stage.shadow(light, 128 if azimuth_deg is None else 48, 256)
        rows, columns = np.mgrid[0 : self.height, 0 : self.width] + 0.5
        left = shadow.at(stage.view.on_ground(columns.ravel(), rows.ravel()))
        return Lit(drawn=drawn, ground=left.reshape(rows.shape + (3,)) * sky_irradiance(light, stage.view.up))

    def draw(self, azimuth_deg: float, color: np.ndarray, gain: float) -> tuple[np.ndarray, np.ndarray]:
        """The photo [H, W, 3] in display values with an emitter's colour [3], and the vase's coverage [H, W].

        Light adds up: the room's picture and the emitter's are drawn apart.
        """
        past, albedo = self.surroundings
        room_lit, emitter_lit = self.lit(None), self.lit(azimuth_deg)
        ground = room_lit.ground + emitter_lit.ground * color
        picture = response(gain * (past + albedo * ground / np.pi)).astype(np.float32)
        drawn = room_lit.drawn.copy()
        drawn[..., :3] = gain * (drawn[..., :3] + emitter_lit.drawn[..., :3] * color)
        window, whole = self.stage.window, (slice(0, self.height), slice(0, self.width))
        lay_object_over(picture, whole, drawn, window, self.stage.photo)
        cover, shown = np.zeros((self.height, self.width), np.float32), window.part(self.height, self.width)
        cover[shown] = drawn[within(shown, (slice(window.top, self.height), slice(window.left, self.width)))][..., 3]
        return picture, cover

    def gain(self, azimuth_deg: float, color: np.ndarray) -> float:
        """The exposure that gives the vase a mean radiance of 0.35."""
        drawn = self.lit(None).drawn[..., :3] + self.lit(azimuth_deg).drawn[..., :3] * color
        return 0.35 / float(luminance(drawn[self.lit(None).drawn[..., 3] == 1]).mean())


def emitter(time_s: float) -> tuple[float, np.ndarray]:
    """Azimuth and colour: left; round behind the camera to the right; cold; off; on again."""
    azimuth = float(np.interp(time_s, [4, 9], [-100, -260]))  # -260 is 100 degrees to the right
    color = WARM + np.interp(time_s, [11, 13], [0, 1]) * (COLD - WARM)
    return azimuth, color * (0.0 if 15 <= time_s < 17.5 else 1.0)


def photo(path: Path) -> None:
    """A .png whose alpha marks the vase, and the same photo as a .jpg."""
    table = Table(640, 480)
    picture, cover = table.draw(*emitter(0.0), table.gain(*emitter(0.0)))
    cut_out = Image.fromarray(to_bytes(np.dstack([picture, cover])))
    cut_out.save(path, optimize=True)
    cut_out.convert("RGB").save(path.with_suffix(".jpg"), quality=92)


def clip(path: Path) -> None:
    """H.264 with a sensor's noise."""
    from anyprobe.video.clip import write_piece

    table, rng = Table(*CLIP_SIZE), np.random.default_rng(1)
    gain = table.gain(*emitter(0.0))
    frames = []
    for index in range(FPS * SECONDS):
        picture, _ = table.draw(*emitter(index / FPS), gain)
        frames.append((index / FPS, to_bytes(picture + rng.normal(0, 0.006, picture.shape))))
    write_piece(path, frames)


def relit(path: Path) -> None:
    """examples/table.mp4 beside what `anyprobe video` makes of it, as an animated WebP."""
    from anyprobe.video.clip import open_clip, read_frames

    with tempfile.TemporaryDirectory() as folder, Image.open(HERE / "table.png") as still:
        masks = Path(folder) / "masks"
        masks.mkdir()
        for index in range(FPS * SECONDS):  # neither the vase nor the camera moves
            still.getchannel("A").resize(CLIP_SIZE).save(masks / f"{index:04d}.png")
        command = f"video {HERE / 'table.mp4'} -o {folder} --mask {masks} --fov {LONG_FOV_DEG:g} --every 3"
        command += f" --insert sphere --insert-material gold --at 228,183 --scale 0.6 --pitch {PITCH_DEG:g}"
        subprocess.run([*ANYPROBE, *command.split()], check=True)
        clips = (read_frames(open_clip(one), []) for one in (HERE / "table.mp4", Path(folder) / "relit.mp4"))
        frames = [Image.fromarray(np.concatenate([a.rgb, b.rgb], axis=1)) for a, b in zip(*clips, strict=True)]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=1000 // FPS, loop=0, quality=60, method=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("photo", "clip", "relit"))
    what = parser.parse_args().what
    if what == "photo":
        photo(HERE / "table.png")
    elif what == "clip":
        clip(HERE / "table.mp4")
    else:
        relit(DOCS / "relit.webp")


if __name__ == "__main__":
    main()
