"""Turn a clip into a track of lights: masks, networks, the filter over time, and the relit clip."""

import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.errors import AnyprobeError, InputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import Ground
from anyprobe.estimate.multiview import completed, lay_over
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import FRAME, SCALE
from anyprobe.estimate.surroundings import GivenPanorama
from anyprobe.light.environment import rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.light.temporal import step
from anyprobe.maps.radiance import write_exr
from anyprobe.notices import Notice
from anyprobe.relight.appearance import least_scale
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.mesh import Mesh
from anyprobe.scatter.materials import Material
from anyprobe.video.clip import Clip, Frame, frame_rate, join_pieces, read_frames, write_piece
from anyprobe.video.following import MaskFollower
from anyprobe.video.preview import beside_frame, light_picture, preview_ev
from anyprobe.video.track import PIECES, Progress, describe, forget_progress, load_progress, save_progress, write_track

SAVE_EVERY = 24
"""Frames between two saves; a resumed run repeats what came after the last one."""

SHADOW_DIRECTIONS, SHADOW_GRID = 64, 128
"""Fewer than for a photo, which has 192 and 320, as a clip has many pictures."""

LIGHT = "_light"
"""Name of light.mp4's pieces."""


@dataclass(frozen=True, kw_only=True)
class VirtualObject:
    """Inserted object of the relit clip; see relight.insert."""

    mesh: Mesh
    material: str
    arrangement: Arrangement


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """frames: number of frames read. bad: (index, line) of those without a light of their own. damaged: packets.

    notes: lines about the first frame's object and about frames of another size.
    """

    frames: int
    bad: list[tuple[int, str]]
    damaged: int
    notes: tuple[str, ...] = ()


_Look = tuple[Photo | AnyprobeError, list[float] | None, bool]
"""A frame's photo or why there is none, and of MaskFollower: last before it, and looks_same."""


