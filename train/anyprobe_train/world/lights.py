"""The light of a few photos: a map varied, its levels, and the sources that are traced by themselves."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.light_sources import split_sources
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.dataset.sky import even_disc, lamp_direction, tint
from anyprobe_train.world.maps import Maps

LIGHT_ROWS, SPLIT_ROWS = 256, 64
CONTRAST, TINT = 0.12, 0.1
"""Standard deviations of ln of the exponent that a map is raised to, and of its white."""
BLENDS, LAMPS = 0.3, 0.25
"""Shares of lights for tables that are a blend of two, or get lamps."""
JOINED, JOIN_DEG = 0.6, (50.0, 180.0)
"""Share of lights that are one place on one side and another on the other, of the same kind, and how wide they pass
into each other: else a network learns places by heart, and tells from what is in front what is behind."""
STRETCHED = 0.3
"""Most that a light is stretched and pressed along the horizon, as a share."""
MOVED = {"real": 0.6, "ground": 0.4}
"""Shares of lights whose sources are moved: else a network knows by what is seen of a map where its sources are."""
LAMP_DEG, LAMP_POWER, LAMP_TINT = (1.0, 20.0), (0.1, 3.0), 0.3
"""Bounds of a lamp's radius, of its power as a share of all other light, and its colour's spread."""
REACH_DEG = 13.0
MOST = 3
"""Sources of a map that are traced by themselves, the most powerful."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Light:
    """A sky of scene.Scene and its sources: directions [S, 3], radii [S] radians, power [S, 3]; outdoors: 1, 0 or
    NaN."""

    sky: np.ndarray
    direction: np.ndarray
    radius: np.ndarray
    power: np.ndarray
    outdoors: float
    name: str


