"""A browser shows the page the same colours as Python reads, within 1 %, where docs/reference/files.md says so."""

from __future__ import annotations

import base64
import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import run_steps, serve
from support.picture_files import REC2020_FROM_REC709, eight, gamma_curve, icc, png, pq, scene, sixteen, srgb, ultra_hdr

from anyprobe.pictures.color_encoding import by_code_points
from anyprobe.pictures.images import read_image

pytestmark = pytest.mark.slow

LINEAR = scene()
DISPLAY = srgb(LINEAR)
P3 = srgb(np.clip(LINEAR @ np.linalg.inv(by_code_points(12, 8).matrix).T, 0, 1))
USUAL = b"gAMA", struct.pack(">I", 45455)


def saved(kind: str, **options) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(eight(DISPLAY)).save(stream, kind, **options)
    return stream.getvalue()


def profiled(pixels: np.ndarray, profile: bytes) -> bytes:
    return png(pixels, (b"iCCP", b"x\0\0" + zlib.compress(profile)))


SAME = {
    "PNG": png(eight(DISPLAY)),
    "JPEG": saved("JPEG", quality=95, subsampling=0),
    "WebP": saved("WEBP", lossless=True),
    "AVIF": saved("AVIF", quality=100, subsampling="4:4:4"),
    "cICP P3": png(eight(P3), (b"cICP", bytes((12, 13, 0, 1)))),
    "cICP linear": png(sixteen(LINEAR), (b"cICP", bytes((1, 8, 0, 1)))),
    "linear profile": profiled(eight(LINEAR), icc(gamma_curve(1))),
    "linear profile, 16 bits": profiled(sixteen(LINEAR), icc(gamma_curve(1))),
    "linear grey profile": profiled(eight(LINEAR[..., 1]), icc(gamma_curve(1), grey=True)),
    "gAMA 1": png(sixteen(LINEAR), (b"gAMA", struct.pack(">I", 100000))),
    "usual gAMA": png(eight(DISPLAY), USUAL),
    "usual gAMA, cHRM": png(
        eight(DISPLAY), USUAL, (b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000))
    ),
    "gain map's base": ultra_hdr(DISPLAY, DISPLAY[..., 0], 3.0),
}
OTHER = {"cICP PQ": png(sixteen(pq(LINEAR @ REC2020_FROM_REC709.T)), (b"cICP", bytes((9, 16, 0, 1))))}


@pytest.fixture(scope="module")
def canvases(tmp_path_factory) -> dict[str, np.ndarray]:
    folder: Path = tmp_path_factory.mktemp("blank")
    (folder / "blank.html").write_text("<!doctype html><title>blank</title>")
    files = {name: base64.b64encode(data).decode() for name, data in (SAME | OTHER).items()}
    with serve({"/": folder}) as url:
        found = run_steps("decoded_pictures.mjs", url, {"files": files})
    shape = (*DISPLAY.shape[:2], 4)
    return {name: np.frombuffer(base64.b64decode(text), np.uint8).reshape(shape) / 255 for name, text in found.items()}


@pytest.mark.parametrize("name", SAME)
def test_a_canvas_has_the_colours_that_python_reads(canvases, name):
    assert np.abs(canvases[name][..., :3] - read_image(SAME[name]).rgb).mean() < 0.01


def test_a_canvas_darkens_pq_which_python_does_not(canvases):
    """To fit the screen's range: the page's estimate of such a photo is darker than Python's."""
    assert (canvases["cICP PQ"][..., :3] - read_image(OTHER["cICP PQ"]).rgb).mean() < -0.05
