"""Lights of a video, kept still on a still scene and quick where the light changes.

video.run calls `step` for each frame with a light of its own; the numbers are `filter` of contract.json.

A frame's map is split into a soft part and discrete sources (light.light_sources). The soft part is averaged pixel by
pixel (light.steady). **Each source is a Kalman filter** of its direction and of ln(power, radius), whose state x with
variance P and measurement z with variance R give

    P += drift^2 dt,    K = P / (P + R),    x += K (z - x),    P = (1 - K) P

An average of maps would show a trembling source several times; the filter of one source turns it. A measurement belongs
to the source whose innovation is the least, and to none beyond `gate`: what is found elsewhere is another source, which
appears while the old one fades. Where poses are given the filter works in the world, where light does not turn with the
camera: drift is `world_drift` of it then, and grows with the camera's turn.

**The leader** is the strongest source, and stays so until another is `lead` times as strong; that other then takes
its place. A frame in which the leader is not found, or the soft part is `cut` off, is held back once: the second in a
row is believed. While the caller knows that the object's shading did not change, the light did not either: nothing
drifts, and such frames are held back for as long as the leader has led, at most `patience` seconds. Frames that stay
odd for longer are a better estimate of the same light: the leader turns to their strongest source.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core import Float
from anyprobe.core.color import luminance
from anyprobe.core.frames import check_pose
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.light.environment import check_radiance, rotate
from anyprobe.light.light_sources import BLUR_RADIUS, LightSource, draw_sources, edge_cosine, split_sources
from anyprobe.light.steady import FILTER, Steady, advance, begin_filter

OFFSET: float = FILTER["offset"]
"""Radiance added before the logarithm: values far below hardly light anything, and black stays finite."""
SLOPE = np.float32(1.0 + OFFSET)
WHITE = np.log(SLOPE)
"""y = ln(L + OFFSET) of L = 1; above it dL = SLOPE dy."""
RULES = FILTER["source"]
LEAD_MARGIN: float = RULES["margin"]
"""Least ratio of the leader's peak to that of any other source that is shown."""


NOISE, DRIFT, GATE = (float(np.radians(RULES[f"{name}_deg"])) for name in ("noise", "drift", "gate"))
"""One-sigma error of one frame's direction [radians], and drift of the light itself in a second; largest innovation
that is the same source's."""
SIZE_NOISE, SIZE_DRIFT = RULES["size_noise"], RULES["size_drift"]
"""The same of sizes, in ln units."""
WORLD_DRIFT, TURN_DRIFT = RULES["world_drift"], RULES["turn_drift"]
"""Share of the drift where light is filtered in the world, and drift for each radian that the camera turns there."""
LEAD, CUT = RULES["lead"], RULES["cut"]
"""Ratio of strengths at which the leader changes, and distance of ln radiance of another scene."""
FADE_S, SAME_S, PATIENCE_S = RULES["fade_s"], RULES["same_s"], RULES["patience_s"]
"""Times in which a source appears and fades, and after which an object that looks the same counts as such; patience:
see the module."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Track:
    """A source followed over frames.

    direction: [3] unit. size: ln of power RGB + OFFSET and of the radius, [4]. variance, size_variance: of both, as the
    squares of NOISE and SIZE_NOISE. share: fraction of its power that is shown. is_seen: the last frame had it. leads:
    it is the leader.
    """

    direction: np.ndarray
    size: np.ndarray
    variance: float
    size_variance: float
    share: float
    is_seen: bool = True
    leads: bool = False

    @property
    def source(self) -> LightSource:
        """The source with the shown part of its power."""
        power = np.maximum(np.exp(self.size[:3]) - OFFSET, 0.0) * self.share
        return LightSource(direction=self.direction, power=power, radius_deg=float(np.exp(self.size[3])))


@dataclass(frozen=True, kw_only=True, slots=True)
class FilterState:
    """State that one frame hands to the next.

    soft: y of the soft part, [H, 2H, 3] float32. tracks: the sources. pose: world_from_camera of the last frame.
    held: whether the last frame was held back. odd_s: how long frames have been odd. led_s: time since the leader
        became one. same_s: time since the object last looked different. in_world: whether frames had poses.
    """

    soft: Steady
    tracks: tuple[Track, ...]
    pose: np.ndarray
    held: bool = False
    odd_s: float = 0.0
    led_s: float = 0.0
    same_s: float = float("inf")
    in_world: bool = False

    @property
    def sources(self) -> tuple[LightSource, ...]:
        """The discrete sources to show, the leader first."""
        ordered = sorted(self.tracks, key=lambda track: not track.leads)
        found = [one for one in (track.source for track in ordered) if luminance(one.power) > 0.0]
        return (*found[:1], *(_weaker(one, found[0]) for one in found[1:]))

    @property
    def radiance(self) -> Float[np.ndarray, "H 2*H 3"]:
        """The light to show, [H, 2H, 3] linear."""
        return self.seen_from(None)

    def seen_from(self, world_from_camera: np.ndarray | None) -> Float[np.ndarray, "H 2*H 3"]:
        """Return the light in a camera's frame, see step; None: in the frame that the filter works in."""
        y, sources = self.soft.steady, self.sources
        soft = np.maximum(np.exp(np.minimum(y, WHITE)) - OFFSET, 0.0) + SLOPE * _above_white(y)
        if world_from_camera is not None:
            pose = check_pose(world_from_camera, "world_from_camera")
            soft = np.maximum(rotate(soft, pose.T), 0.0)
            sources = tuple(replace(one, direction=one.direction @ pose) for one in sources)
        return soft + draw_sources(len(soft), sources)


