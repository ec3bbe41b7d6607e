"""Radiance maps written and read back, and files that are not what they say."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from support.refused import assert_one_line

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InvalidEnvironment
from anyprobe.export.exported_light import share_beyond
from anyprobe.maps.radiance import HALF_MAX, map_attributes, read_radiance, write_exr, write_hdr


def draw_map(height: int, seed: int = 0) -> np.ndarray:
    """Radiance over nine decades, with flat patches that make runs."""
    rng = np.random.default_rng(seed)
    radiance = 10.0 ** rng.uniform(-4.0, 5.0, (height, 2 * height, 1)) * rng.random((height, 2 * height, 3))
    radiance[height // 2 :, : height // 2] = (0.25, 0.5, 1.0)
    radiance[0] = 0.0
    return radiance.astype(np.float32)


def assert_within_rgbe(read: np.ndarray, written: np.ndarray) -> None:
    """Half a step of the shared exponent: 1/255 of the pixel's largest channel at most."""
    step = written.max(axis=-1, keepdims=True) / 255.0
    assert (np.abs(read - written) <= step).all()


def hdr_file(height: int, width: int, pixels: bytes, lines: str = "FORMAT=32-bit_rle_rgbe\n") -> bytes:
    return f"#?RADIANCE\n{lines}\n-Y {height} +X {width}\n".encode() + pixels


# .hdr


@pytest.mark.parametrize("height", [1, 3, 4, 8, 64, 100])  # widths 2 and 6 must be flat
def test_hdr_round_trip(tmp_path, height):
    radiance = draw_map(height)
    write_hdr(tmp_path / "map.hdr", radiance)
    read = read_radiance(tmp_path / "map.hdr")
    assert read.dtype == np.float32
    assert_within_rgbe(read, radiance)


def test_a_map_is_read_whatever_its_name(tmp_path):
    radiance = np.minimum(draw_map(16), 100.0)
    for name, other, write in (("map.hdr", "map.exr", write_hdr), ("map.exr", "map.hdr.txt", write_exr)):
        write(tmp_path / name, radiance)
        (tmp_path / name).rename(tmp_path / other)
        np.testing.assert_allclose(read_radiance(tmp_path / other), radiance, rtol=0.01, atol=0.01 * radiance.max())


def test_hdr_extremes(tmp_path):
    radiance = np.zeros((4, 8, 3), dtype=np.float32)
    radiance[0, :, :] = [1.0, 0.999, 255.5 / 256]  # on the edge of a ninth bit
    radiance[1, 0] = 0.99999
    radiance[1, 1] = 65504.0
    radiance[1, 2] = 1e30
    radiance[1, 3] = np.finfo(np.float32).max  # above the format: the largest it holds
    radiance[1, 4] = 1e-30
    radiance[1, 5] = 1e-44  # below the format: black
    radiance[2, 0] = [1e5, 1.0, 0.0]
    write_hdr(tmp_path / "map.hdr", radiance)
    read = read_radiance(tmp_path / "map.hdr")
    assert read[1, 3].min() > 1.6e38
    assert (read[1, 5] == 0.0).all()
    radiance[1, 3] = read[1, 3]
    radiance[1, 5] = 0.0
    assert_within_rgbe(read, radiance)
    assert (read[3] == 0.0).all()


