"""The filter over time: still where the scene is, quick where the light moves, closed forms between."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.filtering import blur_cap
from anyprobe.light.light_sources import LightSource, draw_sources, find_dominant_light
from anyprobe.light.temporal import OFFSET, FilterState, step
from anyprobe.render.spheres import silver, sphere_normals
from anyprobe_train.evaluate.metrics import color_angle_deg

HEIGHT, SPHERE = 32, 12
FRAME_NOISE = 0.05
"""Of ln radiance; a silver sphere's colours then tremble by about one degree."""


def emitter_map(direction) -> np.ndarray:
    """[32, 64, 3]: a warm emitter 30 degrees across in a blue room."""
    d = pixel_directions(HEIGHT)
    toward = np.asarray(direction, float) / np.linalg.norm(direction)
    emitter = (d @ toward > np.cos(np.radians(15)))[..., None] * np.array([20.0, 16.0, 12.0])
    return (np.array([0.3, 0.35, 0.45]) + emitter).astype(np.float32)


LEFT, RIGHT = emitter_map([-1, 1, 0.5]), emitter_map([1, 1, 0.5])


def noisy(radiance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Noise in blobs half a radian across, coloured, FRAME_NOISE of ln radiance."""
    blobs = blur_cap(rng.normal(size=radiance.shape).astype(np.float32), 0.25)
    return radiance * np.exp(FRAME_NOISE / blobs.std() * blobs)


def run(frames, dts) -> list[FilterState]:
    state, states = None, []
    for frame, dt in zip(frames, dts, strict=True):
        state = step(state, frame, dt)
        states.append(state)
    return states


def tremble(maps: list[np.ndarray]) -> float:
    """Root mean square over time of the silver sphere's colour angle [degrees] from its mean in time."""
    spheres = np.array([silver(one, SPHERE) for one in maps])
    inside = sphere_normals(SPHERE)[1]
    angles = [color_angle_deg(sphere, spheres.mean(axis=0), inside) for sphere in spheres]
    return float(np.sqrt(np.mean(np.square(angles))))


@pytest.mark.ci
@pytest.mark.parametrize("fps", [15, 30])
def test_still_scene_is_still(rng, fps):
    frames = [noisy(LEFT, rng) for _ in range(4 * fps)]
    states = run(frames, [1 / fps] * len(frames))
    assert tremble(frames[-fps:]) > 0.4
    assert tremble([state.radiance for state in states[-fps:]]) < 0.1
    assert states[-1].soft.noise == pytest.approx(FRAME_NOISE, rel=0.2)


@pytest.mark.ci
@pytest.mark.parametrize("fps", [10, 15, 30])
@pytest.mark.parametrize("still_before_s", [0.5, 4.0])
def test_moved_emitter_is_followed_within_half_a_second(rng, fps, still_before_s):
    before = round(still_before_s * fps)
    frames = [noisy(LEFT, rng) for _ in range(before)] + [noisy(RIGHT, rng) for _ in range(fps // 2)]
    shown = silver(run(frames, [1 / fps] * len(frames))[-1].radiance, SPHERE)
    left, right = silver(LEFT, SPHERE), silver(RIGHT, SPHERE)
    assert np.linalg.norm(shown - right) < 0.1 * np.linalg.norm(left - right)


@pytest.mark.ci
@pytest.mark.parametrize("fps", [15, 24, 30])
def test_nothing_of_before_lingers_after_a_jump_that_noise_soon_hides(rng, fps):
    """All of the light is a third brighter from one frame to the next: six times the noise of a frame."""
    jump = np.float32(6 * FRAME_NOISE)
    bright = LEFT * np.exp(jump)
    frames = [noisy(LEFT, rng) for _ in range(2 * fps)] + [noisy(bright, rng) for _ in range(fps)]
    states = run(frames, [1 / fps] * len(frames))
    left = [np.log((bright + OFFSET) / (state.radiance + OFFSET)).mean() / jump for state in states]
    assert max(np.abs(left[2 * fps + round(0.25 * fps) :])) < 0.025
    assert states[-1].soft.memory_s > 0.5  # and it is kept still again


def test_slow_drift_is_followed_though_each_frame_hides_in_the_noise(rng):
    """The whole light fades by 40 % a second, 1.7 % a frame, under noise of 5 % a frame."""
    fps, seconds, rate = 30, 3, 0.5
    true = [LEFT * np.exp(-rate * i / fps).astype(np.float32) for i in range(fps * seconds)]
    states = run([noisy(one, rng) for one in true], [1 / fps] * len(true))
    behind = np.log((states[-1].radiance + OFFSET) / (true[-1] + OFFSET)).mean()
    assert behind / rate < 0.3  # seconds; the noise band over the rate


@pytest.mark.ci
def test_uneven_frames_give_what_even_ones_do(rng):
    """The same second and a half after a step, cut into 45 even or 45 uneven pieces."""
    uneven = rng.uniform(0.2, 1.8, size=45)
    uneven *= 1.5 / uneven.sum()
    frames = [LEFT] * 60 + [RIGHT] * 45
    even_end = run(frames, [1 / 30] * 105)[-1].radiance
    uneven_end = run(frames, [1 / 30] * 60 + list(uneven))[-1].radiance
    np.testing.assert_allclose(uneven_end, even_end, rtol=0.02)


def test_one_bad_frame_is_not_shown():
    bad = np.full_like(LEFT, 400.0)
    states = run([LEFT] * 30 + [bad] + [LEFT] * 5, [1 / 30] * 36)
    for state in states:
        np.testing.assert_allclose(state.radiance, LEFT, rtol=1e-4)
    assert [state.held for state in states[29:33]] == [False, True, False, False]


def test_cut_starts_anew_at_its_second_frame():
    other = np.full_like(LEFT, 30.0)
    states = run([LEFT] * 30 + [other] * 3, [1 / 30] * 33)
    np.testing.assert_allclose(states[30].radiance, LEFT, rtol=1e-4)
    np.testing.assert_allclose(states[31].radiance, other, rtol=1e-4)
    assert states[31].soft.age_s == 0


@pytest.mark.ci
def test_light_sources_that_tremble_keep_their_power(rng):
    """Each frame has the lamp, 8 degrees across, up to 5 degrees from its place: what is shown is as bright in all."""
    d, areas = pixel_directions(64), pixel_solid_angles(64)[..., None]
    frames = []
    for offset in rng.uniform(-0.09, 0.09, size=(60, 2)):
        toward = np.array([offset[0], 0.5 + offset[1], -1.0])
        lamp = d @ (toward / np.linalg.norm(toward)) > np.cos(np.radians(4))
        frames.append((0.3 + 300.0 * lamp[..., None] * np.ones(3)).astype(np.float32))
    shown = run(frames, [1 / 30] * 60)[-1].radiance
    powers = [float((one * areas).sum()) for one in frames]
    assert float((shown * areas).sum()) == pytest.approx(np.mean(powers), rel=0.1)
    light = find_dominant_light(shown)
    assert light.irradiance.mean() > 0.7 * np.mean([find_dominant_light(one).irradiance.mean() for one in frames])


def test_black_stays_black():
    states = run([np.zeros_like(LEFT)] * 5, [1 / 30] * 5)
    assert states[-1].radiance.max() < 1e-6


FPS = 15
SUN, LAMP = np.array([0.3, 0.6, 0.74]), np.array([-0.8, 0.3, -0.5])
ROOM = np.full((64, 128, 3), 0.3, np.float32)


def seen(rng, sun=SUN, lamp=LAMP, pose=None, has_lamp=True) -> np.ndarray:
    """A frame's map: two sources, each up to 5 degrees from its place and of a fifth more or less power."""
    found = []
    for at, power in ((sun, 2.0), (lamp, 0.8)) if has_lamp else ((sun, 2.0),):
        d = at / np.linalg.norm(at) + rng.uniform(-0.05, 0.05, 3)
        d = d / np.linalg.norm(d) @ (np.eye(3) if pose is None else pose)
        found.append(LightSource(direction=d, power=power * rng.uniform(0.8, 1.2) * np.ones(3), radius_deg=3.4))
    return ROOM + draw_sources(64, found)


def angle_deg(one, other) -> float:
    return float(np.degrees(np.arccos(np.clip(one @ other / np.linalg.norm(one) / np.linalg.norm(other), -1, 1))))


def bright(radiance) -> int:
    return int((radiance.max(axis=-1) > 5.0).sum())


@pytest.mark.ci
def test_sources_that_tremble_and_blink_leave_no_ghosts(rng):
    frames = [seen(rng, has_lamp=i % 5 != 3) for i in range(6 * FPS)]
    states = run(frames, [1 / FPS] * len(frames))
    assert bright(states[-1].radiance) <= 1.5 * np.median([bright(frame) for frame in frames])
    toward = [find_dominant_light(state.radiance).direction for state in states]
    assert max(angle_deg(a, b) for a, b in zip(toward, toward[1:], strict=False)) < 5
    assert angle_deg(toward[-1], SUN) < 2
    kept = sum(luminance(one.power) for one in states[-1].sources)
    assert kept == pytest.approx(2.0 + 0.8 * 0.8, rel=0.2)


@pytest.mark.ci
@pytest.mark.parametrize("moved_deg", [20, 90])
def test_a_source_that_is_elsewhere_is_followed_within_half_a_second(rng, moved_deg):
    to = rotation_y(np.radians(moved_deg)) @ SUN
    frames = [seen(rng) for _ in range(3 * FPS)] + [seen(rng, sun=to) for _ in range(FPS // 2)]
    light = run(frames, [1 / FPS] * len(frames))[-1].radiance
    assert angle_deg(find_dominant_light(light).direction, to) < 6
    assert angle_deg(find_dominant_light(frames[0]).direction, SUN) < 6
    assert bright(light) <= 1.5 * bright(frames[-1])


@pytest.mark.ci
def test_light_stands_still_in_the_world_while_the_camera_turns(rng):
    poses = [rotation_y(np.radians(30.0) * i / FPS) for i in range(3 * FPS)]
    state = None
    for i, pose in enumerate(poses):
        state = step(state, seen(rng, pose=pose), 1 / FPS, world_from_camera=pose)
        if i >= FPS:
            assert angle_deg(find_dominant_light(state.radiance).direction, SUN) < 5
            in_camera = find_dominant_light(state.seen_from(pose)).direction
            assert angle_deg(pose @ in_camera, SUN) < 5


def views(rng, seconds: float, sun=lambda t: SUN, aside_deg: float = 14.0):
    """Frames and poses of a camera that turns 30 degrees a second. They place the sun aside, by up to so many degrees,
    more and more from 1.5 s to 2.5 s."""
    for i in range(round(seconds * FPS)):
        pose = rotation_y(np.radians(30.0) * i / FPS)
        off = rotation_y(np.radians(aside_deg) * np.clip(i / FPS - 1.5, 0.0, 1.0))
        yield seen(rng, sun=off @ sun(i / FPS), pose=pose), pose


@pytest.mark.ci
def test_what_estimates_differ_by_from_side_to_side_turns_no_light(rng):
    state, toward = None, []
    for frame, pose in views(rng, 3):
        state = step(state, frame, 1 / FPS, world_from_camera=pose)
        toward.append(find_dominant_light(state.radiance).direction)
    middle = np.mean(toward[FPS:], axis=0)
    assert max(angle_deg(one, middle) for one in toward[FPS:]) < 3


@pytest.mark.parametrize("moved_deg", [25, 90])
def test_a_source_that_is_elsewhere_is_followed_while_the_camera_turns(rng, moved_deg):
    def sun(t: float) -> np.ndarray:
        return rotation_y(np.radians(moved_deg)) @ SUN if t >= 1.5 else SUN

    state = None
    for frame, pose in views(rng, 2, sun):
        state = step(state, frame, 1 / FPS, world_from_camera=pose)
    assert angle_deg(find_dominant_light(state.radiance).direction, rotation_y(np.radians(7.0)) @ sun(2)) < 8


def steps_deg(states: list[FilterState]) -> list[float]:
    toward = [find_dominant_light(state.radiance).direction for state in states]
    return [angle_deg(a, b) for a, b in zip(toward, toward[1:], strict=False)]


def lamps(*placed: tuple) -> np.ndarray:
    """A map of lamps: direction, power and radius in degrees of each."""
    found = []
    for at, power, radius_deg in placed:
        d = np.asarray(at, float) / np.linalg.norm(at)
        found.append(LightSource(direction=d, power=power * np.ones(3), radius_deg=radius_deg))
    return ROOM + draw_sources(64, found)


def test_one_frame_with_another_leader_is_not_shown(rng):
    frames = [seen(rng) for _ in range(FPS)] + [seen(rng, sun=-SUN)] + [seen(rng) for _ in range(FPS)]
    states = run(frames, [1 / FPS] * len(frames))
    assert states[FPS].held
    assert not states[FPS + 1].held
    assert max(steps_deg(states[1:])) < 5


@pytest.mark.ci
def test_two_sources_that_change_rank_move_no_dominant_light():
    frames = [
        lamps((SUN, 2.0 + 0.5 * (-1) ** (i // 3), 3.4), (LAMP, 2.0 - 0.5 * (-1) ** (i // 3), 4.9)) for i in range(45)
    ]
    states = run(frames, [1 / FPS] * len(frames))
    assert max(angle_deg(a, b) for a, b in zip(map(raw, frames), map(raw, frames[1:]), strict=False)) > 60
    assert max(steps_deg(states)) < 5


def raw(radiance: np.ndarray) -> np.ndarray:
    return find_dominant_light(radiance).direction


def test_a_wide_source_turns_as_one():
    """It goes 20 degrees to the side at once: what is shown turns there, and is never two."""
    to = rotation_y(np.radians(20)) @ SUN
    frames = [lamps((SUN, 6.0, 11.4))] * FPS + [lamps((to, 6.0, 11.4))] * FPS
    states = run(frames, [1 / FPS] * len(frames))
    assert 2 < max(steps_deg(states)) < 75 / FPS + 0.5
    assert angle_deg(raw(states[-1].radiance), to) < 2
    assert all(len(state.sources) == 1 for state in states)


@pytest.mark.ci
def test_the_light_stays_while_the_object_looks_the_same(rng):
    """Estimates are elsewhere from then on: what is shown turns slowly, and not at all in the first half second."""
    other = rotation_y(np.radians(90)) @ SUN
    frames = [seen(rng) for _ in range(FPS)] + [seen(rng, sun=other) for _ in range(3 * FPS)]
    state, states = None, []
    for frame in frames:
        state = step(state, frame, 1 / FPS, looks_same=True)
        states.append(state)
    assert max(steps_deg(states)) < 4
    assert angle_deg(raw(states[FPS + FPS // 2].radiance), raw(states[FPS - 1].radiance)) < 4


def test_a_light_is_followed_as_soon_as_the_object_looks_another_way(rng):
    other = rotation_y(np.radians(90)) @ SUN
    state = None
    for i in range(2 * FPS + FPS // 2):
        state = step(state, seen(rng, sun=SUN if i < 2 * FPS else other), 1 / FPS, looks_same=i != 2 * FPS)
    assert angle_deg(raw(state.radiance), other) < 6
