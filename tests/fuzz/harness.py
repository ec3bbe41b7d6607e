"""Feed every parser mutated files for so long, or so many: python -m tests.fuzz --minutes 5.

An input is a find if it raises anything but an AnyprobeError, ends the process, or takes more than SECONDS of the
processor's time or MEMORY_MB of memory. Finds are made smaller and kept in tests/fuzz/finds/PARSER/.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import sys
import time
from pathlib import Path

from fuzz.mutate import mutated

FINDS = Path(__file__).parent / "finds"
SECONDS = 5.0
MEMORY_MB = 1500
BATCH = 500
FIRST = 50
"""Inputs of a parser's first process, so that every parser gets some on a busy machine too."""
HANGS_S = 120.0
"""Wall clock after which an input hangs, on a machine that others use too."""


def fault(call, data: bytes) -> str:
    """What is wrong with how an input was taken; empty where nothing is."""
    from anyprobe.errors import AnyprobeError

    start = time.process_time()
    try:
        call(data)
    except AnyprobeError as error:
        if "\n" in str(error):
            return "an error of several lines"
    except Exception as error:
        return f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
    took = time.process_time() - start
    return f"{took:.1f} s" if took > SECONDS else ""


def worker(name: str, seed: int, count: int, place: str, answers) -> None:
    """Feed one parser; the input at hand lies in a file, should it end the process."""
    import resource
    import warnings

    from fuzz.parsers import PARSERS

    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    warnings.simplefilter("ignore")
    parser, rng = PARSERS[name], random.Random(f"{name} {seed}")
    seeds = parser.seeds()
    for data in seeds:
        if found := fault(parser.call, data):
            answers.send((name, found, data))
    limit = MEMORY_MB * 2**20
    with open("/proc/self/statm", encoding="ascii") as stream:
        limit += int(stream.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    with open(place, "r+b", buffering=0) as kept:
        for _ in range(count):
            data = mutated(rng.choice(seeds), seeds, rng)
            kept.seek(0)
            kept.write(len(data).to_bytes(8, "little") + data)
            found = fault(parser.call, data)
            if found:
                answers.send((name, found, data))
    answers.send((name, None, count))


def smaller(name: str, data: bytes, found: str) -> bytes:
    """An input that raises the same with fewer bytes, as far as halving and leaving out finds one."""
    from fuzz.parsers import PARSERS

    kind, size = found.split(":")[0], len(data) // 2
    if not kind.endswith(("Error", "Exception", "Warning")):
        return data
    until = time.monotonic() + 20
    while size and time.monotonic() < until:
        at = 0
        while at < len(data) and time.monotonic() < until:
            shorter = data[:at] + data[at + size :]
            if fault(PARSERS[name].call, shorter).startswith(kind):
                data = shorter
            else:
                at += size
        size //= 2
    return data


def keep(name: str, found: str, data: bytes) -> Path:
    """A find as a file of its own."""
    import hashlib

    place = FINDS / name / f"{hashlib.sha256(data).hexdigest()[:12]}.bin"
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(data)
    print(f"{name}: {found}: {place}", flush=True)
    return place


def run_batch(name: str, seed: int, count: int) -> tuple[int, list[tuple[str, bytes]]]:
    """Inputs fed, and finds, of one process."""
    import tempfile

    context = multiprocessing.get_context("spawn")
    answers, theirs = context.Pipe(duplex=False)  # a queue would start a thread within the limit of memory
    with tempfile.NamedTemporaryFile() as kept:
        process = context.Process(target=worker, args=(name, seed, count, kept.name, theirs))
        process.start()
        theirs.close()
        finds, fed, last, since = [], 0, b"", time.monotonic()
        while True:
            if not answers.poll(1.0):
                now = Path(kept.name).read_bytes()
                since = since if now == last else time.monotonic()
                last = now
                if time.monotonic() - since > HANGS_S:
                    process.kill()
                continue
            try:
                _, found, data = answers.recv()
            except EOFError:
                break
            if found is None:
                fed += data
                break
            finds.append((found, data))
        process.join()
        if not fed:
            held = Path(kept.name).read_bytes()
            data = held[8 : 8 + int.from_bytes(held[:8], "little")]
            finds.append((f"ended by {process.exitcode}", data))
        return fed, finds


def main() -> int:
    asked = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__.splitlines()[0])
    asked.add_argument("--minutes", type=float, default=1.0)
    asked.add_argument("--inputs", type=int, default=None, help="so many inputs in all instead")
    asked.add_argument("--parser", action="append", help="only this one; may be given again")
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--batch", type=int, default=BATCH, help="inputs of one process")
    asked.add_argument("--keep-going", action="store_true", help="report one find of a kind, and go on")
    asked.add_argument("--progress", action="store_true", help="a line after each process")
    given = asked.parse_args()
    os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    os.environ["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    from fuzz.parsers import PARSERS

    names = given.parser or list(PARSERS)
    fed, seen, turn, start = dict.fromkeys(names, 0), set(), given.seed, time.monotonic()
    while True:
        done = sum(fed.values())
        late = time.monotonic() - start > 60 * given.minutes
        if (done >= given.inputs) if given.inputs else late:
            break
        name = min(names, key=lambda one: fed[one] / PARSERS[one].weight)
        turn += 1
        asked_for = given.batch if fed[name] else min(given.batch, FIRST)
        count, finds = run_batch(name, turn, asked_for)
        fed[name] += count or asked_for  # of a process that ended, about so many
        if given.progress:
            print(f"{sum(fed.values())} inputs, {len(seen)} kinds of finds", flush=True)
        for found, data in finds:
            kind = (name, found.split(":")[0])
            if kind not in seen or not given.keep_going:
                seen.add(kind)
                keep(name, found, smaller(name, data, found))
    result = {"inputs": sum(fed.values()), "seconds": round(time.monotonic() - start), "kinds of finds": len(seen)}
    print(json.dumps(result | {"by parser": fed}), flush=True)
    return 1 if seen else 0
