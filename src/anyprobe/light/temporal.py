"""Lights of a video, kept still on a still scene and quick where the light changes.

A frame's map is split into a soft part and discrete sources (light.source_split). Each is filtered by its own rule (by
light.steady): the soft part pixel by pixel, the sources as objects, because an average of maps would show a trembling
source several times. Where poses are given, this happens in the world: there light stands still while the camera turns.

**The soft part**: y = ln(L + 0.01), above white a straight line; |.| is the root mean square over the sphere and the
channels of differences of ln(L + 0.01). A frame further off than cut_level is held back; the second in a row starts
anew.

**Sources.** A source of the frame is matched to a track so that angle / gate_deg + |ln of the ratio of powers| /
ln gate_ratio is least, neither term above 1. Its direction is then the next value of the track's place, its ln power
and ln radius those of its size; a place within slack_deg has not moved, and the shown direction turns by at most
most_turn_deg_s. A new source grows to its whole power in fade_s; one unseen for patience_s fades at the same speed.
While two places share one source's power in this way, their sum is the total of the frames' sources.

**The leader** is the strongest source, by the root of its power times the part of it within PEAK of its middle. It
stays the leader until another is lead_ratio times as strong; as long as that part is not lead_margin times another's,
the two exchange the missing power, so that sources which change rank from frame to frame move no dominant light. A
frame is odd if the leader is not found in it, or another source is lead_ratio times as strong. It is held back; the
second in a row is believed.

**The object looks the same** if the caller knows that its shading did not change; then its light did not either. Once
that has lasted same.after_s, places are averaged whatever they do, and odd frames are held back for as long as the
leader has led, at most same.odd_s. Frames that stay odd for longer are a better estimate of the same light: the leader
takes the place of the frame's strongest source, and the shown direction turns there by same.most_turn_deg_s.

**The view.** Estimates of one light from two sides differ by more than estimates from one side tremble. view goes from
0 to 1 while the camera turns by view.turn_deg from where it was when the source last moved. A motion is then measured
not from the average but, by the share view, from the values of the last view.recent_s, and counts beyond view times
view.slack_deg, or ln view.slack_ratio in each channel; the shown direction of a source that has not moved turns by
view.most_turn_deg_s at most. So a slow drift of estimates is averaged, and a light that changes at once is followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.frames import check_pose
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.light.environment import check_radiance, rotate
from anyprobe.light.source_split import Source, draw_sources, split_sources
from anyprobe.light.steady import FILTER, Smoothing, Steady, advance, begin_filter, gain, toward

if TYPE_CHECKING:
    from jaxtyping import Float

OFFSET: float = FILTER["offset"]
"""Radiance added before the logarithm: values far below hardly light anything, and black stays finite."""
SLOPE = np.float32(1.0 + OFFSET)
WHITE = np.log(SLOPE)
"""y of L = 1; above it dL = SLOPE dy."""

RULES = FILTER["source"]
GATE = float(np.radians(RULES["gate_deg"]))
LN_RATIO = float(np.log(RULES["gate_ratio"]))
SLACK = float(np.radians(RULES["slack_deg"]))
MOST_TURN: float = float(np.radians(RULES["most_turn_deg_s"]))
PATIENCE_S: float = RULES["patience_s"]
FADE_S: float = RULES["fade_s"]
MOST: int = RULES["most"]
SAME_AFTER_S: float = RULES["same"]["after_s"]
LEAST_ODD_S, MOST_ODD_S = RULES["same"]["odd_s"]
SAME_MOST_TURN: float = float(np.radians(RULES["same"]["most_turn_deg_s"]))
LEAD_RATIO, LEAD_MARGIN = float(RULES["lead_ratio"]), float(RULES["lead_margin"])
PEAK: float = float(np.radians(contract("dominant_light")["blur_deg"]))
"""Radius [radians] of the cap within which find_dominant_light compares."""
VIEW_TURN, VIEW_MOST_TURN = (float(np.radians(RULES["view"][name])) for name in ("turn_deg", "most_turn_deg_s"))
VIEW_SLACK = float(np.radians(RULES["view"]["slack_deg"]))
VIEW_SLACK_SIZE = float(np.sqrt(3.0) * np.log(RULES["view"]["slack_ratio"]))
RECENT_S: float = RULES["view"]["recent_s"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Track:
    """A source followed over frames.

    place: its direction, [3] float64. size: ln power and ln radius, [4]. recent: [7], both over the last RECENT_S.
    shown: [3] unit, direction shown. share: fraction of its power shown. pose: world_from_camera of the last frame in
        which it moved, or of its first. turns: it has moved and the shown direction is still turning there. unseen_s:
        time since a frame had it. leads: it is the leader.
    """

    place: Steady
    size: Steady
    recent: np.ndarray
    shown: np.ndarray
    share: float
    pose: np.ndarray
    turns: bool = False
    unseen_s: float = 0.0
    leads: bool = False

    @property
    def direction(self) -> np.ndarray:
        """Unit direction [3] of the place, which the shown direction turns to."""
        return self.place.steady / np.linalg.norm(self.place.steady)

    @property
    def source(self) -> Source:
        """The source with its whole power."""
        power, radius = np.exp(self.size.steady[:3]) - OFFSET, float(np.exp(self.size.steady[3]))
        return Source(direction=self.shown, power=np.maximum(power, 0.0), radius=radius)


@dataclass(frozen=True, kw_only=True, slots=True)
class FilterState:
    """State that one frame hands to the next.

    soft: y of the soft part, [H, 2H, 3] float32. power: ln of the sources' total luminance, [1]. tracks: the sources.
    held: whether the last frame was held back. odd_s: how long frames have been odd. led_s: time since the leader
        became one. same_s: time since the object last looked different. in_world: whether frames had poses.
    """

    soft: Steady
    power: Steady
    tracks: tuple[Track, ...]
    held: bool = False
    odd_s: float = 0.0
    led_s: float = 0.0
    same_s: float = 0.0
    in_world: bool = False

    @property
    def sources(self) -> tuple[Source, ...]:
        """The discrete sources to show."""
        whole = [(track.source, track.share) for track in self.tracks]
        asked = sum(share * float(luminance(one.power)) for one, share in whole)
        there = max(float(np.exp(self.power.steady[0])) - OFFSET, 0.0)
        scale = min(1.0, there / asked) if asked > 0.0 else 0.0
        found = [replace(one, power=one.power * (scale * share)) for one, share in whole]
        for at in range(len(self.tracks)):
            if self.tracks[at].leads:
                _put_first(found, at)
        return tuple(one for one in found if luminance(one.power) > 0.0)

    @property
    def radiance(self) -> Float[np.ndarray, "H 2*H 3"]:
        """The light to show, [H, 2H, 3] linear."""
        return self.seen_from(None)

    def seen_from(self, world_from_camera: np.ndarray | None) -> Float[np.ndarray, "H 2*H 3"]:
        """Return the light in a camera's frame, see step; None: in the frame that the filter works in."""
        soft, sources = _decode(self.soft.steady), self.sources
        if world_from_camera is not None:
            pose = check_pose(world_from_camera, "world_from_camera")
            soft = np.maximum(rotate(soft, pose.T), 0.0)
            sources = tuple(replace(one, direction=one.direction @ pose) for one in sources)
        return soft + draw_sources(len(soft), sources)


