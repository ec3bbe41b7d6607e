"""A hundred clients at a server of its own for a minute: what is answered, how fast, in what memory.

    python benchmarks/serve_load.py [--clients 100] [--seconds 60 | --requests 10000] [--workers 2] [--json]

Every client posts the same photo, waits for the answer, and posts again; told 429, it waits as long
as Retry-After says and posts the same request once more. A request is lost if it ends by anything
but 200 after that, or not at all. Memory is the server's and its decoding processes' together.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import re
import socket
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from measure import cpu_model, used_s

PHOTO = Path(__file__).parents[1] / "examples" / "vase.png"
MEMORY_EVERY_S = 1.0
WARM_SHARE = 0.25
"""Of the time, after which memory must not grow any more."""


@dataclass(kw_only=True)
class Tally:
    """What the clients saw."""

    answered: int = 0
    lost: int = 0
    told_to_wait: int = 0
    statuses: Counter = field(default_factory=Counter)
    seconds: list[float] = field(default_factory=list)
    """From the first attempt of a request to its answer."""


@dataclass(frozen=True, kw_only=True)
class Question:
    """What every client posts."""

    path: str
    kind: str
    body: bytes


def own_question(photo: Path) -> Question:
    edge, head = "one-part-after-another", 'Content-Disposition: form-data; name="photo"; filename="photo"'
    body = f"--{edge}\r\n{head}\r\n\r\n".encode() + photo.read_bytes() + f"\r\n--{edge}--\r\n".encode()
    return Question(path="/v1/estimate", kind=f"multipart/form-data; boundary={edge}", body=body)


async def post(port: int, asked: Question) -> tuple[int, dict[str, str]]:
    """One request on a line of its own: status and headers."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        head = (
            f"POST {asked.path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(asked.body)}\r\n"
            f"Content-Type: {asked.kind}\r\nConnection: close\r\n\r\n"
        )
        writer.write(head.encode() + asked.body)
        await writer.drain()
        answer = await reader.read()
    finally:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()
    head, _, _ = answer.partition(b"\r\n\r\n")
    first, *lines = head.decode("latin-1").split("\r\n")
    headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    return int(first.split()[1]), headers


async def client(port: int, asked: Question, until: float, requests: int, tally: Tally) -> None:
    """Requests one after the other until the time is up or all are answered; the last one is waited for."""
    while time.monotonic() < until and sum(tally.statuses.values()) < requests:
        start = time.monotonic()
        try:
            status, headers = await post(port, asked)
            while status == 429:
                tally.told_to_wait += 1
                await asyncio.sleep(float(headers["retry-after"]))
                status, headers = await post(port, asked)
        except (OSError, IndexError, ValueError):
            status = 0
        tally.statuses[status] += 1
        if status == 200:
            tally.answered += 1
            tally.seconds.append(time.monotonic() - start)
        else:
            tally.lost += 1


def held_mb(pid: int) -> float:
    """Memory that a process and those below it hold, what they share counted once [MB]; needs Linux's /proc."""
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
    own = int(re.search(r"^Pss: +([0-9]+) kB", rollup, re.MULTILINE).group(1)) * 1024 / 1e6
    threads = Path(f"/proc/{pid}/task").iterdir()
    children = [int(one) for task in threads for one in (task / "children").read_text().split()]
    return own + sum(map(held_mb, children))


async def watch(pid: int, held: list[tuple[float, float]]) -> None:
    start = time.monotonic()
    while True:
        with contextlib.suppress(OSError):  # a process that ends while it is looked at
            held.append((time.monotonic() - start, held_mb(pid)))
        await asyncio.sleep(MEMORY_EVERY_S)


async def load(
    port: int, pid: int, asked: Question, clients: int, seconds: float, requests: int
) -> tuple[Tally, list[tuple[float, float]], float]:
    tally, held = Tally(), []
    watching = asyncio.create_task(watch(pid, held))
    start = time.monotonic()
    await asyncio.gather(*(client(port, asked, start + seconds, requests, tally) for _ in range(clients)))
    watching.cancel()
    return tally, held, time.monotonic() - start


@contextlib.contextmanager
def server(*command: str):
    """A server on a free port, which is appended to its command, once it answers: (port, process id)."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen([*command, str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(9000):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                break
            time.sleep(0.1)
        yield port, process.pid
    finally:
        process.terminate()
        process.wait(20)


def measured(command: list[str], asked: Question, given: argparse.Namespace) -> dict[str, object]:
    """Run a server under its clients; the first photo, which opens networks, is not counted."""
    with server(*command) as (port, pid):
        asyncio.run(post(port, asked))
        seconds, requests = (given.seconds, 10**9) if given.requests is None else (1e9, given.requests)
        before = used_s(pid)
        tally, held, took = asyncio.run(load(port, pid, asked, given.clients, seconds, requests))
        used = used_s(pid) - before
    warm = np.array([mb for second, mb in held if second > WARM_SHARE * took])
    return {
        "seconds": round(took, 1),
        "answered": tally.answered,
        "lost": tally.lost,
        "per_second": round(tally.answered / took, 2),
        "core_s_a_photo": round(used / max(tally.answered, 1), 3),
        "told_to_wait": tally.told_to_wait,
        "median_s": round(float(np.median(tally.seconds)), 2),
        "p99_s": round(float(np.percentile(tally.seconds, 99)), 2),
        "memory_mb_at_quarter": round(float(warm[0])),
        "memory_mb_at_end": round(float(warm[-1])),
        "memory_mb_most": round(float(max(mb for _, mb in held))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clients", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--requests", type=int, default=None, help="so many in all, however long they take")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--photo", type=Path, default=PHOTO)
    parser.add_argument("--json", action="store_true", help="one object instead of lines")
    given = parser.parse_args()
    program = str(Path(sys.executable).with_name("anyprobe"))
    result = {
        "cpu": cpu_model(),
        "cores": len(os.sched_getaffinity(0)),
        "clients": given.clients,
        "photo": given.photo.name,
        "workers": given.workers,
        **measured([program, "serve", "--workers", str(given.workers), "--port"], own_question(given.photo), given),
    }
    print(json.dumps(result) if given.json else "\n".join(f"{key:22} {value}" for key, value in result.items()))


if __name__ == "__main__":
    main()
