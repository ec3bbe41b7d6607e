"""The reproductions of what was found, one line each: python -m tests.fuzz.reproductions [--only WORD].

Run it with PYTHONPATH leading to another version's src to see that one's lines. Seconds are of the processor, of all
processes of a case; wall is the clock's; MB is the most that they held together. Each case ends after --patience
seconds.
"""

from __future__ import annotations

import argparse
import contextlib
import http.client
import io
import os
import re
import resource
import socket
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.seeds import endless_gif, endless_jpeg, endless_tiff, hidden_hdr, instanced_glb, multipart_exr

COMMAND = [sys.executable, "-c", "from anyprobe.cli.app import main; main()"]
MEMORY_CAP_MB = 6000
"""No case may take more of this machine."""

CASES: dict[str, Callable[[Path], str]] = {}


def case(name: str) -> Callable:
    def keep(function: Callable[[Path], str]) -> Callable[[Path], str]:
        CASES[name] = function
        return function

    return keep


class Watch:
    """Processor seconds and memory of a process and all below it, while it lives."""

    def __init__(self, pid: int) -> None:
        self.pid, self.most_mb, self.cpu_s, self._on = pid, 0.0, 0.0, True
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        before: dict[int, float] = {}
        while self._on:
            held = 0.0
            for pid in _tree(self.pid):
                with contextlib.suppress(OSError, IndexError, ValueError):
                    held += int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * resource.getpagesize() / 2**20
                    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
                    before[pid] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            self.most_mb, self.cpu_s = max(self.most_mb, held), sum(before.values())
            time.sleep(0.05)

    def end(self) -> str:
        self._on = False
        self._thread.join()
        return f"{self.cpu_s:6.1f} s {self.most_mb:6.0f} MB"


def _tree(pid: int) -> Iterator[int]:
    yield pid
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                yield from _tree(int(child))


def _capped() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_CAP_MB * 2**20,) * 2)


def python(code: str, patience: float | None = None) -> str:
    """What a program prints last, or how it ended."""
    return run([sys.executable, "-c", code], patience)


def run(command: list[str], patience: float | None = None, show: Callable | None = None) -> str:
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace", preexec_fn=_capped
    )
    watch = Watch(process.pid)
    try:
        out, err = process.communicate(timeout=patience or PATIENCE)
        said = show(out, err) if show else _last(out, err)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        said = "not done"
    return f"{watch.end()}  {said}"


def _last(out: str, err: str) -> str:
    lines = (out.strip() or err.strip() or "silence").splitlines()
    return ("TRACEBACK " if "Traceback" in err else "") + lines[-1][:110]


PATIENCE = 60.0

READ = """
import sys
from anyprobe.errors import AnyprobeError
try:
    {call}
    print("read")
except AnyprobeError as error:
    print("refused:", str(error).replace({folder!r}, ""))
"""


def reading(folder: Path, name: str, data: bytes | str, call: str) -> str:
    """A file read by the library: call, with PATH for where it lies."""
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return python(READ.format(call=call.replace("PATH", repr(str(path))), folder=str(folder)))


IMAGE = "from anyprobe.pictures.images import read_image; read_image(PATH)"
MESH = "from anyprobe.files.meshes import read_mesh; read_mesh(PATH)"


@contextlib.contextmanager
def server(*options: str, descriptors: int | None = None) -> Iterator[tuple[int, Watch, Path]]:
    """A server on a free port, its watch, and its log."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]

    def few() -> None:
        if descriptors:
            resource.setrlimit(resource.RLIMIT_NOFILE, (descriptors, descriptors))

    with tempfile.NamedTemporaryFile("w+b") as log:
        command = [*COMMAND, "serve", "--port", str(port), *options]
        process = subprocess.Popen(command, stderr=log, stdout=subprocess.DEVNULL, preexec_fn=few)
        try:
            for _ in range(1200):
                with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                    break
                time.sleep(0.1)
            post(port, "/v1/photo", png(64))  # its processes are ready
            watch = Watch(process.pid)
            yield port, watch, Path(log.name)
        finally:
            process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(20)
            process.kill()


def png(side: int) -> bytes:
    stream = io.BytesIO()
    picture = np.zeros((side, side, 4), np.uint8)
    picture[side // 4 : -side // 4, side // 4 : -side // 4] = (200, 120, 60, 255)
    Image.fromarray(picture).save(stream, format="PNG")
    return stream.getvalue()


def post(port: int, path: str, body: bytes, kind: str = "", method: str = "POST") -> str:
    """Status and seconds of one request; a body without a kind is the form's photo."""
    if not kind:
        body, kind = form(("photo", body))
    start = time.monotonic()
    line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    try:
        line.request(method, path, body or None, {"Content-Type": kind})
        answer = line.getresponse()
        answer.read()
        return f"{answer.status} in {time.monotonic() - start:.1f} s"
    except OSError as error:
        return f"{type(error).__name__} after {time.monotonic() - start:.1f} s"
    finally:
        line.close()


