"""Videos of other encodings and codecs: valid ones are read, the others are one line."""

from __future__ import annotations

import numpy as np
import pytest
from support.refused import refused

from anyprobe.errors import InputError

av = pytest.importorskip("av", reason="needs the video extra")

from anyprobe.video.clip import open_clip, read_frames  # noqa: E402


@pytest.fixture
def made(tmp_path):
    path = tmp_path / "clip.mp4"
    with av.open(str(path), "w", options={"movflags": "use_metadata_tags"}) as container:
        container.metadata["title"] = "caf\xe9XX"
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 48, 32, "yuv420p"
        for shade in range(3):
            picture = av.VideoFrame.from_ndarray(np.full((32, 48, 3), 80 * shade, np.uint8), format="rgb24")
            container.mux(stream.encode(picture.reformat(format="yuv420p")))
        container.mux(stream.encode())
    return path


def frames(path) -> int:
    return len(list(read_frames(open_clip(path), [])))


def test_a_title_in_latin_1_is_no_fault(made):
    data = made.read_bytes()
    assert "caf\xe9XX".encode() in data
    made.write_bytes(data.replace("caf\xe9XX".encode(), b"caf\xe9XXX"))
    assert frames(made) == 3


def test_an_unknown_codec_is_one_line(made):
    made.write_bytes(made.read_bytes().replace(b"avc1", b"zzzz"))
    with pytest.raises(InputError) as caught:
        frames(made)
    assert "convert it to mp4" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_frame_of_too_many_pixels_is_refused(made, monkeypatch):
    monkeypatch.setattr("anyprobe.video.frame_pixels.MAX_PIXELS", 1000)
    with refused(source="clip.mp4", naming="48 x 32"):
        frames(made)
