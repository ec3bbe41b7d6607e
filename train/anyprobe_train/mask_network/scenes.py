"""Scenes: what a photo of several objects shows before the camera, with each object's cover of every pixel."""

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.masks.networks import PADDING_GREY
from anyprobe_train.world.batch import World, companions, light_kind, trace
from anyprobe_train.world.layout import draw_layout, stand_beside
from anyprobe_train.world.lights import draw_light
from anyprobe_train.world.look import develop, draw_look
from anyprobe_train.world.photo import Frame
from anyprobe_train.world.windows import Window, window_resampled

SCENE_PX = 256
"""Side of a scene's square [pixels]: parts of it are as sharp as the mask network's input."""
FAMILIES = {"ground": 0.28, "table": 0.25, "things": 0.25, "dark": 0.06, "procedural": 0.12, "no_object": 0.04}
"""Shares of the world's families of photos."""
OTHERS = (0.45, 0.3, 0.17, 0.08)
"""Shares of scenes with so many objects beside the first, or more where the family has some."""
PAINTED_SHARE = 0.5
"""Share of the first objects that have a texture: an object is all of its parts, whatever their colours."""
PLAIN_SHARE = 0.1
"""Share of scenes before one colour, without other objects."""
SCENES_PER_COUNT = 12
"""Scenes for which a batch of the world would be made: more views join as there."""
SHAKEN_SHARE, SHAKE_PX = 0.1, (1.0, 3.5)
"""Share of photos that are blurred along a line, and half its length [pixels]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """Radiance [S, S, 3] over the frame's square, covers [N, S, S] of its N objects as far as they are seen in the
    photo, and the light [64, 128, 3] that a camera's white balance goes by."""

    radiance: np.ndarray
    covers: np.ndarray
    frame: Frame
    light: np.ndarray

    @property
    def whole(self) -> Window:
        """All of the photo."""
        x, y = self.frame.tangents
        return -x, x, y, -y


@dataclass(frozen=True, kw_only=True, slots=True)
class MaskPhoto:
    """Photo [S, S, 3] of display values, grey beyond its borders; covers [N, S, S] of its objects; bounds: the photo's
    rows and columns, first and end of each."""

    photo: np.ndarray
    covers: np.ndarray
    bounds: tuple[int, int, int, int]


def draw_scene(world: World, seed: int, number: int, size: int = SCENE_PX) -> Scene:
    """Draw scene `number`, a function of both numbers: an object of the world, and some more beside it.

    size: side of its square; objects are as sharp as the world's views of them.
    """
    rng = np.random.default_rng((seed, 2, number))
    batch = number // SCENES_PER_COUNT
    family = str(rng.choice(list(FAMILIES), p=list(FAMILIES.values())))
    light = draw_light(rng, world.maps, light_kind(family, rng))
    view = world.views[int(rng.integers(world.count(batch)))]
    count = int(rng.choice(len(OTHERS), p=OTHERS))
    others = companions(world, view, batch, rng, count) if count else []
    surroundings = ("ground", "table", "things")[rng.integers(3)] if family == "no_object" else family
    layout = draw_layout(rng, surroundings, view, light, world.maps, others[:2])
    eye = view["eye"].astype(float)
    toward = eye * [1, 0, 1] / np.linalg.norm(eye[[0, 2]])
    layout.others.extend(stand_beside(rng, other, view, toward) for other in others[len(layout.others) :])
    is_plain = family != "no_object" and rng.random() < PLAIN_SHARE
    traced = trace(world.maps, "cut_out" if is_plain else family, layout, view, rng, PAINTED_SHARE, size)
    behind = traced.behind
    if behind is None:
        mean = traced.own[..., :3].mean() / max(float(traced.own[..., 3].mean()), 1e-6)
        behind = np.full_like(traced.own[..., :3], mean * rng.choice([0.0, 0.1, 1.0, rng.uniform(0.1, 3.0), 4.0]))
    covers: list[np.ndarray] = []
    for one in (*(() if is_plain else traced.others), traced.own):
        covers = [cover * (1 - one[..., 3]) for cover in covers] + [one[..., 3] * traced.in_photo]
    seen = [cover for cover in covers if cover.max() > 0.5]
    return Scene(
        radiance=traced.own[..., :3] + (1 - traced.own[..., 3:]) * behind,
        covers=np.array(seen, np.float32).reshape(-1, size, size),
        frame=traced.frame,
        light=traced.truth,
    )


def photograph(rng: np.random.Generator, scene: Scene, part: Window, size: int) -> MaskPhoto:
    """Photograph a part of a scene by a camera that is drawn anew, so many pixels across its longer side."""
    left, right, top, bottom = part
    half, x, y = max(right - left, top - bottom) / 2, (left + right) / 2, (top + bottom) / 2
    square = x - half, x + half, y + half, y - half
    samples = 2 if half / size > 1.3 * scene.frame.most / len(scene.radiance) else 1

    def read(values: np.ndarray) -> np.ndarray:
        return window_resampled(values, scene.frame.square, square, size, samples)

    high, wide = (max(1, round(size * side / (2 * half))) for side in (top - bottom, right - left))
    first, begin = (size - high) // 2, (size - wide) // 2
    inside = np.s_[first : first + high, begin : begin + wide]
    radiance = read(scene.radiance)
    if rng.random() < SHAKEN_SHARE:
        radiance = _shaken(rng, radiance)
    covers = np.zeros((len(scene.covers), size, size), np.float32)
    for cover, one in zip(covers, scene.covers, strict=True):
        cover[inside] = read(one)[inside]
    bright, on = luminance(radiance)[inside], covers.sum(axis=0)[inside]
    object_mean = max(float((bright * on).sum() / on.sum()), 1e-9) if on.any() else None
    look = draw_look(rng, object_mean, bright.ravel(), scene.light)
    photo = np.full((size, size, 3), PADDING_GREY, np.float32)
    photo[inside] = develop(look, radiance, square, scene.frame, look.blur, rng)[inside] / 255.0
    return MaskPhoto(photo=photo, covers=covers, bounds=(first, first + high, begin, begin + wide))


def _shaken(rng: np.random.Generator, picture: np.ndarray) -> np.ndarray:
    """Blur a picture [S, S, C] along a short line of random direction."""
    reach, angle = rng.uniform(*SHAKE_PX), rng.uniform(0, np.pi)
    steps = np.round(np.outer(np.linspace(-reach, reach, 15), [np.sin(angle), np.cos(angle)])).astype(int)
    return np.mean([np.roll(picture, step, axis=(0, 1)) for step in steps], axis=0)