def form(*parts: tuple[str, bytes]) -> tuple[bytes, str]:
    edge = uuid.uuid4().hex
    body = b"".join(
        f'--{edge}\r\nContent-Disposition: form-data; name="{name}"; filename="{name}"\r\n\r\n'.encode()
        + data
        + b"\r\n"
        for name, data in parts
    )
    return body + f"--{edge}--\r\n".encode(), f"multipart/form-data; boundary={edge}"


def beside(port: int, work: Callable[[], str]) -> str:
    """A piece of work, and how long a small photo takes that is sent while it is done."""
    said: list[str] = []
    thread = threading.Thread(target=lambda: said.append(work()))
    thread.start()
    time.sleep(0.5)
    light = post(port, "/v1/photo", png(64))
    thread.join()
    return f"{said[0]}; a small photo beside it: {light}"


def against(work: Callable[[int], str], *options: str) -> str:
    with server(*options) as (port, watch, _):
        said = beside(port, lambda: work(port))
        return f"{watch.end()}  {said}"


@case("1 multi-part EXR at /v1/photo")
def _(folder: Path) -> str:
    data = multipart_exr(64, 16000)
    return against(lambda port: post(port, "/v1/photo", data))


@case("1 hidden .hdr at /v1/export/cube")
def _(folder: Path) -> str:
    data = hidden_hdr(8192, 16384)
    return against(lambda port: post(port, "/v1/export/cube", data))


@case("1 hidden .hdr as surroundings")
def _(folder: Path) -> str:
    body, kind = form(("photo", png(64)), ("surroundings", hidden_hdr(6000, 12000)))
    return against(lambda port: post(port, "/v1/estimate", body, kind))


@case("2 TIFF of 90,000 directories")
def _(folder: Path) -> str:
    return reading(folder, "a.tif", endless_tiff(90_000), IMAGE)


@case("2 JPEG of 2,000 scans")
def _(folder: Path) -> str:
    return reading(folder, "a.jpg", endless_jpeg(2000, 2000), IMAGE)


@case("2 GIF of 200,000 frames")
def _(folder: Path) -> str:
    return reading(folder, "a.gif", endless_gif(200_000), IMAGE)


@case("2 GLB of 200,000 nodes")
def _(folder: Path) -> str:
    return reading(folder, "a.glb", instanced_glb(200_000), MESH)


@case("2 PNG of 3,000,000 x 32")
def _(folder: Path) -> str:
    stream = io.BytesIO()
    Image.new("RGBA", (3_000_000, 32), (200, 100, 50, 255)).save(stream, format="PNG")
    return reading(folder, "a.png", stream.getvalue(), IMAGE)


@case("2 export of a 16k .hdr")
def _(folder: Path) -> str:
    (folder / "a.hdr").write_bytes(hidden_hdr(8192, 16384))
    return run([*COMMAND, "export", str(folder / "a.hdr"), "--to", "unity", "-o", str(folder / "out")])


@case("3 300 half-open heads, 256 descriptors")
def _(folder: Path) -> str:
    with server(descriptors=256) as (port, watch, log):
        lines = []
        for _ in range(300):
            with contextlib.suppress(OSError):
                line = socket.create_connection(("127.0.0.1", port), timeout=5)
                line.sendall(b"GET / HTTP/1.1\r\nHost:")
                lines.append(line)
        time.sleep(12)
        health = post(port, "/healthz", b"", method="GET")
        written = log.stat().st_size / 2**20
        for line in lines:
            line.close()
        return f"{watch.end()}  /healthz {health}; log {written:.1f} MB"


@case("3 32 slow bodies")
def _(folder: Path) -> str:
    with server("--workers", "2") as (port, watch, _):
        lines = []
        for _ in range(40):
            line = socket.create_connection(("127.0.0.1", port), timeout=5)
            line.sendall(b"POST /v1/photo HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100000\r\n\r\nx")
            lines.append(line)
        time.sleep(3)
        start, answer = time.monotonic(), ""
        while time.monotonic() - start < PATIENCE and not answer.startswith("200"):
            answer = post(port, "/v1/photo", png(64))
        for line in lines:
            line.close()
        return f"{watch.end()}  a photo is taken after {time.monotonic() - start:.1f} s ({answer[:3]})"


