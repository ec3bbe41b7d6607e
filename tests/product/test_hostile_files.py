"""Files made to harm: small ones that decode to much, or for long; and what reading does to the host's process."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
import warnings

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.hostile_files import endless_gif, endless_jpeg, endless_tiff, hidden_hdr, instanced_glb, multipart_exr

from anyprobe.errors import InputError, InvalidEnvironment, InvalidMesh, InvalidPhoto
from anyprobe.estimate.poses import read_poses
from anyprobe.files.objects import read_mesh
from anyprobe.maps import image_io, radiance
from anyprobe.maps.exr import read_exr
from anyprobe.maps.radiance import read_linear, read_radiance, write_hdr
from anyprobe.pictures.declared_size import declared_pixels, photo_header
from anyprobe.pictures.images import read_image


def refused(kind, function, *arguments) -> str:
    """The one line that it is refused with."""
    with pytest.raises(kind) as caught:
        function(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def is_soon(seconds: float, function, *arguments) -> None:
    """Fails where a function needs more of the processor's time."""
    start = os.times().user
    function(*arguments)
    assert os.times().user - start < seconds


# Limits hold for what is decoded


def test_pixels_of_all_layers_of_an_exr_count(monkeypatch):
    channels = {f"layer{k}.R": np.ones((500, 500), np.float16) for k in range(40)}
    stream = io.BytesIO()
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(stream)
    data = stream.getvalue()
    assert declared_pixels(data) == 10 * 500**2
    monkeypatch.setattr(image_io, "_read", lambda *_: pytest.fail("decoded"))
    assert "all layers" in refused(InvalidPhoto, read_exr, data, "p", InvalidPhoto, 1_000_000)


def test_a_comment_does_not_hide_the_size_of_a_map(tmp_path):
    data = hidden_hdr(8192, 16384)
    assert declared_pixels(data) == 8192 * 16384
    (tmp_path / "map.hdr").write_bytes(data)
    assert "16384 x 8192" in refused(InvalidEnvironment, read_radiance, tmp_path / "map.hdr", 1_000_000)
    assert "16384 x 8192" in refused(InputError, read_linear, data, 1_000_000)


def test_a_map_far_shorter_than_its_size_takes_no_memory(tmp_path, monkeypatch):
    (tmp_path / "map.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 16384\n" + bytes(99))
    monkeypatch.setattr(radiance, "read_pixels", lambda *_: pytest.fail("decoded"))
    assert "whole rows" in refused(InvalidEnvironment, read_radiance, tmp_path / "map.hdr")


def test_a_deep_exr_is_refused_before_it_is_decoded(tmp_path):
    oiio = image_io.library()
    spec = oiio.ImageSpec(64, 64, 3, "half")
    spec.deep = True
    samples, file = oiio.DeepData(), oiio.ImageOutput.create("openexr")
    samples.init(64 * 64, 3, ["half"] * 3, ["R", "G", "B"])
    assert file.open(str(tmp_path / "deep.exr"), spec)
    assert file.write_deep_image(samples)
    file.close()
    del file
    assert "deep" in refused(InvalidPhoto, read_image, tmp_path / "deep.exr")


@pytest.mark.parametrize("make", [endless_tiff, endless_gif])
def test_frames_are_not_counted(make):
    data = make(50_000)
    seen = []
    is_soon(2.0, lambda: seen.append(read_image(data)))
    assert "several frames or pages" in seen[0].warnings[0]


def test_a_jpeg_of_a_thousand_scans_is_refused():
    data = endless_jpeg(1000)
    is_soon(2.0, refused, InvalidPhoto, read_image, data)
    assert "scans" in refused(InvalidPhoto, read_image, data)
    assert photo_header(data) == ((0, 0), None)


def test_an_honest_progressive_jpeg_is_read_whatever_follows_it(rng):
    stream = io.BytesIO()
    noise = rng.integers(0, 256, (80, 80, 3), np.uint8)
    Image.fromarray(noise).save(stream, format="JPEG", progressive=True, exif=endless_jpeg(3)[:9000])
    assert read_image(stream.getvalue() + b"\xff\xda\0\0" * 1000).rgb.shape == (80, 80, 3)


@pytest.mark.ci
def test_a_scene_of_very_many_nodes_is_refused(tmp_path):
    (tmp_path / "many.glb").write_bytes(instanced_glb(200_000))
    is_soon(3.0, refused, InvalidMesh, read_mesh, tmp_path / "many.glb")
    (tmp_path / "some.glb").write_bytes(instanced_glb(5))
    assert len(read_mesh(tmp_path / "some.glb").faces) == 5


@pytest.mark.parametrize("uri", ["outside.bin", "../outside.bin", "/dev/zero"])
def test_a_mesh_opens_no_other_file(tmp_path, uri):
    (tmp_path / "outside.bin").write_bytes(np.arange(9, dtype="<f4").tobytes())
    (tmp_path / "mesh.glb").write_bytes(instanced_glb(1, uri=uri))
    assert "other files" in refused(InvalidMesh, read_mesh, tmp_path / "mesh.glb")