def turned_map(one: np.ndarray, stretch: float, by: int, mirror: bool, about: int) -> np.ndarray:
    """Return a map [H, 2H, 3] at [LIGHT_ROWS, 2 LIGHT_ROWS, 3], turned by columns, mirrored or not, and stretched on
    one side, by how much and about which column."""
    columns, times = 2 * LIGHT_ROWS, LIGHT_ROWS // len(one)
    at = np.arange(columns) - about
    at = at + stretch * columns / (2 * np.pi) * np.sin(2 * np.pi / columns * at) + by
    at = np.round(at).astype(int) % columns
    return one[:, ((columns - 1 - at) if mirror else at) // times].repeat(times, 0)


def _turn(rng: np.random.Generator) -> tuple[float, int, bool, int]:
    """Draw how a map is turned."""
    columns = 2 * LIGHT_ROWS
    return (
        float(rng.uniform(0.0, STRETCHED)),
        int(rng.integers(columns)),
        rng.random() < 0.5,
        int(rng.integers(columns)),
    )


def joined(one: np.ndarray, other: np.ndarray, middle: int, half: float, passing: float) -> np.ndarray:
    """Return one map [H, 2H, 3], and the other within `half` of a column, passing over so many columns."""
    columns = one.shape[1]
    away = np.abs((np.arange(columns) - middle + columns / 2) % columns - columns / 2)
    share = np.clip((half - away) / passing + 0.5, 0.0, 1.0)
    share = (share**2 * (3 - 2 * share)).astype(np.float32)[:, None]
    return one + share * (other - one)


def levels(texels: np.ndarray, smallest: int) -> np.ndarray:
    """Return all levels of a map [H, 2H, 3] down to `smallest` rows, flat [T, 3] float32, each texel the mean of four
    by solid angle."""
    found = [texels]
    while len(texels) > smallest:
        half = len(texels) // 2
        shares = pixel_solid_angles(2 * half).reshape(half, 2)
        shares = (2 * shares / shares.sum(axis=1, keepdims=True)).astype(np.float32).reshape(-1, 1, 1)
        texels = cv2.resize(texels * shares, (2 * half, half), interpolation=cv2.INTER_AREA)
        found.append(texels)
    return np.concatenate([one.reshape(-1, 3) for one in found])


def measured(full: np.ndarray, rest: np.ndarray, way: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return what a map has more than the rest within `reach` of a direction: its power [3], its middle [3], and the
    radius of an even disc of its power P and integral Q of its square, sqrt(P^2 / (pi Q))."""
    near = pixel_directions(len(full)) @ way >= np.cos(reach)
    d, angle = pixel_directions(len(full))[near], np.broadcast_to(pixel_solid_angles(len(full)), near.shape)[near]
    more = full[near] - rest[near]
    bright = luminance(more)
    middle = (bright * angle) @ d
    radius = np.sqrt((bright * angle).sum() ** 2 / max(np.pi * (bright**2 * angle).sum(), 1e-12))
    return angle @ more, middle / max(np.linalg.norm(middle), 1e-9), float(radius)


def make_light(radiance: np.ndarray, outdoors: float, name: str, most: int = MOST) -> Light:
    """Split a map [256, 512, 3] into its sky and at most so many sources, and build the levels of both."""
    full = levels(radiance, 8)
    start = 2 * LIGHT_ROWS**2 + 2 * (LIGHT_ROWS // 2) ** 2
    small = full[start : start + 2 * SPLIT_ROWS**2].reshape(SPLIT_ROWS, 2 * SPLIT_ROWS, 3)
    found, soft = split_sources(small) if most else ((), small)
    found = sorted(found, key=lambda one: -luminance(one.power))[:most]
    if len(found):
        ratio = np.clip(soft / np.maximum(small, 1e-9), 0.0, 1.0).astype(np.float32)
        near, directions = np.zeros(ratio.shape[:2], bool), pixel_directions(SPLIT_ROWS)
        for one in found:  # of sources that are not kept, all is in the sky
            near |= directions @ one.direction > np.cos(np.radians(REACH_DEG))
        ratio[~near] = 1.0
        rest = radiance * ratio.repeat(LIGHT_ROWS // SPLIT_ROWS, 0).repeat(LIGHT_ROWS // SPLIT_ROWS, 1)
    else:
        rest = radiance
    spots = [measured(radiance, rest, one.direction, np.radians(REACH_DEG)) for one in found]
    return Light(
        sky=np.concatenate([full, levels(rest, 8) if found else full]),
        direction=np.array([spot[1] for spot in spots], np.float32).reshape(-1, 3),
        radius=np.array([spot[2] for spot in spots], np.float32),
        power=np.array([spot[0] for spot in spots], np.float32).reshape(-1, 3),
        outdoors=outdoors,
        name=name,
    )


def draw_light(rng: np.random.Generator, maps: Maps, kind: str) -> Light:
    """Draw a light for a kind of place: "ground" a real map as it is, "real" one varied, "procedural", or "dark"."""
    if kind == "procedural" or (kind == "ground" and rng.random() < 0.06):
        pool, kinds, names = maps.places["radiance"], maps.places["outdoors"], None
        weights = np.full(len(pool), 1.0 / len(pool))
    else:
        pool, kinds, names = maps.real, maps.outdoors, maps.names
        weights = maps.grounds if kind == "ground" else maps.weights
    number = int(rng.choice(len(pool), p=weights))
    outdoors, name = float(kinds[number]), names[number] if names else "procedural"
    radiance = turned_map(pool[number], *_turn(rng))
    if rng.random() < JOINED:
        alike = weights * (kinds == outdoors if outdoors in (0.0, 1.0) else np.isnan(kinds))
        turn = _turn(rng)
        other = turned_map(pool[int(rng.choice(len(pool), p=alike / alike.sum()))], *turn)
        half, passing = rng.uniform(0.125, 0.375), rng.uniform(*JOIN_DEG) / 360
        columns = 2 * LIGHT_ROWS
        radiance = joined(radiance, other, int(rng.integers(columns)), half * columns, passing * columns)
    elif kind == "real" and rng.random() < BLENDS:
        second = int(rng.choice(len(pool), p=weights))
        radiance = radiance + np.float32(rng.uniform(0.2, 0.8)) * (turned_map(pool[second], *_turn(rng)) - radiance)
        outdoors = outdoors if outdoors == kinds[second] else np.nan
    white = tint(rng, TINT if kind != "ground" else 0.5 * TINT)
    exponent = np.float32(np.exp(rng.normal(0.0, CONTRAST)))
    radiance = normalize_map(np.power(radiance + np.float32(1e-9), exponent) * white.astype(np.float32))
    if kind == "dark":
        left = np.float32(np.exp(rng.uniform(np.log(1e-4), np.log(0.08))))  # of a room's own light
        return make_light(np.maximum(radiance * left, 1e-6), np.nan, name, 0)
    if rng.random() < MOVED.get(kind, 0.0):
        light = make_light(radiance, outdoors, name)
        radiance = light.sky[len(light.sky) // 2 :][: 2 * LIGHT_ROWS**2].reshape(LIGHT_ROWS, 2 * LIGHT_ROWS, 3).copy()
        for radius, power in zip(light.radius, light.power, strict=True):
            _add(rng, radiance, lamp_direction(rng), float(radius), power)
    elif rng.random() < LAMPS * (0.6 if kind == "ground" else 1.0):
        for _ in range(1 if kind == "ground" else rng.integers(1, 4)):
            radius = np.radians(np.exp(rng.uniform(*np.log(LAMP_DEG))))
            power = 4 * np.pi * np.exp(rng.uniform(*np.log(LAMP_POWER))) * tint(rng, LAMP_TINT)
            _add(rng, radiance, lamp_direction(rng), float(radius), power)
    return make_light(radiance, outdoors, name)


def _add(rng: np.random.Generator, radiance: np.ndarray, way: np.ndarray, radius: float, power: np.ndarray) -> None:
    radius = max(radius, 1.2 * np.pi / LIGHT_ROWS)
    radiance += even_disc(LIGHT_ROWS, way, radius, float(rng.uniform(0.1, 1.0)), power)


def with_lamp(rng: np.random.Generator, light: Light, way: np.ndarray, radius: float, power: np.ndarray) -> Light:
    """Return a light with one far lamp more, drawn into the sky that is seen and kept as a source."""
    first = light.sky[: 2 * LIGHT_ROWS**2].reshape(LIGHT_ROWS, 2 * LIGHT_ROWS, 3).copy()
    _add(rng, first, way, radius, power)
    return replace(
        light,
        sky=np.concatenate([levels(first, 8), light.sky[len(light.sky) // 2 :]]),
        direction=np.concatenate([light.direction, np.asarray(way, np.float32)[None]]),
        radius=np.append(light.radius, np.float32(radius)),
        power=np.concatenate([light.power, np.asarray(power, np.float32)[None]]),
    )