@case("4 a PNG behind six EXRs")
def _(folder: Path) -> str:
    import OpenEXR

    noise = np.random.default_rng(0).random((4900, 4900), np.float32).astype(np.float16)
    stream = folder / "a.exr"
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": noise}).write(str(stream))
    data = stream.read_bytes()[: 31 * 2**20]
    with server("--workers", "2", "--max-mb", "64") as (port, watch, _):
        threads = [threading.Thread(target=post, args=(port, "/v1/photo", data)) for _ in range(6)]
        for thread in threads:
            thread.start()
        time.sleep(1.0)
        light = post(port, "/v1/photo", png(64))
        for thread in threads:
            thread.join()
        return f"{watch.end()}  PNG {light}"


@case("5 mesh that names /etc/passwd")
def _(folder: Path) -> str:
    return reading(folder, "a.glb", instanced_glb(1, uri="/etc/passwd"), MESH)


def clip(folder: Path, *changes: tuple[bytes, bytes]) -> bytes:
    import av

    path = folder / "made.mp4"
    with av.open(str(path), "w", options={"movflags": "use_metadata_tags"}) as container:
        container.metadata["title"] = "caf\xe9XX"
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        for shade in range(3):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), 80 * shade, np.uint8), format="rgb24")
            container.mux(stream.encode(frame.reformat(format="yuv420p")))
        container.mux(stream.encode())
    data = path.read_bytes()
    for old, new in changes:
        data = data.replace(old, new)
    return data


VIDEO = "from anyprobe.video.clip import *; from pathlib import Path; list(read_frames(open_clip(Path(PATH)), []))"


@case("6 MP4 with a Latin-1 title")
def _(folder: Path) -> str:
    return reading(folder, "a.mp4", clip(folder, ("caf\xe9XX".encode(), b"caf\xe9XXX")), VIDEO)


@case("6 MP4 of an unknown codec")
def _(folder: Path) -> str:
    return reading(folder, "a.mp4", clip(folder, (b"avc1", b"zzzz")), VIDEO)


@case("6 EXR with text in Latin-1")
def _(folder: Path) -> str:
    return reading(folder, "a.exr", exr(comments="abXX").replace(b"abXX", b"\xe9\xff\xfeX"), IMAGE)


def exr(**header: object) -> bytes:
    import OpenEXR

    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        told = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
        OpenEXR.File(told, {name: np.ones((64, 64), np.float32) for name in "RGB"}).write(file.name)
        return Path(file.name).read_bytes()


@case("7 OBJ of two columns")
def _(folder: Path) -> str:
    return reading(folder, "a.obj", "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", MESH)


@case("7 .npy with a broken header")
def _(folder: Path) -> str:
    stream = io.BytesIO()
    np.save(stream, np.ones((8, 8, 3), np.float32))
    data = stream.getvalue().replace(b"'shape'", b"'sh\xffpe'")
    call = "from anyprobe.estimate.normals_hint import read_normals; read_normals(PATH, (8, 8))"
    return reading(folder, "a.npy", data, call)


@case("7 sidecar with a number of 400 digits")
def _(folder: Path) -> str:
    code = (
        "import json, numpy as np, anyprobe; from pathlib import Path; p = Path(PATH).with_suffix('.exr'); "
        "anyprobe.Light(radiance=np.ones((8, 16, 3), np.float32)).save(p); s = p.with_suffix('.json'); "
        "anyprobe.Light(radiance=np.ones((8, 16, 3), np.float32)).save(s); said = json.loads(s.read_text()); "
        "key = 'told' if 'told' in said else 'well_exposed_fraction'; said[key] = 7; "
        "s.write_text(json.dumps(said).replace('\"%s\": 7' % key, '\"%s\": ' % key + '9' * 400)); "
        "anyprobe.Light.load(p)"
    )
    return reading(folder, "a.txt", "", code)


@case("7 EXR chromaticities that are text")
def _(folder: Path) -> str:
    return reading(folder, "a.exr", exr(chromaticitiez="red").replace(b"aticitiez", b"aticities"), IMAGE)


@case("7 --poses /dev/zero")
def _(folder: Path) -> str:
    (folder / "a.png").write_bytes(png(64))
    return run([*COMMAND, "estimate", str(folder / "a.png"), "--poses", "/dev/zero", "-o", str(folder / "o")], 20)


GUEST = """
import io, sys, threading, warnings, os, time
from anyprobe.pictures.images import read_image
data = open({path!r}, "rb").read()
{body}
"""


def guest(folder: Path, data: bytes, body: str, patience: float | None = None) -> str:
    (folder / "guest").write_bytes(data)
    return python(GUEST.format(path=str(folder / "guest"), body=body), patience)


