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

ONE_FILE = {
    "format_whitelist": ",".join(CONTAINERS),
    "protocol_whitelist": "file",
    "enable_drefs": "0",  # parts of a .mov that lie in other files
    "use_absolute_path": "0",
}
"""Options that let FFmpeg open the named file and nothing else."""


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
    try:
        with Image.open(path):
            text = "expected a video, got a picture; anyprobe estimate and relight take it"
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        text = "expected a video, got another kind of file, or a playlist, which names other files; convert it to mp4"
    return InputError(text, source=path)
