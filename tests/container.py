"""Build the Dockerfile's image and run it as a careful operator would: python -m tests.container [--steps]

Where no builder is running, or with --steps, the Dockerfile's own steps are run here one by one instead, into a folder.
Root's process then runs the server as a container would: in a root of its own that cannot be written, as its user.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCKERFILE = ROOT / "Dockerfile"
PREFIX = "/opt/anyprobe"
END_S = 12.0
"""Seconds within which the server must have ended after SIGTERM."""
USER = 10001
IN_FLIGHT = 6
"""Requests at the time of SIGTERM."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One instruction of a Dockerfile."""

    word: str
    text: str

    def words(self) -> list[str]:
        """Return what it runs; a list where it is written as one."""
        return json.loads(self.text) if self.text.startswith("[") else shlex.split(self.text)


def read_steps(path: Path = DOCKERFILE) -> list[Step]:
    """Return a Dockerfile's instructions in order, lines that go on joined."""
    text = re.sub(r"\\\n\s*", "", path.read_text(encoding="utf-8"))
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [Step(word=word, text=rest.strip()) for word, _, rest in (line.partition(" ") for line in lines)]


def has_builder() -> bool:
    """Return whether docker can build here."""
    docker = shutil.which("docker")
    if docker is None:
        return False
    return not subprocess.run([docker, "info"], capture_output=True, check=False).returncode


def build_by_steps(folder: Path, python: str = sys.executable) -> Path:
    """Run the steps of the build in a folder; return what stands for PREFIX there."""
    source, prefix = folder / "source", folder / "anyprobe"
    source.mkdir()
    for step in read_steps():
        if step.word == "COPY" and not step.text.startswith("--from"):
            *names, place = step.words()
            for name in names:
                target = source / (name if place == "./" else place)
                if (ROOT / name).is_dir():
                    shutil.copytree(ROOT / name, target, ignore=shutil.ignore_patterns("__pycache__"))
                else:
                    shutil.copy(ROOT / name, target)
        if step.word == "RUN":
            order = step.text.replace(PREFIX, str(prefix))
            order = re.sub(r"^python ", f"{shlex.quote(python)} ", order)
            subprocess.run(order, shell=True, check=True, cwd=source)
    return prefix


def exec_words(prefix: Path) -> list[str]:
    """Return the image's command with its programs in a folder."""
    by_word = {step.word: step for step in read_steps()}
    return [str(prefix / "bin" / by_word["ENTRYPOINT"].words()[0]), *by_word["ENTRYPOINT"].words()[1:]]


ROOM = """
set -e
root=$1 prefix=$2 python=$3 user=$4
shift 4
mount -t tmpfs -o mode=755 tmpfs "$root"
for place in /usr /bin /lib /lib64 /etc "$python" "$prefix"; do
  if [ -L "$place" ]; then cp -P "$place" "$root$place"; continue; fi
  [ -d "$place" ] || continue
  mkdir -p "$root$place"
  mount -o bind,ro "$place" "$root$place"
done
mkdir -p "$root/proc" "$root/tmp" "$root/dev/shm"
mount -t proc proc "$root/proc"
mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm"
for name in null zero random urandom; do touch "$root/dev/$name"; mount --bind "/dev/$name" "$root/dev/$name"; done
mount -o remount,ro "$root"
exec chroot "$root" setpriv --reuid="$user" --regid="$user" --clear-groups --no-new-privs --bounding-set=-all \
  env -i PATH="$prefix/bin:/usr/bin:/bin" PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1 "$@"
"""
"""As a container's: a root of its own with the system, Python and the image's folder, where nothing but /dev/shm can be
written; no capability, no home, a user without an entry."""


def confined(words: list[str], room: Path, prefix: Path, python: str) -> list[str] | None:
    """Return a command in a root of its own; None where this process may not make one."""
    if os.geteuid() != 0 or not all(map(shutil.which, ("unshare", "chroot", "setpriv"))):
        return None
    room.mkdir(exist_ok=True)
    base = subprocess.run(
        [python, "-c", "import sys; print(sys.base_prefix)"], capture_output=True, text=True, check=True
    )
    order = ["unshare", "--mount", "sh", "-c", ROOM, "room", *map(str, (room, prefix, base.stdout.strip(), USER))]
    trial = "import os; print(os.getuid(), [p for p in '/ /tmp /etc /opt /dev'.split() if os.access(p, os.W_OK)])"
    tried = subprocess.run(
        [*order, str(prefix / "bin" / "python"), "-c", trial], capture_output=True, text=True, check=False
    )
    if tried.stdout.strip() != f"{USER} []":
        print(f"no root of its own can be made here: {tried.stdout.strip()} {tried.stderr.strip()[-300:]}")
        return None
    return [*order, *words]