def step(
    state: FilterState | None,
    radiance: Float[np.ndarray, "H 2*H 3"],
    dt_s: float,
    smoothing: Smoothing | None = None,
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
    c = smoothing or Smoothing()
    soft, sources = split_sources(check_radiance(radiance, "frame's light"))
    in_world = world_from_camera is not None
    pose = np.eye(3) if world_from_camera is None else check_pose(world_from_camera, "world_from_camera")
    if in_world:
        soft = np.maximum(rotate(soft, pose), 0.0)
        sources = tuple(replace(one, direction=pose @ one.direction) for one in sources)
    y = filtered_log(soft)
    power = np.log([OFFSET + sum(float(luminance(one.power)) for one in sources)])
    if state is not None and not (np.isfinite(dt_s) and dt_s > 0):
        raise ValueError(f"expected dt_s > 0, got {dt_s}")
    if state is None or state.in_world != in_world or state.soft.fast.shape != y.shape:
        return replace(_begun(y, power, sources, pose, SAME_AFTER_S), in_world=in_world)
    same_s = state.same_s + dt_s if looks_same else 0.0
    is_same = same_s > SAME_AFTER_S
    pairs = _pairs(state.tracks, sources)
    is_cut = _apart(y, state.soft.fast) > c.cut_level
    odd_s = state.odd_s + dt_s if is_cut or _is_odd(state.tracks, sources, pairs) else 0.0
    patience = min(max(state.led_s, LEAST_ODD_S), MOST_ODD_S) if is_same else dt_s
    if 0.0 < odd_s <= patience:
        return replace(state, held=True, odd_s=odd_s, same_s=same_s)
    if is_cut and not is_same:
        return replace(_begun(y, power, sources, pose, same_s), in_world=in_world)
    known = state.tracks
    if is_same and odd_s > 0.0:
        known, pairs = _moved_leader(known, sources, pairs)
    tracks = _follow(known, sources, pairs, pose, dt_s, c, is_same)
    leader = _leader_of(tracks, is_same)
    return FilterState(
        soft=advance(state.soft, y, dt_s, _apart, c),
        power=advance(state.power, power, dt_s, _distance, c),
        tracks=_led_by(leader, tracks),
        odd_s=0.0 if is_same else odd_s,
        led_s=state.led_s + dt_s if odd_s == 0.0 and leader is not None and tracks[leader].leads else 0.0,
        same_s=same_s,
        in_world=in_world,
    )


def _begun(y: np.ndarray, power: np.ndarray, sources: Sequence[Source], pose: np.ndarray, same_s: float) -> FilterState:
    """Return the first state, or that after a cut."""
    tracks = tuple(_new(one, pose, share=1.0) for one in sources)
    soft, powers = begin_filter(y), begin_filter(power)
    return FilterState(soft=soft, power=powers, tracks=_led_by(_leader_of(tracks), tracks), same_s=same_s)


def _follow(
    tracks: Sequence[Track],
    sources: Sequence[Source],
    pairs: dict[int, int],
    pose: np.ndarray,
    dt_s: float,
    c: Smoothing,
    is_same: bool,
) -> tuple[Track, ...]:
    """Return the tracks of the sources after one more frame."""
    followed = [
        _seen(track, sources[pairs[i]], pose, dt_s, c, is_same) if i in pairs else _unseen(track, dt_s)
        for i, track in enumerate(tracks)
    ]
    taken = set(pairs.values())
    share = min(dt_s / FADE_S, 1.0)
    followed += [_new(one, pose, share=share) for j, one in enumerate(sources) if j not in taken]
    followed = [track for track in followed if track.share > 0.0]
    weakest_last = sorted(followed, key=lambda track: -track.share)  # stable: of equals the older one stays
    return tuple(weakest_last[:MOST])


def _peak(source: Source, share: float = 1.0) -> float:
    """Return the luminance of a drawn source, summed within PEAK of its middle; share: fraction of its power."""
    edge = 1.0 - np.cos(source.radius)
    beyond = max(np.cos(PEAK) - np.cos(source.radius), 0.0) / edge
    return float(luminance(source.power)) * share * (1.0 - beyond**2)


def _strength(source: Source, share: float = 1.0) -> float:
    """Return a source's rank: between its power and find_dominant_light's measure, in which wide sources are dull."""
    return float(np.sqrt(float(luminance(source.power)) * share * _peak(source, share)))


def _moved_leader(
    tracks: tuple[Track, ...], sources: Sequence[Source], pairs: dict[int, int]
) -> tuple[tuple[Track, ...], dict[int, int]]:
    """Return the tracks with the leader moved to the frame's strongest source, and the pairs with these two matched."""
    leader = next((at for at, track in enumerate(tracks) if track.leads), None)
    if leader is None or not sources:
        return tracks, pairs
    first = int(np.argmax([_strength(one) for one in sources]))
    place = begin_filter(np.asarray(sources[first].direction, np.float64))
    moved = replace(tracks[leader], place=place, turns=True)
    others = {at: j for at, j in pairs.items() if at != leader and j != first}
    return (*tracks[:leader], moved, *tracks[leader + 1 :]), {**others, leader: first}


def _leader_of(tracks: Sequence[Track], is_same: bool = False) -> int | None:
    """Return the index of the leader; None without tracks."""
    ranks = [_strength(track.source, track.share) for track in tracks]
    for at, track in enumerate(tracks):
        if track.leads and (is_same or max(ranks) <= LEAD_RATIO * ranks[at]):
            return at
    return int(np.argmax(ranks)) if ranks else None


def _led_by(leader: int | None, tracks: Sequence[Track]) -> tuple[Track, ...]:
    return tuple(replace(track, leads=at == leader) for at, track in enumerate(tracks))


def _is_odd(tracks: Sequence[Track], sources: Sequence[Source], pairs: dict[int, int]) -> bool:
    """Return whether a frame shows another leader than the known one."""
    for at, track in enumerate(tracks):
        if track.leads:
            most = max((_strength(one) for one in sources), default=0.0)
            return at not in pairs or bool(most > LEAD_RATIO * _strength(sources[pairs[at]]))
    return False


def _put_first(sources: list[Source], leader: int) -> None:
    """Make the leader LEAD_MARGIN times as strong as each other source, taking power from these in place."""
    for at in range(len(sources)):
        mine, other = _peak(sources[leader]), _peak(sources[at])
        if at == leader or mine <= 0.0 or LEAD_MARGIN * other <= mine:
            continue
        given = (LEAD_MARGIN * other - mine) / (1.0 + LEAD_MARGIN)
        sources[at] = replace(sources[at], power=sources[at].power * (1.0 - given / other))
        sources[leader] = replace(sources[leader], power=sources[leader].power * (1.0 + given / mine))


def _pairs(tracks: Sequence[Track], sources: Sequence[Source]) -> dict[int, int]:
    """Match sources of the frame to tracks: indices of sources by those of tracks."""
    costs = []
    for i, track in enumerate(tracks):
        was = track.source
        for j, source in enumerate(sources):
            angle = _angle(track.direction, source.direction) / GATE
            ratio = abs(np.log((luminance(source.power) + OFFSET) / (luminance(was.power) + OFFSET))) / LN_RATIO
            if angle <= 1.0 and ratio <= 1.0:
                costs.append((float(angle + ratio), i, j))
    pairs: dict[int, int] = {}
    for _, i, j in sorted(costs):
        if i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def _size(source: Source) -> np.ndarray:
    return np.log([*(source.power + OFFSET), source.radius])


def _new(source: Source, pose: np.ndarray, share: float) -> Track:
    place = np.asarray(source.direction, np.float64)  # as read back from a file, to the last bit
    size = _size(source)
    recent = np.concatenate([place, size])
    return Track(place=begin_filter(place), size=begin_filter(size), recent=recent, shown=place, share=share, pose=pose)


def _seen(track: Track, source: Source, pose: np.ndarray, dt_s: float, c: Smoothing, is_same: bool) -> Track:
    view = min(_turned(track.pose, pose) / VIEW_TURN, 1.0)
    place, size = track.place, track.size
    near, like = toward(place.steady, track.recent[:3], view), toward(size.steady, track.recent[3:], view)
    slack = np.pi if is_same else max(view * VIEW_SLACK, SLACK)
    place = advance(place, source.direction, dt_s, _distance, c, near, slack)
    size = advance(size, _size(source), dt_s, _distance, c, like, view * VIEW_SLACK_SIZE)
    newest = np.concatenate([place.fast, size.fast])
    moves = place.motion > 0.0
    seen = replace(track, place=place, size=size, share=min(track.share + dt_s / FADE_S, 1.0), unseen_s=0.0)
    angle = _angle(track.shown, seen.direction)
    turns = moves or track.turns
    most_turn = SAME_MOST_TURN if is_same else MOST_TURN
    turn = (most_turn if turns else most_turn ** (1.0 - view) * VIEW_MOST_TURN**view) * dt_s
    shown = track.shown + (min(1.0, turn / angle) if angle > 0.0 else 1.0) * (seen.direction - track.shown)
    return replace(
        seen,
        recent=toward(track.recent, newest, gain(dt_s, min(RECENT_S, place.age_s))),
        shown=shown / np.linalg.norm(shown),
        pose=pose if moves else track.pose,
        turns=turns and turn < angle,
    )


def _unseen(track: Track, dt_s: float) -> Track:
    """Age an unseen track; one that is hardly shown yet gets less patience."""
    unseen_s = track.unseen_s + dt_s
    fades = unseen_s > PATIENCE_S * track.share
    return replace(track, unseen_s=unseen_s, share=max(track.share - fades * dt_s / FADE_S, 0.0))


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    return float(2.0 * np.arcsin(np.minimum(np.linalg.norm(one - other) / 2.0, 1.0)))


def _turned(from_: np.ndarray, to: np.ndarray) -> float:
    """Return the angle [radians] between two poses [3, 3]."""
    return float(np.arccos(np.clip((np.sum(from_ * to) - 1.0) / 2.0, -1.0, 1.0)))


def _distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other))


def filtered_log(radiance: np.ndarray) -> np.ndarray:
    """Compute y of L."""
    return np.log(np.minimum(radiance, 1.0) + np.float32(OFFSET)) + np.maximum(radiance - 1.0, 0.0) / SLOPE


def _decode(y: np.ndarray) -> np.ndarray:
    return np.maximum(np.exp(np.minimum(y, WHITE)) - OFFSET, 0.0) + SLOPE * _above_white(y)


def _above_white(y: np.ndarray) -> np.ndarray:
    return np.maximum(y - WHITE, 0.0)


def _logarithm(y: np.ndarray) -> np.ndarray:
    """Convert y to ln(L + OFFSET)."""
    return np.minimum(y, WHITE) + np.log1p(_above_white(y))


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the root mean square difference of ln(L + OFFSET) over sphere and channels, of two y [H, 2H, 3]."""
    difference = _logarithm(one) - _logarithm(other)
    weights = pixel_solid_angles(difference.shape[0])[:, 0].astype(np.float64)
    rows = np.square(difference, dtype=np.float64).mean(axis=(1, 2))
    return float(np.sqrt(rows @ weights / weights.sum()))