class ClipRun:
    """Process one clip into one folder."""

    def __init__(
        self,
        clip: Clip,
        folder: Path,
        estimator: Estimator,
        follower: MaskFollower,
        settings: dict,
        *,
        every: int = 1,
        exr: bool = False,
        virtual: VirtualObject | None = None,
        poses: np.ndarray | None = None,
        material: Material | None = None,
    ) -> None:
        """Args:
        settings: plain values that the result depends on; a run resumes only with the same.
        every: interval between estimated lights in frames; frames between keep the last light.
        exr: also write lights/<index>.exr, the filtered map of every frame with an estimated light.
        poses: world_from_camera [N, 3, 3] of the frames. The filter then works in the world, where light stands still
            while the camera turns, and the surroundings in all frames are gathered. Output stays in each frame's
            camera.
        material: the real object's, if given.
        """
        self.clip, self.folder, self.estimator, self.follower = clip, folder, estimator, follower
        self.material = material
        self.every, self.exr, self.virtual, self.poses = every, exr, virtual, poses
        self.progress = load_progress(folder, settings) or Progress(settings=settings)
        self._stage: Stage | None = None
        self._shown: tuple[GroundShadow, np.ndarray] | None = None  # shadow and object under the last light
        self._photo: Photo | None = None
        self._preview: Future[np.ndarray] | None = None  # of the last light

    def __call__(self, watch: Callable[[int], None]) -> Outcome:
        """Process the remaining frames; watch gets the number of frames done.

        After any interruption, a later call with the same folder resumes at the last finished piece, where it finds the
        object anew.
        """
        damaged: list[int] = []
        with closing(read_frames(self.clip, damaged)) as frames, ThreadPoolExecutor(2) as beside:
            return self._run(frames, damaged, watch, beside)

    def _run(
        self, frames: Iterator[Frame], damaged: list[int], watch: Callable[[int], None], beside: ThreadPoolExecutor
    ) -> Outcome:
        """Process frames one by one while a thread reads the next one and finds its mask, and another draws lights."""
        done = self.progress
        self._pictures: list[tuple[float, np.ndarray]] = []  # since the last save
        self._previews: list[tuple[float, Future[np.ndarray]]] = []
        size, frame, notes = (0, 0), None, []
        save_every = -(-SAVE_EVERY // self.every) * self.every  # the first frame after a resume gets a light
        coming: Future[tuple[Frame, _Look | None] | None] = beside.submit(self._read, frames, False)
        while (read := coming.result()) is not None:
            frame, look = read
            will_save = (frame.index + 1) % save_every == 0  # what the follower knows after this frame
            gets_light = (frame.index + 1) % self.every == 0
            is_doing = frame.index >= done.next_index and done.light is not None
            coming = beside.submit(self._read, frames, is_doing and gets_light and not will_save)
            size = frame.rgb.shape[1], frame.rgb.shape[0]
            if frame.note:
                notes.append(frame.note)
            if frame.index < done.next_index:
                if frame.index == done.stage_index and self.virtual is not None:
                    self.follower.go_on(done.stage_last)
                    self._stage = _set_up(self.follower.photo(frame), self.virtual, done)
                continue
            if frame.index == done.next_index and done.next_index:
                self._shown, self._preview = None, None
                self.follower.go_on(done.last)
            done.frames.append(self._one(frame, look))
            if self.virtual is not None:
                self._pictures.append((frame.time_s, self._picture(frame)))
            self._previews.append((frame.time_s, self._light_picture(frame, beside)))
            watch(frame.index + 1)
            if will_save:
                self._save(frame.index + 1)
        if frame is None:
            raise InputError("no frame of it can be decoded; convert it to mp4", source=self.clip.path)
        if frame.index + 1 > done.next_index:
            self._save(frame.index + 1)
        if done.light is None:
            shutil.rmtree(self.folder / PIECES, ignore_errors=True)
            forget_progress(self.folder)
            raise InputError(f"no frame gave a light; {done.frames[0]['error']}", source=self.clip.path)
        fps = frame_rate(self.clip.fps, [one["time_s"] for one in done.frames])
        if fps != self.clip.fps:
            stated = f"{self.clip.path.name}: states {self.clip.fps:g} frames per second"
            notes.append(f"{stated}; track.json has {fps:g}, by its frames' times")
        write_track(self.folder / "track.json", done, fps, size)
        join_pieces(self.folder / "light.mp4", self._pieces(LIGHT))
        if self.virtual is not None:
            join_pieces(self.folder / "relit.mp4", self._pieces())
        bad = [(one["index"], one["error"]) for one in done.frames if "error" in one]
        return Outcome(frames=len(done.frames), bad=bad, damaged=len(damaged), notes=(*done.notes, *notes))

    def _read(self, frames: Iterator[Frame], looks: bool) -> tuple[Frame, _Look | None] | None:
        """Return the next frame, with its photo if wanted; None after the last."""
        frame = next(frames, None)
        return None if frame is None else (frame, self._look(frame) if looks else None)

    def _look(self, frame: Frame) -> _Look:
        """Find the object in a frame; keep an error of the frame until its turn."""
        before = self.follower.last
        try:
            return self.follower.photo(frame), before, self.follower.looks_same
        except AnyprobeError as error:
            return error, before, False

    def _one(self, frame: Frame, look: _Look | None) -> dict:
        """Return the record of one frame; without a light of its own it keeps the last one and says why.

        Raise the error of a first frame whose object the caller marked. look: this frame's, if taken already.
        """
        done = self.progress
        record: dict[str, Any] = {"index": frame.index, "time_s": round(frame.time_s, 5)}
        if self.poses is not None and frame.index >= len(self.poses):
            raise InputError(f"expected one a frame, got {len(self.poses)}; make the others", subject="poses")
        if frame.index % self.every and done.light is not None:
            return {**record, **self._kept(frame.index)}
        photo, before, looks_same = look or self._look(frame)
        try:
            if isinstance(photo, AnyprobeError):
                raise photo
            self._photo = photo
            light = self._estimate(self._photo, frame.index)
            if done.light is None:
                done.notes = list(light.warnings)
        except AnyprobeError as error:
            if frame.index == 0 and self.follower.hints:
                raise
            self._photo = None
            if done.light is None:
                self.follower.go_on(self.follower.last)
            return {**record, "error": " ".join(str(error).splitlines()), **self._kept(frame.index)}
        dt_s = max(frame.time_s - done.light_time_s, 1e-3)
        pose = None if self.poses is None else self.poses[frame.index]
        done.light = step(done.light, light.radiance, dt_s, world_from_camera=pose, looks_same=looks_same)
        done.light_time_s, self._shown, self._preview = frame.time_s, None, None
        steady = self._seen(frame.index)
        if self.exr:
            header = {"model": self.estimator.model_id, "frame": FRAME, "scale": SCALE}
            write_exr(self.folder / "lights" / f"{frame.index:06d}.exr", steady, attributes=header)
        if self.virtual is not None:
            done.gain = 1.0 if self.material is not None else least_scale(self._photo, steady)
        if self.virtual is not None and self._stage is None:
            done.ground = None if light.ground is None else light.ground.info()
            done.long_fov_deg, done.likely = light.origin.long_fov_deg, light.dominant_light().exists
            done.toward_light = find_dominant_light(steady).direction.tolist()
            self._stage = _set_up(self._photo, self.virtual, done)
            done.stage_index, done.stage_last = frame.index, before
            material = self._stage.material(self.virtual.material, steady * np.float32(done.gain))
            done.material = {key: np.asarray(value).tolist() for key, value in asdict(material).items()}
        return {**record, **describe(steady), "held": done.light.held}

    def _estimate(self, photo: Photo, index: int) -> Light:
        """Return the light of one frame in its camera; with poses, by the surroundings in all frames so far.

        A panorama from a file is in frame 0's camera, whichever frame gives the first light.
        """
        if self.poses is None:
            return self.estimator.from_photo(photo, material=self.material, plate=False)
        done, pose = self.progress, self.poses[index]
        if isinstance(photo.surroundings, GivenPanorama):
            photo = replace(photo, surroundings=photo.surroundings.turned(pose.T @ self.poses[0]))
        light = self.estimator.from_photo(photo, material=self.material, plate=False)
        if light.seen is None or not photo.shows_place:
            return light
        done.panorama = lay_over(np.maximum(rotate(light.seen, pose), 0.0), done.panorama)
        return completed(light, np.maximum(rotate(done.panorama, pose.T), 0.0))

    def _seen(self, index: int) -> np.ndarray:
        """Return the steady light in a frame's camera, [H, 2H, 3]."""
        assert self.progress.light is not None  # only called once there is a light
        return self.progress.light.seen_from(None if self.poses is None else self.poses[index])

    def _kept(self, index: int) -> dict:
        """Describe the last light as seen by a frame without one of its own, if its pose is known; else return which
        frame's light is reused, nothing before the first."""
        if self.poses is not None and self.progress.light is not None:
            return describe(self._seen(index))
        lit = next((one["index"] for one in reversed(self.progress.frames) if "held" in one), None)
        return {} if lit is None else {"same_as": lit}

    @property
    def place_warnings(self) -> tuple[Notice, ...]:
        """Return the warnings of the virtual object's place; none before it has one."""
        return () if self._stage is None else self._stage.warnings

    def _picture(self, frame: Frame) -> np.ndarray:
        """Return the frame with the object in it, [H, W, 3] uint8; unchanged before the first light."""
        state, virtual = self.progress.light, self.virtual
        if self._stage is None or state is None or virtual is None:
            return frame.rgb
        rgb = frame.rgb.astype(np.float32) / 255
        mask = np.zeros(rgb.shape[:2], np.float32) if self._photo is None else self._photo.mask
        stage = self._stage.on(replace(self._stage.photo, rgb=rgb, mask=mask))
        radiance = state.radiance * np.float32(self.progress.gain)
        if self._shown is None:
            assert self.progress.material is not None  # since there is a stage
            numbers: dict[str, Any] = {key: np.array(value) for key, value in self.progress.material.items()}
            material = Material(**{**numbers, "alpha": float(numbers["alpha"])})
            shadow = stage.shadow(radiance, SHADOW_DIRECTIONS, SHADOW_GRID)
            self._shown = shadow, stage.draw(radiance, material, shadow)
        shadow, drawn = self._shown
        return to_bytes(stage.relit(radiance, virtual.material, shadow=shadow, drawn=drawn))

    def _light_picture(self, frame: Frame, beside: ThreadPoolExecutor) -> Future[np.ndarray]:
        """Return a frame's picture in light.mp4, drawn in the other thread."""
        if self._preview is None or self.poses is not None:
            done = self.progress
            shown = None if done.light is None else self._seen(frame.index)
            if shown is not None and done.preview_ev is None:
                done.preview_ev = preview_ev(shown)
            self._preview = beside.submit(light_picture, shown, done.preview_ev or 0.0)
        light = self._preview
        return beside.submit(lambda: beside_frame(frame.rgb, light.result()))

    def _save(self, next_index: int) -> None:
        done = self.progress
        if self._pictures:
            write_piece(self._piece(done.pieces), self._pictures)
        if self._previews:
            lights = [(time_s, drawn.result()) for time_s, drawn in self._previews]
            write_piece(self._piece(done.pieces, LIGHT), lights)
            done.pieces += 1
        self._pictures, self._previews = [], []
        done.next_index = next_index
        done.last = self.follower.last
        save_progress(self.folder, done)

    def _piece(self, number: int, kind: str = "") -> Path:
        return self.folder / PIECES / f"{number:05d}{kind}.mp4"

    def _pieces(self, kind: str = "") -> list[Path]:
        return [self._piece(number, kind) for number in range(self.progress.pieces)]


def _set_up(photo: Photo, virtual: VirtualObject, done: Progress) -> Stage:
    """Return the place of the virtual object in all frames, from the first with a mask and its light's ground."""
    toward = None if done.toward_light is None else np.array(done.toward_light)
    seen = replace(virtual.arrangement, ground=Ground.of(done.ground), long_fov_deg=done.long_fov_deg)
    return Stage(photo, virtual.mesh, replace(seen, toward_light=toward, likely=done.likely))
