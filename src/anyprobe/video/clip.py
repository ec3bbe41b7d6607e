"""Read clips as upright frames with their times; write pieces of clips, and join them.

PyAV reads mp4, mov, webm, mkv, avi, gif and more; see CONTAINERS.
"""

import os
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from anyprobe.errors import AnyprobeError, InputError, InvalidPhoto, OutputError, optional
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import absence_of
from anyprobe.video.frame_pixels import shown_pixels

CONTAINERS = (
    "mov matroska webm avi gif apng webp_anim jpegxl_anim mpegts mpeg mpegvideo m4v h264 hevc vvc evc obu av1 ivf flv "
    "live_flv kux asf asf_o ogg mxf gxf lxf dv nut rm wtv nsv nuv yuv4mpegpipe mjpeg ingenient mjpeg_2000 smjpeg "
    "mpjpeg dirac dnxhd vc1 vc1test cavsvideo avs2 avs3 apv h261 h263 mlv mods swf flic film_cpk ipmovie smk bink roq"
).split()
"""FFmpeg's readers that open one file and no other. Playlists (hls, dash, concat, imf), patterns of names (image2),
network sessions (sdp, rtsp) and devices (lavfi, v4l2) are left out."""

ONE_FILE = {
    "format_whitelist": ",".join(CONTAINERS),
    "protocol_whitelist": "file",
    "enable_drefs": "0",  # parts of a .mov that lie in other files
    "use_absolute_path": "0",
}
"""Options that let FFmpeg open the named file and nothing else."""

