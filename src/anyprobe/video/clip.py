"""Clips on disk: upright frames with their times, pieces written whole, and pieces joined.

PyAV (the libraries of FFmpeg) reads whatever it can: mp4, mov, webm, mkv, avi, gif.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError, MissingExtra
from anyprobe.files.atomic import atomic_path
from anyprobe.files.headers import MAX_PIXELS

CODEC = "libx264"
QUALITY = {"crf": "18", "preset": "medium"}
BT709 = {"colorspace": 1, "color_primaries": 1, "color_trc": 1, "color_range": 1}
"""What the file says of its colours, by the numbers of ITU-T H.273: players guess where it says nothing."""
TIME_BASE = Fraction(1, 90_000)
LEAST_STEP_S = 1e-3
"""Two frames are never taken for closer; some files repeat a time."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """index: as they are decoded, from 0. time_s: since the first. rgb: [H, W, 3] uint8, upright."""

    index: int
    time_s: float
    rgb: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Clip:
    """What a file's header says; num_frames is 0 where it does not, and may be a little wrong."""

    path: Path
    num_frames: int
    fps: float


def _av():
    try:
        import av
    except ImportError as error:
        raise MissingExtra("av", "video", "reading and writing video") from error
    return av


def open_clip(path: Path) -> Clip:
    """Look at a video's header.

    Raises:
        InputError: absent, or not a video. MissingExtra: PyAV is not installed.
    """
    av = _av()
    if not path.is_file():
        found = "is a folder, not a video" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {found}; check the path")
    try:
        with _open(path) as container:
            if container.format.name == "image2" or container.format.name.endswith("_pipe"):
                raise InputError(f"{path}: is a still picture, not a video; anyprobe estimate and relight take it")
            if not container.streams.video:
                raise InputError(f"{path}: a file without pictures, not a video; check the path")
            stream = container.streams.video[0]
            if stream.codec_context is None:
                raise InputError(f"{path}: expected a codec that FFmpeg knows, got another; convert it to mp4")
            rate = stream.average_rate or stream.guessed_rate or 30
            return Clip(path=path, num_frames=stream.frames or 0, fps=float(rate))
    except (av.error.FFmpegError, ValueError, OSError) as error:
        if isinstance(error, InputError):
            raise
        raise _unreadable(path, error) from error


def _open(path: Path):
    """The file, opened by its content; its title may be of any encoding."""
    return _av().open(str(path), metadata_errors="replace")


def _unreadable(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:120] or type(error).__name__
    return InputError(f"{path}: FFmpeg cannot read it as a video ({reason}); convert it to mp4")


def read_frames(clip: Clip, damaged: list[int]) -> Iterator[Frame]:
    """All frames in order, turned upright by the file's rotation.

    Packets that cannot be decoded are left out; damaged gets the index of the frame before which each
    was. A file that is cut off ends early.

    Raises:
        InputError: not one picture can be decoded, because of its codec, say.
    """
    av = _av()
    index, first_s, last_s = 0, None, -1.0
    with _open(clip.path) as container:  # open_clip has seen that it can be
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets, None)
                if packet is None:
                    return
                pictures = [(picture.time, _upright(picture, clip.path)) for picture in packet.decode()]
            except InputError:
                raise
            except av.error.EOFError:
                return
            except (av.error.FFmpegError, ValueError, OSError) as error:
                if not index and not isinstance(error, av.error.InvalidDataError):
                    raise _unreadable(clip.path, error) from error
                damaged.append(index)
                continue
            for shown_s, rgb in pictures:
                time_s = index / clip.fps if shown_s is None else float(shown_s)
                first_s = time_s if first_s is None else first_s
                last_s = max(time_s - first_s, last_s + LEAST_STEP_S) if index else 0.0
                yield Frame(index=index, time_s=last_s, rgb=rgb)
                index += 1


def _upright(picture, path: Path) -> np.ndarray:
    """[H, W, 3] uint8, turned by the file's rotation."""
    if picture.width * picture.height > MAX_PIXELS:
        raise InputError(
            f"{path}: expected at most {MAX_PIXELS // 1_000_000} million pixels, "
            f"got {picture.width} x {picture.height}; shrink it first"
        )
    turns = round((picture.rotation or 0) / 90) % 4
    return np.ascontiguousarray(np.rot90(picture.to_ndarray(format="rgb24"), turns))


def upright_size(clip: Clip) -> tuple[int, int]:
    """Width and height of the first frame as it is shown, pixels; 0, 0 where none can be decoded."""
    frame = next(read_frames(clip, []), None)
    return (0, 0) if frame is None else (frame.rgb.shape[1], frame.rgb.shape[0])


def write_piece(path: Path, frames: Sequence[tuple[float, np.ndarray]]) -> None:
    """Write frames (time_s, [H, W, 3] uint8) as one H.264 file, whole or not at all.

    Odd sizes lose a row or a column, which the codec asks for. Every piece starts anew, so that
    pieces written one after another are the same bytes whenever that was.
    """
    av = _av()
    height, width = (n // 2 * 2 for n in frames[0][1].shape[:2])
    with atomic_path(path) as temporary, av.open(str(temporary), "w") as container:
        stream = container.add_stream(CODEC, options=QUALITY)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.time_base = stream.codec_context.time_base = TIME_BASE
        stream.thread_count = 1
        for name, value in BT709.items():
            setattr(stream.codec_context, name, value)
        for time_s, rgb in frames:
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb[:height, :width]), format="rgb24")
            picture = picture.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
            picture.time_base, picture.pts = TIME_BASE, round(time_s / TIME_BASE)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())


def join_pieces(path: Path, pieces: Sequence[Path]) -> None:
    """Put pieces behind each other without encoding them again; their times already follow each other."""
    av = _av()
    with atomic_path(path) as temporary, av.open(str(temporary), "w") as out:
        target = None
        for piece in pieces:
            with av.open(str(piece)) as container:
                source = container.streams.video[0]
                target = target or out.add_stream_from_template(source)
                for packet in container.demux(source):
                    if packet.dts is not None:
                        packet.stream = target
                        out.mux(packet)