def step(
    state: FilterState | None,
    radiance: Float[np.ndarray, "H 2*H 3"],
    dt_s: float,
    world_from_camera: np.ndarray | None = None,
    looks_same: bool = False,
) -> FilterState:
    """Return the state after one more frame; pure.

    Args:
        state: after the last frame; None for the first. One of maps of another size, or with poses where this frame
            has none or the other way round, counts as None: the filter begins anew.
        radiance: [H, 2H, 3] of this frame.
        dt_s: seconds since the last frame, > 0; may differ from frame to frame.
        world_from_camera: this frame's camera's rotation, [3, 3] or [4, 4]; the state is filtered in the world then.
        looks_same: whether the object's shading equals that of the last frames; False if unknown.
    Raises:
        InputError: world_from_camera is no rotation. InvalidEnvironment: not a map.
    """
    sources, soft = split_sources(check_radiance(radiance, "frame's light"))
    in_world = world_from_camera is not None
    pose = np.eye(3) if world_from_camera is None else check_pose(world_from_camera, "world_from_camera")
    if in_world:
        soft = np.maximum(rotate(soft, pose), 0.0)
        sources = tuple(replace(one, direction=pose @ one.direction) for one in sources)
    y = np.log(np.minimum(soft, 1.0) + np.float32(OFFSET)) + np.maximum(soft - 1.0, 0.0) / SLOPE
    if state is not None and not (np.isfinite(dt_s) and dt_s > 0):
        raise ValueError(f"expected dt_s > 0, got {dt_s}")
    if state is None or state.in_world != in_world or state.soft.fast.shape != y.shape:
        return _begun(y, sources, pose, in_world)
    same_s = state.same_s + dt_s if looks_same else 0.0
    is_same = same_s > SAME_S
    turned = float(np.arccos(np.clip((np.sum(state.pose * pose) - 1.0) / 2.0, -1.0, 1.0)))  # 0 without poses
    tracks = state.tracks if is_same else tuple(_predicted(one, dt_s, turned, in_world) for one in state.tracks)
    pairs = _pairs(tracks, sources)
    is_cut = _apart(y, state.soft.fast) > CUT
    odd_s = state.odd_s + dt_s if is_cut or _is_odd(tracks, sources, pairs) else 0.0
    if 0.0 < odd_s <= max(min(state.led_s, PATIENCE_S) if is_same else 0.0, dt_s):
        return replace(state, held=True, odd_s=odd_s, same_s=same_s)
    if is_cut and not is_same:
        return replace(_begun(y, sources, pose, in_world), same_s=same_s)
    if is_same and odd_s > 0.0:
        tracks, pairs = _with_leader_at_strongest(tracks, sources, pairs)
    tracks = _led(_followed(tracks, sources, pairs, dt_s), math.inf if is_same else LEAD)
    has_leader = any(track.leads and track.is_seen for track in tracks) and odd_s == 0.0
    return FilterState(
        soft=advance(state.soft, y, dt_s, _apart),
        tracks=tracks,
        pose=pose,
        odd_s=odd_s if is_same else 0.0,
        led_s=state.led_s + dt_s if has_leader else state.led_s if is_same else 0.0,
        same_s=same_s,
        in_world=in_world,
    )


