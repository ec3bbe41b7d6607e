"""Open files by PyAV (FFmpeg's libraries), and report its faults in one line."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from PIL import Image

from anyprobe.errors import InputError, MissingExtra

CONTAINERS = (
    "mov matroska webm avi gif apng webp_anim jpegxl_anim mpegts mpeg mpegvideo m4v h264 hevc vvc evc obu av1 ivf flv "
    "live_flv kux asf asf_o ogg mxf gxf lxf dv nut rm wtv nsv nuv yuv4mpegpipe mjpeg ingenient mjpeg_2000 smjpeg "
    "mpjpeg dirac dnxhd vc1 vc1test cavsvideo avs2 avs3 apv h261 h263 mlv mods swf flic film_cpk ipmovie smk bink roq"
).split()
"""FFmpeg's readers that open one file and no other. Playlists (hls, dash, concat, imf), patterns of names (image2),
network sessions (sdp, rtsp) and devices (lavfi, v4l2) are left out."""

PICTURE_READERS = (
    "bmp cri dds dpx exr gem gif hdr j2k jpeg jpegls jpegxl jpegxs pam pbm pcx pfm pgm pgmyuv pgx phm photocd pictor "
    "png ppm psd qdraw qoi sgi sunrast svg tiff vbn webp xbm xpm xwd"
).split()
"""Readers of still pictures, which are refused by name; FFmpeg calls them NAME_pipe."""

ONE_FILE = {
    "format_whitelist": ",".join((*CONTAINERS, *(f"{kind}_pipe" for kind in PICTURE_READERS))),
    "protocol_whitelist": "file",
    "enable_drefs": "0",  # parts of a .mov that lie in other files
    "use_absolute_path": "0",
}
"""Options that let FFmpeg open the named file and nothing else."""

PLAYLISTS = (b"#EXTM3U", b"ffconcat", b"<?xml", b"<MPD", b"v=0", b"[playlist]", b"<asx", b"<smil")
"""First bytes of files that refer to other files."""


def pyav() -> Any:
    """Import PyAV.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        import av
    except ImportError as error:
        raise MissingExtra("av", "video", "reading and writing video", error) from error
    return av


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
        raise _not_opened(path) from error


def _not_opened(path: Path) -> InputError:
    with open(path, "rb") as stream:
        start = stream.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    if start.startswith(tuple(word.lower() for word in PLAYLISTS)):
        return InputError(
            "expected a video, got a playlist, which names other files; name the video itself", source=path
        )
    if _is_animated(path) is not None:
        return picture_refused(path)
    return InputError("expected a video, got a file of another kind; convert it to mp4", source=path)


def picture_refused(path: Path) -> InputError:
    """Return the refusal of a picture that is given as a clip and that FFmpeg reads as a still one."""
    still = "is a still picture, not a video; anyprobe estimate and relight take it"
    animated = "expected a video, got an animated picture that FFmpeg does not read; convert it to mp4"
    return InputError(animated if _is_animated(path) else still, source=path)


def _is_animated(path: Path) -> bool | None:
    """Return whether a picture that Pillow reads is animated; None for any other file.

    FFmpeg may take a photo for one of a numbered series."""
    try:
        with Image.open(path) as image:
            return bool(getattr(image, "is_animated", False))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
