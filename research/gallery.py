"""Draw docs/explanation/gallery.md and docs/gallery/*.jpg: photos, true and estimated light, an object relit by both.

    python -m research.gallery       # Mitsuba 3 (pip install '.[judge]', libllvm19)

Each photo is path traced: an object on a textured table under a map of 512 x 1024 pixels, both of anyprobe's own
making, through a phone's lens and curve with its noise. The estimate gets the photo, the object's mask and the lens's
field of view.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.response import response
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.files.objects import open_object
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.render.spheres import diffuse
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import sky, studio
from anyprobe_train.evaluate.metrics import color_angle_deg, direction_error_deg, power_ratio_stops
from research.painted import draw_texture
from research.path_traced import _environment, _shape, open_mitsuba

DOCS = Path(__file__).parent.parent / "docs"
WIDTH, HEIGHT, FOV_DEG = 480, 360, 30.0
PATHS, MAP_ROWS = 100, 512
NOISE, WHITE = 0.006, 0.35
"""Noise of display values; and the mean luminance that the exposure gives the photo."""
TILE, GAP, LABEL = 300, 4, 22


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """name; the object, its material and turn; which light, by a maker of maps and a seed; camera's pitch [degrees]."""

    name: str
    shape: str
    material: Material
    light: object
    seed: int
    inserted: str
    pitch_deg: float = 16.0


def surface(albedo: tuple[float, float, float], f0: float | tuple = 0.045, alpha: float = 0.3) -> Material:
    """A Material of plain numbers."""
    return Material(albedo=np.array(albedo), f0=np.broadcast_to(np.asarray(f0, float), 3), alpha=alpha)


SCENES = (
    Scene(name="glazed vase, room", shape="vase", material=surface((0.62, 0.60, 0.55), alpha=0.15), light=room,
          seed=3, inserted="chrome"),
    Scene(name="brass solid, room", shape="solid", material=surface((0, 0, 0), (0.89, 0.79, 0.43), 0.25),
          light=room, seed=8, inserted="matte"),
    Scene(name="yellow plastic, outdoors", shape="pebble", material=surface((0.75, 0.48, 0.05), alpha=0.3),
          light=sky, seed=5, inserted="matte"),
    Scene(name="grey stone, studio", shape="block", material=surface((0.4, 0.4, 0.4), alpha=0.7), light=studio,
          seed=2, inserted="chrome"),
)  # fmt: skip


def main() -> None:
    """All rows, and the page that shows them."""
    (DOCS / "gallery").mkdir(exist_ok=True)
    estimator, lines = Estimator(), [HEAD]
    for scene in SCENES:
        photo, truth, _ = photograph(scene)
        light = estimator.from_photo(photo)
        gain = np.float32(least_scale(photo, light.radiance))
        panorama = light.panorama(MAP_ROWS, frame="camera", lit=True).radiance * gain
        relit = []
        for radiance, likely in ((panorama, light.dominant_light().exists), (truth, 1.0)):
            stage = Stage(photo, open_object("sphere"), Arrangement(ground=light.ground, likely=likely))
            relit.append(stage.relit(radiance, scene.inserted))
        path = DOCS / "gallery" / f"{scene.name.replace(', ', '_').replace(' ', '_')}.jpg"
        sheet(photo.rgb, panorama, truth, relit).save(path, quality=82, optimize=True)
        said = errors(light.radiance * gain, reduced(truth, MAP_HEIGHT))
        lines.append(SECTION.format(name=scene.name, inserted=scene.inserted, path=path.name, errors=said))
        print(path, flush=True)
    (DOCS / "explanation" / "gallery.md").write_text("\n".join(lines), encoding="utf-8")


HEAD = """# Gallery

`python -m research.gallery` makes this page and its pictures: path-traced photos of scenes whose light is known,
with our own textured tables and surroundings. In each row: the photo, the estimated [panorama](../how-to/panorama.md)
above the true one, a sphere inserted in the estimated light, the same in the true light. Scenes were not selected by
their results.
"""
SECTION = """## {name}

![Photo, light, {inserted} sphere relit by the estimate and by the truth](../gallery/{path})

{errors}
"""