def test_hdr_is_read_by_another_program(tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    radiance = draw_map(64)
    write_hdr(tmp_path / "map.hdr", radiance)
    read = cv2.imread(str(tmp_path / "map.hdr"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    np.testing.assert_allclose(read, read_radiance(tmp_path / "map.hdr"), rtol=1e-6)


def test_hdr_of_another_program_is_read(tmp_path):
    cv2 = pytest.importorskip("cv2")
    radiance = draw_map(64)
    cv2.imwrite(str(tmp_path / "map.hdr"), np.ascontiguousarray(radiance[..., ::-1]))
    read = read_radiance(tmp_path / "map.hdr")
    assert (np.abs(read - radiance) <= radiance.max(axis=-1, keepdims=True) / 120.0).all()  # cut, not rounded


def test_hdr_exposure_is_divided_out(tmp_path):
    pixels = bytes((128, 128, 128, 129)) * 32  # 1.0
    (tmp_path / "map.hdr").write_bytes(hdr_file(4, 8, pixels, "EXPOSURE=4\nEXPOSURE= 0.5\n"))
    np.testing.assert_allclose(read_radiance(tmp_path / "map.hdr"), 0.5)


# .exr


def test_exr_header(tmp_path):
    write_exr(tmp_path / "map.exr", draw_map(8), attributes={"model": "v1", "fov_source": "exif"})
    with OpenEXR.File(str(tmp_path / "map.exr")) as file:
        header = file.header()
        assert isinstance(header["envmap"], OpenEXR.Envmap)
        assert header["envmap"] == OpenEXR.ENVMAP_LATLONG
        np.testing.assert_allclose(
            header["chromaticities"], (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), atol=1e-6
        )
        assert header["anyprobe:model"] == "v1"
        assert header["anyprobe:fov_source"] == "exif"
        assert file.channels()["RGB"].pixels.dtype == np.float16


def test_exr_float_is_exact(tmp_path):
    radiance = draw_map(16) * 100.0
    write_exr(tmp_path / "map.exr", radiance, half=False)
    np.testing.assert_array_equal(read_radiance(tmp_path / "map.exr"), radiance)


def test_exr_half_does_not_become_infinite(tmp_path):
    radiance = np.full((8, 16, 3), 1000.0, dtype=np.float32)
    radiance[0, 5] = 1e6  # near the pole, where a pixel is small
    write_exr(tmp_path / "map.exr", radiance)
    read = read_radiance(tmp_path / "map.exr")
    assert read[0, 5].tolist() == [65504.0] * 3
    weights = pixel_solid_angles(8).astype(float)[:, :, None]
    assert share_beyond(radiance, HALF_MAX) == pytest.approx(
        weights[0, 0, 0] * 3 * (1e6 - 65504) / (radiance * weights).sum(), rel=1e-4
    )


def test_exr_half_without_a_peak_clips_nothing(tmp_path):
    radiance = np.random.default_rng(0).random((16, 32, 3)).astype(np.float32)
    assert share_beyond(radiance, HALF_MAX) == 0.0
    write_exr(tmp_path / "map.exr", radiance)
    np.testing.assert_allclose(read_radiance(tmp_path / "map.exr"), radiance, rtol=1e-3, atol=1e-6)
    black = np.zeros((8, 16, 3))
    assert share_beyond(black, HALF_MAX) == 0.0
    write_exr(tmp_path / "black.exr", black)
    assert not read_radiance(tmp_path / "black.exr").any()


def test_attributes_are_the_same_in_both_formats(tmp_path):
    """In a .hdr as comments that no reader minds, in lines shorter than any reader's buffer."""
    given = {
        "frame": "right-handed, +X right; u = 0.5 + atan2(x, -z) / 2 pi, " * 4 + "row 0 is +Y",
        "of": "\n1 =\n\n2 é",
    }
    radiance = draw_map(16)
    write_hdr(tmp_path / "map.hdr", radiance, attributes=given)
    write_exr(tmp_path / "map.exr", radiance, attributes={"frame": given["frame"]})
    found = map_attributes(tmp_path / "map.hdr")
    assert found["frame"] == map_attributes(tmp_path / "map.exr")["frame"] == given["frame"]
    assert found["of"] == "1 = 2 \\xe9"
    header = (tmp_path / "map.hdr").read_bytes().partition(b"\n\n")[0]
    assert max(len(line) for line in header.split(b"\n")) < 127
    write_hdr(tmp_path / "bare.hdr", radiance)
    np.testing.assert_array_equal(read_radiance(tmp_path / "map.hdr"), read_radiance(tmp_path / "bare.hdr"))
    assert map_attributes(tmp_path / "bare.hdr") == map_attributes(tmp_path / "absent.hdr") == {}


# Primaries

AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
AP1 = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
ADOBE = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329)
TO_REC709 = {  # as published, by Bradford
    AP0: [
        [2.52168619, -1.13413099, -0.38755520],
        [-0.27647991, 1.37271909, -0.09623918],
        [-0.01537825, -0.15297534, 1.16835359],
    ],
    AP1: [
        [1.70505099, -0.62179212, -0.08325887],
        [-0.13025642, 1.14080474, -0.01054832],
        [-0.02400336, -0.12896898, 1.15297233],
    ],
    ADOBE: [[1.39836, -0.39836, 0.0], [0.0, 1.0, 0.0], [0.0, -0.04293, 1.04293]],
}


def store(path, pixels, primaries):
    """The numbers as they are, under primaries of any kind."""
    if path.suffix == ".exr":
        pixels = np.asarray(pixels, dtype=np.float32)
        OpenEXR.File({"chromaticities": primaries}, {"RGB": pixels}).write(str(path))
        return
    write_hdr(path, pixels)
    line = f"PRIMARIES= {' '.join(map(str, primaries))}\nFORMAT=".encode()
    path.write_bytes(path.read_bytes().replace(b"FORMAT=", line, 1))


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
@pytest.mark.parametrize("primaries", list(TO_REC709))
def test_other_primaries_become_rec709(tmp_path, suffix, primaries):
    path = tmp_path / f"map{suffix}"
    wanted = np.random.default_rng(0).uniform(0.2, 1.0, (8, 16, 3))
    wanted[0] = 1.0  # white stays white, whatever its own is
    stored = wanted @ np.linalg.inv(TO_REC709[primaries]).T
    store(path, stored, primaries)
    step = 4e-5 if suffix == ".exr" else 4 * stored.max() / 255
    np.testing.assert_allclose(read_radiance(path), wanted, atol=step)
    assert np.abs(stored - wanted).max() > 2 * step


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
def test_colour_outside_of_rec709_is_cut_at_zero(tmp_path, suffix):
    store(tmp_path / f"map{suffix}", np.full((8, 16, 3), (0.0, 1.0, 0.0)), AP0)
    read = read_radiance(tmp_path / f"map{suffix}")
    np.testing.assert_allclose(read, np.full((8, 16, 3), (0.0, 1.3727, 0.0)), atol=1e-3)


def test_hdr_whose_primaries_are_zeros_is_rec709(tmp_path):
    """As Photoshop and ImageMagick write what they do not know."""
    radiance = draw_map(8)
    store(tmp_path / "map.hdr", radiance, (0,) * 8)
    write_hdr(tmp_path / "plain.hdr", radiance)
    np.testing.assert_array_equal(read_radiance(tmp_path / "map.hdr"), read_radiance(tmp_path / "plain.hdr"))


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
@pytest.mark.parametrize(
    "primaries",
    [
        (0.0,) * 7 + (1.0,),  # a white without light
        (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.25, 0.45),  # the white outside
        (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.7, 0.2),  # a white inside that no eye takes for one
        (0.64, 0.33, 0.64, 0.33, 0.15, 0.06, 0.3127, 0.329),  # red is green
        (np.nan,) * 8,
    ],
)
def test_impossible_primaries(tmp_path, suffix, primaries):
    store(tmp_path / f"map{suffix}", np.ones((8, 16, 3)), primaries)
    with pytest.raises(InvalidEnvironment) as caught:
        read_radiance(tmp_path / f"map{suffix}")
    assert_one_line(caught, f"map{suffix}", "x, y of red, green, blue", "save it as linear Rec. 709")
