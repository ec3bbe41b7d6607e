"""A clip is read as a player shows it: its colours, its shape, its size, and it alone of all that the file holds."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.picture_files import REC2020_FROM_REC709, hlg, pq, srgb
from support.refused import refused

av = pytest.importorskip("av", reason="needs the video extra")

from anyprobe.core.color import rec709_from_rgb  # noqa: E402
from anyprobe.core.response import inverse_response  # noqa: E402
from anyprobe.pictures.color_encoding import PRIMARIES  # noqa: E402
from anyprobe.video.clip import Frame, open_clip, read_frames, write_piece  # noqa: E402
from anyprobe.video.following import MaskFollower  # noqa: E402

CASES = Path(__file__).parent / "cases"

LINEAR = np.array([[[0.7, 0.7, 0.7], [0.6, 0.1, 0.1], [0.1, 0.5, 0.1], [0.1, 0.15, 0.6], [0.03, 0.03, 0.03]]])
LUMA = {1: (0.2126, 0.0722), 6: (0.299, 0.114), 9: (0.2627, 0.0593)}


def frames(path) -> list[Frame]:
    return list(read_frames(open_clip(path), []))


def wide(row: np.ndarray) -> np.ndarray:
    """Each colour 16 x 16, so that chroma of half the size is exact in the middle."""
    return row.repeat(16, axis=0).repeat(16, axis=1)


def coded(path, values, *, matrix, bits=8, full=False, tags=None, aspect=None, codec="ffv1", rate=10):
    """A clip of one picture: display or other code values [H, W, 3] as YCbCr of 4:2:0, lossless."""
    kr, kb = LUMA[matrix]
    red, green, blue = np.moveaxis(values, -1, 0)
    y = kr * red + (1 - kr - kb) * green + kb * blue
    cb, cr = (blue - y) / (2 - 2 * kb), (red - y) / (2 - 2 * kr)
    step, top = 2 ** (bits - 8), 2**bits - 1
    planes = (
        (y * top, cb * top + 128 * step, cr * top + 128 * step)
        if full
        else ((16 + 219 * y) * step, (128 + 224 * cb) * step, (128 + 224 * cr) * step)
    )
    height, width = y.shape
    kind = "yuv420p" if bits == 8 else f"yuv420p{bits}le"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        stream.width, stream.height, stream.pix_fmt = width, height, kind
        for name, value in (tags or {}).items():
            setattr(stream.codec_context, name, value)
        if aspect:
            stream.sample_aspect_ratio = aspect
        picture = av.VideoFrame(width, height, kind)
        for index, (plane, numbers) in enumerate(zip(picture.planes, planes, strict=True)):
            numbers = numbers if index == 0 else numbers[::2, ::2]
            filled = np.zeros((plane.height, plane.line_size // (1 if bits == 8 else 2)), "u1" if bits == 8 else "<u2")
            filled[:, : plane.width] = np.round(np.clip(numbers, 0, top))
            plane.update(filled.tobytes())
        picture.colorspace, picture.color_range = tags["colorspace"], tags["color_range"]
        container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def tagged(matrix, primaries, transfer, full=False) -> dict[str, int]:
    return {"colorspace": matrix, "color_primaries": primaries, "color_trc": transfer, "color_range": 2 if full else 1}


def middles(rgb: np.ndarray) -> np.ndarray:
    return rgb[8, 8::16].astype(float)


@pytest.mark.parametrize("bits", [8, 10, 12])
@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("matrix", [1, 6])
def test_matrix_range_and_bits_are_those_the_stream_names(tmp_path, bits, full, matrix):
    path = coded(
        tmp_path / "a.mkv", wide(srgb(LINEAR)), matrix=matrix, bits=bits, full=full, tags=tagged(matrix, 1, 1, full)
    )
    (frame,) = frames(path)
    np.testing.assert_allclose(middles(frame.rgb), 255 * srgb(LINEAR)[0], atol=1.6 if bits == 8 else 0.8)
    assert frame.radiance is None


@pytest.mark.parametrize("bits", [10, 12])
@pytest.mark.parametrize(("transfer", "curve"), [(16, pq), (18, hlg)])
def test_pq_and_hlg_of_bt2020_give_light_above_white(tmp_path, bits, transfer, curve):
    linear = LINEAR * np.array([3.0, 1, 1, 1, 1])[None, :, None]
    values = wide(curve(linear @ REC2020_FROM_REC709.T))
    (frame,) = frames(coded(tmp_path / "a.mkv", values, matrix=9, bits=bits, tags=tagged(9, 9, transfer)))
    np.testing.assert_allclose(frame.radiance[8, 8], linear[0, 0], rtol=0.02)
    seen = srgb(linear[0, 1:])
    np.testing.assert_allclose(middles(frame.radiance)[1:], inverse_response(seen), rtol=0.03, atol=0.004)
    np.testing.assert_allclose(middles(frame.rgb), 255 * srgb(np.minimum(linear, 1))[0], atol=2.5)


def test_primaries_of_bt2020_in_sdr_and_of_smpte_170m_are_turned_to_rec709(tmp_path):
    for matrix, primaries in ((9, 9), (6, 6)):
        inside = np.linalg.inv(rec709_from_rgb(PRIMARIES[primaries]))
        values = wide(srgb(np.clip(LINEAR @ inside.T, 0, 1)))
        (frame,) = frames(coded(tmp_path / "a.mkv", values, matrix=matrix, bits=10, tags=tagged(matrix, primaries, 14)))
        np.testing.assert_allclose(middles(frame.rgb), 255 * srgb(LINEAR)[0], atol=2.0)


@pytest.mark.parametrize(("height", "matrix"), [(480, 6), (720, 1)])
def test_a_matrix_that_is_not_named_is_taken_as_players_take_it(tmp_path, height, matrix):
    values = wide(srgb(LINEAR)).repeat(height // 16, axis=0)
    (frame,) = frames(coded(tmp_path / "a.mkv", values, matrix=matrix, tags=tagged(2, 2, 2)))
    np.testing.assert_allclose(middles(frame.rgb), 255 * srgb(LINEAR)[0], atol=1.6)


def test_colours_that_cannot_be_converted_are_one_line(tmp_path):
    path = coded(tmp_path / "a.mkv", wide(srgb(LINEAR)), matrix=1, bits=10, tags=tagged(14, 9, 16))
    with refused(source="a.mkv", naming="matrix 14") as caught:
        frames(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "h264"])
@pytest.mark.parametrize("aspect", [Fraction(2), Fraction(4, 3), Fraction(8, 9)])
def test_pixels_are_made_square(tmp_path, suffix, aspect):
    values = wide(srgb(LINEAR)).repeat(4, axis=0)
    path = coded(tmp_path / f"a.{suffix}", values, matrix=6, tags=tagged(6, 1, 1), aspect=aspect, codec="libx264")
    (frame,) = frames(path)
    assert frame.rgb.shape == (64, round(80 * aspect), 3)


def test_a_relit_clip_says_that_its_pixels_are_square(tmp_path):
    write_piece(tmp_path / "a.mp4", [(0.0, np.zeros((32, 48, 3), np.uint8))])
    with av.open(str(tmp_path / "a.mp4")) as container:
        assert container.streams.video[0].codec_context.sample_aspect_ratio == 1


def test_an_interlaced_clip_comes_out_whole():
    """Its rows are of two moments, 12 pixels of motion apart: a comb at every edge."""

    def combed(rgb: np.ndarray) -> float:
        luma = rgb[..., 1].astype(float)
        return np.abs(luma[1:-1] - (luma[:-2] + luma[2:]) / 2).mean() / np.abs(luma[2:] - luma[:-2]).mean()

    path = CASES / "interlaced_fast.mp4"
    with av.open(str(path)) as container:
        stored = [combed(picture.to_ndarray(format="rgb24")) for picture in container.decode(video=0)]
    found = frames(path)
    assert len(found) == len(stored) == 10
    np.testing.assert_allclose([frame.time_s for frame in found], np.arange(10) / 25, atol=1e-6)
    assert min(stored) > 1.5 * max(combed(frame.rgb) for frame in found)


def test_the_transparency_of_a_clip_is_read_and_marks_its_object(tmp_path):
    rgb = np.full((96, 128, 4), (180, 90, 60, 0), np.uint8)
    ball = (np.mgrid[:96] - 40)[:, None] ** 2 + (np.mgrid[:128] - 70)[None] ** 2 < 25**2
    rgb[ball, 3] = 255
    with av.open(str(tmp_path / "a.mkv"), "w") as container:
        stream = container.add_stream("ffv1", rate=10)
        stream.width, stream.height, stream.pix_fmt = 128, 96, "yuva420p"
        for _ in range(2):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(rgb, format="rgba")))
        container.mux(stream.encode())
    found = frames(tmp_path / "a.mkv")
    np.testing.assert_allclose(found[0].alpha, ball, atol=0.02)
    photo = MaskFollower({}, {}, {}).photo(found[1])
    np.testing.assert_array_equal(photo.mask > 0.5, ball)
    assert photo.mask_source == "alpha"
    assert frames(CASES / "interlaced_fast.mp4")[0].alpha is None