@contextlib.contextmanager
def run_by_steps(folder: Path, port: int, python: str) -> Iterator[Callable[[], int]]:
    """Run the server as the image's user in a root that cannot be written; yields what ends it and says how."""
    prefix = build_by_steps(folder, python)
    words = [*exec_words(prefix), "--port", str(port), "--token", "none"]
    order = confined(words, folder / "room", prefix, python)
    print(
        "in a root of its own, read-only, as user 10001" if order else "as this user, in this machine's root: not root"
    )
    environment = {"PATH": f"{prefix}/bin:{os.environ['PATH']}", "PYTHONDONTWRITEBYTECODE": "1"}
    process = subprocess.Popen(order or words, cwd="/", env=environment)

    def end() -> int:
        process.send_signal(signal.SIGTERM)
        return process.wait(60)

    try:
        yield end
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def run_by_docker(port: int) -> Iterator[Callable[[], int]]:
    """Build the image, and run it with a root that cannot be written and a user that the image does not know."""
    subprocess.run(["docker", "build", "-t", "anyprobe-test", str(ROOT)], check=True)
    order = "docker run -d --read-only --cap-drop ALL --security-opt no-new-privileges --user 54321:54321".split()
    order += ["-p", f"127.0.0.1:{port}:8000", "anyprobe-test", "--host", "0.0.0.0", "--token", "none"]
    name = subprocess.run(order, check=True, capture_output=True, text=True).stdout.strip()

    def end() -> int:
        subprocess.run(["docker", "stop", "--time", "60", name], check=True, capture_output=True)
        wait = subprocess.run(["docker", "wait", name], check=True, capture_output=True, text=True)
        return int(wait.stdout)

    try:
        yield end
    finally:
        print(subprocess.run(["docker", "logs", name], capture_output=True, text=True, check=False).stderr[-2000:])
        subprocess.run(["docker", "rm", "-f", name], capture_output=True, check=False)


def check(port: int, end: Callable[[], int]) -> None:
    """Ask a running server for all that the documentation promises, then end it."""
    base = f"http://127.0.0.1:{port}"

    def ask(address: str, data: bytes | None = None) -> tuple[int, bytes]:
        try:
            edge = b"one-part-after-another"
            headers = {"Content-Type": f"multipart/form-data; boundary={edge.decode()}"}
            head = b'Content-Disposition: form-data; name="photo"; filename="photo"'
            body = None if data is None else b"--%b\r\n%b\r\n\r\n%b\r\n--%b--\r\n" % (edge, head, data, edge)
            asked = urllib.request.Request(f"{base}{address}", body, headers if data else {})
            with urllib.request.urlopen(asked, timeout=60) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()
        except OSError as error:  # cut off, when the server ended
            if data is None:
                raise
            return 0, str(error).encode()

    until = time.monotonic() + 120
    while True:
        try:
            if ask("/readyz")[0] == 200:
                break
        except OSError:
            pass
        assert time.monotonic() < until, "not ready within two minutes"
        time.sleep(0.2)
    photo = (ROOT / "examples" / "table.jpg").read_bytes()
    status, answer = ask("/v1/estimate", photo)
    assert status == 200, answer
    assert json.loads(answer)["mask"]["source"] == "network", answer
    assert not any("small mask network" in line for line in json.loads(answer)["warnings"]), "U2-Net-p is not in it"
    assert ask("/v1/estimate?format=exr", photo)[0] == 200
    assert b"anyprobe_requests_total" in ask("/metrics")[1]
    health = next(step for step in read_steps() if step.word == "HEALTHCHECK")
    words = json.loads(health.text.partition(" CMD ")[2])
    words = [word.replace("8000", str(port)) for word in words]
    subprocess.run([sys.executable, *words[1:]], check=True, timeout=10)
    with ThreadPoolExecutor(IN_FLIGHT) as clients:
        asked = [clients.submit(ask, "/v1/estimate", photo) for _ in range(IN_FLIGHT)]
        time.sleep(0.5)
        start = time.monotonic()
        status = end()
        took = time.monotonic() - start
        told = sorted(one.result()[0] for one in asked)
    assert took < END_S, f"ended after {took:.1f} s"
    assert set(told) <= {0, 200, 503}, told
    print(f"ready, asked, and ended {took:.1f} s after SIGTERM with status {status}; {IN_FLIGHT} in flight got {told}")


def main() -> None:
    """Run what can be run here."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", action="store_true", help="run the Dockerfile's steps here, without docker")
    parser.add_argument("--port", type=int, default=18765)
    parser.add_argument("--python", default=sys.executable, help="with --steps, in the place of the image's")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        by_docker = has_builder() and not given.steps
        print("built and run by docker" if by_docker else "no builder is used: the Dockerfile's steps, here")
        running = run_by_docker(given.port) if by_docker else run_by_steps(Path(folder), given.port, given.python)
        with running as end:
            check(given.port, end)


if __name__ == "__main__":
    main()
