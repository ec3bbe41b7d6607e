"""PyAV: no file is opened that was not named."""

from __future__ import annotations

import ctypes
import os
import shutil
import struct
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.clips import write_clip

from anyprobe.errors import InputError
from anyprobe.video.clip import clip_size, join_pieces, open_clip, read_frames, write_piece

PICTURES = [np.full((32, 48, 3), 80 * shade, np.uint8) for shade in range(3)]


@pytest.fixture
def made(tmp_path) -> Path:
    (tmp_path / "made").mkdir()
    return write_clip(tmp_path / "made" / "clip.mp4", PICTURES)


def frames(path: Path) -> int:
    return len(list(read_frames(open_clip(path), [])))


@pytest.mark.parametrize(
    "matrix",
    [
        (0, 0, 0, 0),
        (1 << 16, 0, 0, 0),
        (0, 0, 0, 1 << 16),
        (0, 1 << 16, 0, 0),
        (1 << 16, 1 << 16, 1 << 16, 1 << 16),
        (1 << 16, 0, 1 << 16, 1),
    ],
)
def test_a_display_matrix_that_shows_no_picture_turns_nothing(made, tmp_path, matrix):
    data = bytearray(made.read_bytes())
    at = data.index(b"tkhd") + 44
    a, b, c, d = matrix
    data[at : at + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    (tmp_path / "a.mp4").write_bytes(data)
    assert clip_size(open_clip(tmp_path / "a.mp4")) == (48, 32)


@pytest.mark.parametrize("suffix", ["webp", "png", "avif"])
def test_an_animated_picture_is_a_clip_or_said_to_be_one_that_is_not_read(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    first, *others = map(Image.fromarray, np.repeat(PICTURES, 2, axis=1).repeat(2, axis=2))
    first.save(path, save_all=True, append_images=others, duration=100)
    try:
        said = frames(path)
    except InputError as error:
        said = str(error)
    if suffix == "webp" and isinstance(said, str):  # which older FFmpeg does not read
        assert "got a picture" in said
    else:
        assert said == len(PICTURES)


IN_OPEN, IN_NONBLOCK = 0x20, 0o4000


@contextmanager
def opened(folder: Path):
    """Names of the files of a folder that anyone opens within the block, C libraries too."""
    libc, names = ctypes.CDLL(None), []
    watch = libc.inotify_init1(IN_NONBLOCK)
    assert watch >= 0
    assert libc.inotify_add_watch(watch, os.fsencode(folder), IN_OPEN) >= 0
    yield names
    try:
        events = os.read(watch, 65536)
    except BlockingIOError:
        events = b""
    os.close(watch)
    while events:
        size = struct.unpack("iIII", events[:16])[3]
        names.append(events[16 : 16 + size].rstrip(b"\0").decode())
        events = events[16 + size :]


HLS = "#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{}\n#EXT-X-ENDLIST\n"
DASH = (
    '<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011" type="static" mediaPresentationDuration="PT1S">'
    '<Period><AdaptationSet mimeType="video/mp4"><Representation id="1" bandwidth="1"><BaseURL>{}</BaseURL>'
    "</Representation></AdaptationSet></Period></MPD>"
)
SDP = "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=a\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="watches a folder by inotify")
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("list.m3u8", HLS),
        ("list.mp4", HLS),
        ("list.ffconcat", "ffconcat version 1.0\nfile {}\n"),
        ("list.mp4", "ffconcat version 1.0\nfile {}\n"),
        ("list.mov", "\ufeffffconcat version 1.0\nfile '{}'\n"),
        ("list.mpd", DASH),
        ("list.mp4", DASH),
        ("list.sdp", SDP),
    ],
)
@pytest.mark.parametrize("absolute", [False, True])
def test_a_playlist_is_refused_and_nothing_that_it_names_is_opened(made, name, text, absolute):
    """Beside it or elsewhere on this machine, whatever its suffix."""
    other, folder = made.parent / "other.ts", made.parent
    shutil.copy(made, other)
    path = folder / name
    path.write_text(text.format(f"file://{other}" if absolute else other.name), encoding="utf-8")
    with opened(folder) as names, pytest.raises(InputError, match="playlist, which names other files|cannot read it"):
        open_clip(path)
    assert name in names
    assert set(names) == {name}


@pytest.mark.skipif(os.name == "nt", reason="no such names there")
@pytest.mark.parametrize("name", ["concat:clip.mp4|clip.mp4", "file:clip.mp4", "http:nowhere.mp4", "crypto:a.mp4"])
def test_a_name_is_a_files_and_no_address(made, monkeypatch, name):
    monkeypatch.chdir(made.parent)
    shutil.copy(made, name)
    assert frames(Path(name)) == 3
    Path(name).write_bytes(b"other")
    with pytest.raises(InputError, match="cannot read"):
        open_clip(Path(name))


def test_a_pattern_of_names_is_one_file(made):
    from PIL import Image

    for name in ("f1.png", "f2.png", "f%d.png"):
        Image.fromarray(PICTURES[0]).save(made.parent / name)
    with pytest.raises(InputError) as caught:
        open_clip(made.parent / "f%d.png")
    assert "\n" not in str(caught.value)


def test_pieces_are_written_and_joined(tmp_path):
    for number in range(2):
        write_piece(tmp_path / f"{number}.mp4", [(number + k / 10, picture) for k, picture in enumerate(PICTURES)])
    join_pieces(tmp_path / "all.mp4", [tmp_path / "0.mp4", tmp_path / "1.mp4"])
    assert frames(tmp_path / "all.mp4") == 6