@case("8 filters of warnings after threads")
def _(folder: Path) -> str:
    return guest(
        folder,
        png(64),
        """
before = list(warnings.filters)
threads = [threading.Thread(target=lambda: [read_image(data) for _ in range(60)]) for _ in range(8)]
[t.start() for t in threads]; [t.join() for t in threads]
print("left as they were" if warnings.filters == before else "CHANGED: " + str(warnings.filters[0][0]))
""",
    )


@case("8 other threads' lines beside .exr")
def _(folder: Path) -> str:
    return guest(
        folder,
        exr(),
        """
kept = sys.stdout
class Counts(io.StringIO):
    lines = 0
    def write(self, text):
        Counts.lines += text.count(chr(10))
sys.stdout = Counts()
stop = threading.Event()
thread = threading.Thread(target=lambda: [read_image(data) for _ in iter(stop.is_set, True)])
thread.start()
for _ in range(3000):
    print("line"); time.sleep(0.0003)
stop.set(); thread.join()
kept.write(f"{3000 - Counts.lines} of 3000 lines lost\\n")
""",
    )


@case("8 fork while a thread reads")
def _(folder: Path) -> str:
    return guest(
        folder,
        exr(),
        """
warnings.simplefilter("ignore")
stop = threading.Event()
thread = threading.Thread(target=lambda: [read_image(data) for _ in iter(stop.is_set, True)])
thread.start()
hung = 0
for _ in range(30):
    child = os.fork()
    if not child:
        read_image(data); os._exit(0)
    until = time.monotonic() + 30
    while os.waitpid(child, os.WNOHANG) == (0, 0):
        if time.monotonic() > until:
            hung += 1; os.kill(child, 9); os.waitpid(child, 0); break
        time.sleep(0.005)
stop.set(); thread.join()
print(f"{hung} of 30 hang")
""",
        PATIENCE * 3,
    )


@case("9 damaged EXR, --json")
def _(folder: Path) -> str:
    data = bytearray(exr())
    data[-300:] = b"\x55" * 300
    (folder / "a.exr").write_bytes(bytes(data))
    command = [*COMMAND, "estimate", str(folder / "a.exr"), "--json", "-o", str(folder / "o")]
    return run(
        command, show=lambda out, err: f"{len(out.splitlines())} lines on stdout, {len(err.splitlines())} on stderr"
    )


@case("10 a FIFO as photo")
def _(folder: Path) -> str:
    os.mkfifo(folder / "pipe")
    return run([*COMMAND, "estimate", str(folder / "pipe"), "-o", str(folder / "o")])


@case("10 HEAD /, and two photos in one request")
def _(folder: Path) -> str:
    body, kind = form(("photo", png(64)), ("photo", png(96)))
    with server() as (port, watch, _):
        head = post(port, "/", b"", method="HEAD")
        twice = post(port, "/v1/photo", body, kind)
        return f"{watch.end()}  HEAD {head[:3]}, two photos {twice[:3]}"


@case("10 a stranger at 0.0.0.0")
def _(folder: Path) -> str:
    with server("--host", "0.0.0.0") as (port, watch, log):
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
        line.request("POST", "/v1/photo", png(64), {"Host": "rebound.example"})
        foreign = line.getresponse().status
        token = re.search(r"token=([\w-]+)", log.read_text())
        said = f"foreign host {foreign}, no token {post(port, '/v1/photo', png(64))[:3]}"
        return f"{watch.end()}  {said}, token {'printed' if token else 'none'}"


@case("10 a folder left by kill -9")
def _(folder: Path) -> str:
    code = """
import os, signal, sys
from pathlib import Path
from anyprobe.files.atomic import atomic_files
folder = Path(sys.argv[1])
if os.fork() == 0:
    with atomic_files(folder):
        os.kill(os.getpid(), signal.SIGKILL)
os.wait()
with atomic_files(folder):
    pass
print(len(list(folder.glob(".anyprobe-*"))), "left after the next run")
"""
    return run([sys.executable, "-c", code, str(folder / "out")])


def main() -> None:
    global PATIENCE
    asked = argparse.ArgumentParser(prog="python -m tests.fuzz.reproductions", description=__doc__.splitlines()[0])
    asked.add_argument("--only", default="", help="cases whose name has this")
    asked.add_argument("--patience", type=float, default=PATIENCE)
    given = asked.parse_args()
    PATIENCE = given.patience
    for name, function in CASES.items():
        if given.only in name:
            start = time.monotonic()
            with tempfile.TemporaryDirectory() as folder:
                try:
                    said = function(Path(folder))
                except Exception as error:
                    said = f"could not be run: {type(error).__name__}: {error}"
            print(f"{name:42} wall {time.monotonic() - start:6.1f} s  {said}", flush=True)


if __name__ == "__main__":
    main()