def photograph(scene: Scene) -> tuple[Photo, np.ndarray, np.ndarray]:
    """The photo with its mask, the true map [256, 512, 3] in its camera's frame and exposure, and the depth [H, W]."""
    mi = open_mitsuba()
    rng = np.random.default_rng(scene.seed)
    radiance = scene.light(rng, MAP_ROWS)
    tilt = np.radians(scene.pitch_deg)
    eye = np.array([0.0, 1.0 + 7.0 * np.sin(tilt), 7.0 * np.cos(tilt)])
    look = mi.ScalarTransform4f().look_at(origin=eye.tolist(), target=[0.55, 0.75, 0.0], up=[0, 1, 0])
    mesh = open_object(scene.shape)
    mesh = type(mesh)(
        positions=mesh.positions - [0, mesh.positions[:, 1].min(), 0], faces=mesh.faces, normals=mesh.normals
    )
    described = {"type": "scene", "integrator": {"type": "path", "max_depth": 6},
                 "light": _environment(mi, radiance), "table": table(mi, rng),
                 "object": _shape(mi, mesh, scene.material),
                 "sensor": {"type": "perspective", "fov": FOV_DEG, "fov_axis": "x", "to_world": look,
                            "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}},
                            "sampler": {"type": "multijitter", "sample_count": PATHS}}}  # fmt: skip
    picture = np.array(mi.render(mi.load_dict(described)))
    mask = object_share(mi, described)
    gain = WHITE / luminance(picture[..., :3]).mean()
    display = response(picture[..., :3] * gain) + NOISE * rng.standard_normal((HEIGHT, WIDTH, 3))
    world_from_camera = np.array(look.matrix)[:3, :3] @ np.diag([-1.0, 1.0, -1.0])
    truth = np.maximum(rotate(reduced(radiance, 4 * MAP_HEIGHT), world_from_camera.T), 0.0)
    photo = load_photo(to_bytes(display), name=scene.name, mask=mask, fov_deg=FOV_DEG)
    return photo, truth.astype(np.float32) * np.float32(gain), depth_of(mi, described, "table")


def object_share(mi, described: dict) -> np.ndarray:
    """How much of every pixel shows the object, [H, W]: rays that meet it in a scene of nothing else."""
    return (depth_of(mi, described) > 0).astype(np.float32)


def depth_of(mi, described: dict, *beside: str) -> np.ndarray:
    """Mean distance [H, W] of what rays meet of the object and what is named beside it, 0 where none does."""
    alone = {key: described[key] for key in ("type", "object", "sensor", *beside)}
    alone["integrator"] = {"type": "aov", "aovs": "d:depth"}
    return np.array(mi.render(mi.load_dict(alone)))[..., -1]


def table(mi, rng: np.random.Generator) -> dict:
    """A wide plane at height 0 with a texture repeated on it."""
    bitmap = {"type": "bitmap", "bitmap": mi.Bitmap(draw_texture(rng, 512)), "raw": True,
              "to_uv": mi.ScalarTransform4f().scale([2, 2, 1])}  # fmt: skip
    to_world = mi.ScalarTransform4f().rotate([1, 0, 0], -90).scale(4)
    return {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "diffuse", "reflectance": bitmap}}


def errors(light: np.ndarray, truth: np.ndarray) -> str:
    """One line for this estimate."""
    angle = direction_error_deg(find_dominant_light(light).direction, find_dominant_light(truth).direction)
    spheres = diffuse(light, MAP_HEIGHT), diffuse(truth, MAP_HEIGHT)
    color = color_angle_deg(*spheres, spheres[1].sum(axis=-1) > 0)
    stops = power_ratio_stops(light, truth)
    return (
        f"Errors: dominant light {angle:.0f}°, colour of a white sphere {color:.0f}°, total power {stops:+.1f} stops."
    )


def sheet(photo: np.ndarray, light: np.ndarray, truth: np.ndarray, relit: list[np.ndarray]) -> Image.Image:
    """Four tiles in a row with their titles."""
    height = round(TILE * HEIGHT / WIDTH)
    maps = Image.new("RGB", (TILE, height), "white")
    for index, one in enumerate((light, truth)):
        tile = Image.fromarray(to_bytes(response(one))).resize((round(height - GAP), (height - GAP) // 2))
        maps.paste(tile, ((TILE - tile.width) // 2, index * (height + GAP) // 2))
    tiles = [fitted(photo, height), maps, *(fitted(one, height) for one in relit)]
    titles = ("photo", "light: estimated, true", "relit, estimated light", "relit, true light")
    result = Image.new("RGB", (4 * TILE + 3 * GAP, LABEL + height), "white")
    draw, font = ImageDraw.Draw(result), ImageFont.load_default(14)
    for index, (tile, title) in enumerate(zip(tiles, titles, strict=True)):
        result.paste(tile, (index * (TILE + GAP), LABEL))
        draw.text((index * (TILE + GAP) + 2, 3), title, fill="black", font=font)
    return result


def fitted(picture: np.ndarray, height: int) -> Image.Image:
    """A display picture at the tile's size."""
    return Image.fromarray(to_bytes(picture)).resize((TILE, height), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    run_command(main)