def _begun(y: np.ndarray, sources: Sequence[LightSource], pose: np.ndarray, in_world: bool) -> FilterState:
    """Return the first state, or that after a cut."""
    tracks = _led(tuple(_new(one, share=1.0) for one in sources), LEAD)
    return FilterState(soft=begin_filter(y), tracks=tracks, pose=pose, in_world=in_world)


def _new(source: LightSource, share: float) -> Track:
    direction = np.asarray(source.direction, np.float64)
    return Track(direction=direction, size=_size(source), variance=NOISE**2, size_variance=SIZE_NOISE**2, share=share)


def _predicted(track: Track, dt_s: float, turned: float, in_world: bool) -> Track:
    """Return a track whose variances have grown by the drift of dt_s seconds and of a turn [radians] of the camera."""
    share = WORLD_DRIFT if in_world else 1.0
    variance = (share * DRIFT) ** 2 * dt_s + (TURN_DRIFT * turned) ** 2
    return replace(track, variance=track.variance + variance, size_variance=track.size_variance + SIZE_DRIFT**2 * dt_s)


def _updated(track: Track, source: LightSource) -> Track:
    """Return a track after a measurement of its source, whose innovation counts up to the gate."""
    gain = track.variance / (track.variance + NOISE**2)
    size_gain = track.size_variance / (track.size_variance + SIZE_NOISE**2)
    innovation = source.direction - track.direction
    innovation = innovation * min(1.0, GATE / max(_angle(track.direction, source.direction), 1e-9))
    direction = track.direction + gain * innovation
    return replace(
        track,
        direction=direction / np.linalg.norm(direction),
        size=track.size + size_gain * (_size(source) - track.size),
        variance=(1.0 - gain) * track.variance,
        size_variance=(1.0 - size_gain) * track.size_variance,
        is_seen=True,
    )


def _followed(
    tracks: Sequence[Track], sources: Sequence[LightSource], pairs: dict[int, int], dt_s: float
) -> tuple[Track, ...]:
    """Return the tracks after one more frame: those that it has, those that it lacks, fading, and new ones."""
    fade = min(dt_s / FADE_S, 1.0)
    followed = [
        replace(_updated(track, sources[pairs[i]]), share=min(track.share + fade, 1.0))
        if i in pairs
        else replace(track, is_seen=False, share=track.share - (0.0 if track.is_seen else fade))
        for i, track in enumerate(tracks)
    ]
    taken = set(pairs.values())
    followed += [_new(one, share=fade) for j, one in enumerate(sources) if j not in taken]
    return tuple(track for track in followed if track.share > 0.0)