def test_a_material_file_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "waits.mtl")  # whoever opens it stops here
    (tmp_path / "a.obj").write_text("mtllib waits.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(read_mesh(tmp_path / "a.obj").faces) == 1


# Errors that were tracebacks


@pytest.mark.parametrize("path", ["/dev/zero", "pipe"])
@pytest.mark.parametrize("read", [read_poses, read_image])
def test_a_file_without_an_end_is_not_waited_for(tmp_path, path, read):
    from pathlib import Path

    os.mkfifo(tmp_path / "pipe")
    assert "a pipe or device" in refused(InputError, read, Path(tmp_path / path))


# A guest in someone's program


def test_reading_in_threads_leaves_the_filters_of_warnings_alone(photo_rgba):
    stream = io.BytesIO()
    Image.fromarray(photo_rgba).save(stream, format="PNG")
    before = list(warnings.filters)
    threads = [threading.Thread(target=lambda: [read_image(stream.getvalue()) for _ in range(40)]) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert warnings.filters == before


@pytest.mark.ci
def test_a_process_that_forks_while_another_thread_reads_goes_on():
    """In an interpreter of its own, which this one may end."""
    code = """
import os, sys, threading, warnings
warnings.simplefilter("ignore")
from support.hostile_files import multipart_exr
from anyprobe.pictures.images import read_image
data = multipart_exr(64, 300)
stop = threading.Event()
def again():
    while not stop.is_set():
        read_image(data)
thread = threading.Thread(target=again)
thread.start()
for _ in range(20):
    child = os.fork()
    if child == 0:
        read_image(data)
        os._exit(7)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 7
stop.set()
thread.join()
print("whole")
"""
    path = os.pathsep.join(sys.path)
    ended = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert ended.stdout == "whole\n", ended.stderr


def test_a_damaged_exr_is_one_line_where_the_process_is_ours(tmp_path, monkeypatch, capfd):
    from anyprobe.cli.app import silenced

    data = bytearray(multipart_exr(64, 64))
    data[-400:] = b"\x55" * 400
    monkeypatch.setattr(image_io, "quiet", silenced)
    refused(InvalidPhoto, read_image, bytes(data))
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("", "")


@pytest.mark.ci
@pytest.mark.parametrize("blas", ["1", "3"])
def test_the_same_photo_gives_the_same_bits_whatever_the_threads(photo_rgba, tmp_path, blas):
    """Of the networks, of NumPy's linear algebra, and with others at work beside it."""
    np.save(tmp_path / "photo.npy", photo_rgba)
    code = f"""
import hashlib, numpy as np
from concurrent.futures import ThreadPoolExecutor
from anyprobe.estimate.estimator import Estimator
photo = np.load({str(tmp_path / "photo.npy")!r})
def digest(light):
    return hashlib.sha256(light.radiance.tobytes() + light.confidence.tobytes()).hexdigest()
found = {{digest(Estimator(threads=n)(photo)) for n in (1, 2, 8, None)}}
estimator = Estimator()
with ThreadPoolExecutor(4) as pool:
    found |= set(pool.map(lambda _: digest(estimator(photo)), range(4)))
found.add(digest(Estimator()(photo, mask=photo[..., 3])))
print(*found)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": blas}
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env=environment)
    assert len(ended.stdout.split()) == 1, ended.stdout + ended.stderr
    seen = digests.setdefault("photo", ended.stdout)
    assert seen == ended.stdout


digests: dict[str, str] = {}


def test_a_map_is_written_in_the_same_bytes_each_time(tmp_path, rng):
    radiance = rng.random((8, 16, 3), np.float32)
    for name in "ab":
        write_hdr(tmp_path / f"{name}.hdr", radiance)
    assert (tmp_path / "a.hdr").read_bytes() == (tmp_path / "b.hdr").read_bytes()


def test_an_interrupt_at_the_start_is_one_line(tmp_path):
    """While libraries are imported, which is most of a short command's time."""
    (tmp_path / "onnxruntime.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGINT)")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    ended = subprocess.run(
        [sys.executable, "-c", "from anyprobe_command import main; main()", "--version"],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
    )
    assert (ended.returncode, ended.stderr) == (130, "anyprobe: interrupted\n")


@pytest.mark.ci
def test_a_reader_of_the_output_that_leaves_is_no_fault(tmp_path, photo_rgba):
    Image.fromarray(photo_rgba).save(tmp_path / "a.png")
    read, write = os.pipe()
    os.close(read)
    words = [sys.executable, "-m", "anyprobe", "mask", "a.png"]
    ended = subprocess.run(words, cwd=tmp_path, stdout=write, stderr=subprocess.PIPE, timeout=120)
    os.close(write)
    assert (ended.returncode, ended.stderr) == (1, b"")