CODEC = "libx264"
QUALITY = {"crf": "18", "preset": "veryfast", "bf": "0"}
"""Without B-frames: their decoding times would overlap the piece before."""
BT709 = {"colorspace": 1, "color_primaries": 1, "color_trc": 1, "color_range": 1}
"""Colours that the file declares, as code points of ITU-T H.273; without them players guess."""
TIME_BASE = Fraction(1, 90_000)
LEAST_STEP_S = 1e-3
"""Least time between two frames; some files repeat a time."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """One picture of a clip, of the size of its first one.

    index: in decoding order, from 0. time_s: since the first. rgb: [H, W, 3] uint8, upright, square pixels, sRGB.
    radiance: [H, W, 3] float32 of PQ and HLG, see frame_pixels.shown_pixels. alpha: [H, W] float32 in [0, 1]; None
    where all is opaque. note: a line about the size of the first frame of another.

    Raises:
        InvalidPhoto: pixels of another shape or type.
    """

    index: int
    time_s: float
    rgb: np.ndarray
    radiance: np.ndarray | None = None
    alpha: np.ndarray | None = None
    note: str = ""

    def __post_init__(self) -> None:
        rgb = self.rgb
        if not (isinstance(rgb, np.ndarray) and rgb.shape[2:] == (3,) and rgb.dtype == np.uint8):
            found = f"{list(rgb.shape)} {rgb.dtype}" if isinstance(rgb, np.ndarray) else type(rgb).__name__
            text = f"expected [H, W, 3] uint8, got {found}; convert it"
            raise InvalidPhoto(text, source=f"frame {self.index}", subject="rgb")


@dataclass(frozen=True, kw_only=True, slots=True)
class Clip:
    """Header of a file; num_frames is 0 where the file does not state it, and may be slightly wrong.

    stream: which of the file's streams is the clip.
    """

    path: Path
    num_frames: int
    fps: float
    stream: int = 0


def pyav() -> Any:
    """Import PyAV.

    Raises:
        MissingExtra: it is not installed.
    """
    return optional("av", "av", "video", "reading and writing video")


def open_video(path: Path) -> Any:
    """Open a file by its content, and no file that it refers to.

    Raises:
        InputError: it is a playlist, or another kind of file that is not read.
    """
    av = pyav()
    url = f"file:{os.path.abspath(path)}"  # a name as `concat:a|b` is a file's here
    try:
        try:
            return av.open(url, metadata_errors="replace", options=dict(ONE_FILE))
        except TypeError:  # since PyAV 19 a title may be of any encoding
            return av.open(url, options=dict(ONE_FILE))
    except av.error.ArgumentError as error:
        text = "expected a video, got another kind of file, or a playlist, which names other files; convert it to mp4"
        with suppress(OSError, ValueError, SyntaxError, Image.DecompressionBombError), Image.open(path):
            text = "expected a video, got a picture; anyprobe estimate and relight take it"
        raise InputError(text, source=path) from error


def open_clip(path: Path) -> Clip:
    """Read a video's header.

    Raises:
        InputError: absent, or not a video. MissingExtra: PyAV is not installed.
    """
    av = pyav()
    if not path.is_file():
        if path.is_dir() or not os.path.exists(path):
            found = "is a folder, not a video; check the path" if path.is_dir() else absence_of(path)
            raise InputError(found, source=path)
        raise InputError("is a pipe or device, not a video; write it into a file first", source=path)
    try:
        with open_video(path) as container:
            stream = container.streams.best("video")
            if stream is None or stream.disposition & av.stream.Disposition.attached_pic:
                raise InputError("a file without moving pictures, not a video; check the path", source=path)
            if stream.codec_context is None:
                raise InputError("expected a codec that FFmpeg knows, got another; convert it to mp4", source=path)
            rate = stream.average_rate or stream.guessed_rate or 30
            return Clip(path=path, num_frames=stream.frames or 0, fps=float(rate), stream=stream.index)
    except (av.error.FFmpegError, ValueError, OSError) as error:
        if isinstance(error, InputError):
            raise
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:120] or type(error).__name__
    return InputError(f"FFmpeg cannot read it as a video ({reason}); convert it to mp4", source=path)


def read_frames(clip: Clip, damaged: list[int]) -> Generator[Frame, None, None]:
    """Yield all frames in order, turned upright by the file's rotation, in square pixels of sRGB, without interlacing.

    Frames of another size, or turned midway, are fitted into the size of the first, with black bars.

    Packets that cannot be decoded are left out; for each, `damaged` gets the index of the next
    frame. A truncated file ends early.

    Raises:
        InputError: no picture can be decoded, for want of a codec say.
    """
    av = pyav()
    index, first_s, last_s = 0, None, -1.0
    size: tuple[int, int] | None = None
    sizes: set[tuple[int, int]] = set()
    with open_video(clip.path) as container:  # open_clip has checked that it can be
        stream = next(one for one in container.streams.video if one.index == clip.stream)
        stream.thread_type = "AUTO"
        packets, progressive = container.demux(stream), Progressive()
        while True:
            try:
                if (packet := next(packets, None)) is None:
                    return
                pictures = []
                for picture in progressive(packet):
                    aspect = stream.sample_aspect_ratio or stream.codec_context.sample_aspect_ratio
                    planes, own = shown_pixels(picture, aspect, size, clip.path)
                    size = size or own
                    pictures.append((picture.time, planes, own))
            except InputError:
                raise
            except av.error.EOFError:
                return
            except (av.error.FFmpegError, ValueError, OSError) as error:
                if not index and not isinstance(error, av.error.InvalidDataError):
                    raise _unreadable(clip.path, error) from error
                damaged.append(index)
                continue
            for shown_s, planes, own in pictures:
                time_s = index / clip.fps if shown_s is None else float(shown_s)
                first_s = time_s if first_s is None else first_s
                last_s = max(time_s - first_s, last_s + LEAST_STEP_S) if index else 0.0
                note = ""
                if size is not None and own != size and own not in sizes:
                    note = (
                        f"{clip.path.name}: from frame {index} on {own[0]} x {own[1]} pixels, fitted into the first "
                        f"frame's {size[0]} x {size[1]}; cut the clip there for lights of its own lens"
                    )
                sizes.add(own)
                yield Frame(index=index, time_s=last_s, note=note, **planes)
                index += 1


class Progressive:
    """Decode packets in order: interlaced pictures, whose rows are of two moments, are made whole by FFmpeg's bwdif.

    The filter returns a picture once it has seen the next one.
    """

    def __init__(self) -> None:
        self._graph: Any = None
        self._format: tuple[Any, ...] = ()

    def __call__(self, packet: Any) -> Iterator[Any]:
        """Yield the pictures (av.VideoFrame) that are complete after a packet; an empty packet ends the stream."""
        for picture in packet.decode():
            if picture.interlaced_frame:
                form = picture.format.name, picture.width, picture.height
                if form != self._format:
                    yield from self._end()
                    self._graph, self._format = _graph(packet.stream, *form), form
                self._graph.push(picture)
                yield from self._ready()
            else:
                yield from self._end()
                yield picture
        if packet.size == 0:
            yield from self._end()

    def _ready(self) -> Iterator[Any]:
        av = pyav()
        while True:
            try:
                yield self._graph.pull()
            except (av.error.BlockingIOError, av.error.EOFError):
                return

    def _end(self) -> Iterator[Any]:
        """Yield what the filter still holds."""
        if self._graph is not None:
            self._graph.push(None)
            yield from self._ready()
        self._graph, self._format = None, ()


def _graph(stream: Any, pixels: str, width: int, height: int) -> Any:
    """Return a filter graph that makes one whole picture of each frame."""
    graph = pyav().filter.Graph()
    source = graph.add_buffer(width=width, height=height, format=pixels, time_base=stream.time_base)
    whole = graph.add("bwdif", "mode=send_frame:deint=interlaced")
    graph.link_nodes(source, whole, graph.add("buffersink")).configure()
    return graph


def frame_rate(stated: float, times_s: Sequence[float]) -> float:
    """Return frames per second: as stated, or by the frames' times if it is more than twice that, as animations may
    state the resolution of their times; at most one per LEAST_STEP_S."""
    steps = len(times_s) - 1
    measured = steps / (times_s[-1] - times_s[0]) if steps else stated
    return min(measured if stated > 2 * measured else stated, 1 / LEAST_STEP_S)


def clip_size(clip: Clip) -> tuple[int, int]:
    """Return width and height of the first frame as shown [pixels]; 0, 0 if none can be decoded."""
    frame = next(read_frames(clip, []), None)
    return (0, 0) if frame is None else (frame.rgb.shape[1], frame.rgb.shape[0])


@contextmanager
def _written(path: Path) -> Iterator[Any]:
    """Open a file for FFmpeg to write, which is kept only if it is complete.

    Raises:
        OutputError: this build of FFmpeg cannot write it.
    """
    av = pyav()
    try:
        with atomic_path(path) as temporary, av.open(str(temporary), "w") as container:
            yield container
    except (av.error.FFmpegError, ValueError) as error:
        if isinstance(error, AnyprobeError):
            raise
        reason = getattr(error, "strerror", None) or type(error).__name__
        text = f"FFmpeg cannot write it as H.264 ({reason}); install PyAV from the package index, with libx264"
        raise OutputError(text, source=path) from error


def write_piece(path: Path, frames: Sequence[tuple[float, np.ndarray]]) -> None:
    """Write frames (time_s, [H, W, 3] uint8) as one H.264 file, kept only if it is complete.

    The codec needs even sizes: odd ones lose a row or a column. Each piece is encoded by itself, so its bytes do
    not depend on the pieces before.
    """
    av = pyav()
    height, width = (n // 2 * 2 for n in frames[0][1].shape[:2])
    with _written(path) as container:
        stream = container.add_stream(CODEC, options=QUALITY)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.sample_aspect_ratio = Fraction(1)
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
    """Join pieces without encoding them again; their times already follow each other."""
    with _written(path) as out:
        target = None
        for piece in pieces:
            with open_video(piece) as container:
                source = container.streams.video[0]
                target = target or out.add_stream_from_template(source)
                for packet in container.demux(source):
                    if packet.dts is not None:
                        packet.stream = target
                        out.mux(packet)