def _pairs(tracks: Sequence[Track], sources: Sequence[LightSource]) -> dict[int, int]:
    """Match sources of the frame to tracks by the least innovation: indices of sources by those of tracks.

    A source's reach is its own radius: a wide one's centre is less certain.
    """
    costs = []
    for i, track in enumerate(tracks):
        for j, source in enumerate(sources):
            angle = _angle(track.direction, source.direction) / (GATE + np.radians(source.radius_deg) / 2.0)
            if angle <= 1.0:
                costs.append((angle + float(np.abs(track.size[:3] - _size(source)[:3]).mean()), i, j))
    pairs: dict[int, int] = {}
    for _, i, j in sorted(costs):
        if i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def _with_leader_at_strongest(
    tracks: tuple[Track, ...], sources: Sequence[LightSource], pairs: dict[int, int]
) -> tuple[tuple[Track, ...], dict[int, int]]:
    """Match the leader with the strongest source, wherever it is; it is as uncertain as half a frame's noise."""
    leader = next((i for i, track in enumerate(tracks) if track.leads), None)
    if leader is None or not sources:
        return tracks, pairs
    first = int(np.argmax([_strength(one) for one in sources]))
    doubted = replace(tracks[leader], variance=max(tracks[leader].variance, (NOISE / 2.0) ** 2))
    others = {i: j for i, j in pairs.items() if i != leader and j != first}
    return (*tracks[:leader], doubted, *tracks[leader + 1 :]), {**others, leader: first}


def _peak(source: LightSource) -> float:
    """Return the luminance of a drawn source, summed within BLUR_RADIUS of its middle."""
    edge = edge_cosine(source)
    beyond = max(np.cos(BLUR_RADIUS) - edge, 0.0) / (1.0 - edge)
    return float(luminance(source.power)) * (1.0 - beyond**2)


def _strength(source: LightSource) -> float:
    """Return a source's rank: between its power and what the dominant light goes by, in which wide sources are dull."""
    return float(np.sqrt(float(luminance(source.power)) * _peak(source)))


def _led(tracks: Sequence[Track], lead: float) -> tuple[Track, ...]:
    """Return the tracks with their leader marked: the same as before, unless another is `lead` times as strong, or the
    last frame did not have it."""
    strengths = [_strength(track.source) * track.is_seen for track in tracks]
    best = int(np.argmax(strengths)) if tracks else -1
    for i, track in enumerate(tracks):
        if track.leads and track.is_seen and strengths[best] <= lead * strengths[i]:
            best = i
    return tuple(replace(track, leads=i == best) for i, track in enumerate(tracks))


def _is_odd(tracks: Sequence[Track], sources: Sequence[LightSource], pairs: dict[int, int]) -> bool:
    """Return whether a frame shows another leader than the known one."""
    for i, track in enumerate(tracks):
        if track.leads:
            most = max((_strength(one) for one in sources), default=0.0)
            return i not in pairs or most > LEAD * _strength(sources[pairs[i]])
    return False


def _weaker(source: LightSource, leader: LightSource) -> LightSource:
    """Return a source whose peak is below the leader's by the margin, so that rank and map agree."""
    most = _peak(leader) / (LEAD_MARGIN * max(_peak(source), 1e-9))
    return source if most >= 1.0 else replace(source, power=source.power * most)


def _size(source: LightSource) -> np.ndarray:
    return np.log([*(source.power + OFFSET), source.radius_deg])


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    return float(2.0 * np.arcsin(min(float(np.linalg.norm(one - other)) / 2.0, 1.0)))


def _above_white(y: np.ndarray) -> np.ndarray:
    return np.maximum(y - WHITE, 0.0)


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the root mean square difference of ln(L + OFFSET) over sphere and channels, of two y [H, 2H, 3]."""
    first, second = (np.minimum(y, WHITE) + np.log1p(_above_white(y)) for y in (one, other))
    difference = first - second
    weights = pixel_solid_angles(difference.shape[0])[:, 0].astype(np.float64)
    return float(np.sqrt(np.square(difference, dtype=np.float64).mean(axis=(1, 2)) @ weights / weights.sum()))
