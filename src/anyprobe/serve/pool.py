"""Processes that decode untrusted files, limited in memory and time, and threads that compute.

A damaged or hostile file may end a process, but not the server. The limits bound what a file can use; they are no
sandbox: the processes run as the same user and may open the same files.
"""

import asyncio
import logging
import multiprocessing
import os
from collections.abc import Awaitable, Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any, TypeVar

from pebble import ProcessExpired, ProcessPool

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.serve.limits import MAX_CALLS, Limits
from anyprobe.serve.tasks import ready

Answer = TypeVar("Answer")
Gone = Callable[[], Awaitable[object]]
"""Returns once the client has left."""

log = logging.getLogger("anyprobe.serve")


class Cancelled(Exception):
    """The client is gone."""


class WorkerPool:
    """Places in the queue, threads that compute, and processes that decode.

    Decoding has two lanes, so that a plain photo never waits behind a file that takes seconds.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._threads = ThreadPoolExecutor(limits.workers, thread_name_prefix="anyprobe")
        quick, slow = self._lane(limits.workers, niceness=0), self._lane(max(1, limits.workers // 2), niceness=5)
        self._lanes = {"quick": quick, "slow": slow}
        self._warming: list[Future[None]] = []
        self.taken = 0
        """Requests that hold a place now."""

    def _lane(self, workers: int, niceness: int) -> ProcessPool:
        context, given = multiprocessing.get_context("spawn"), (self._limits.decode_mb, niceness)
        return ProcessPool(workers, MAX_CALLS, initializer=_begin, initargs=given, context=context)

    @property
    def is_full(self) -> bool:
        """Whether every worker and every place in the queue is taken."""
        return self.taken >= self._limits.places

    async def decode(self, task: Callable[[], Answer], quick: bool, gone: Gone) -> Answer:
        """Run a function of serve.tasks, with its arguments bound, in a process.

        Raises:
            AnyprobeError: as the function does. InputError: ended for time or memory. Cancelled: gone() returned.
        """
        if quick:
            with suppress(TimeoutError):
                return await self._in_process("quick", task, self._limits.quick_s, gone)
        try:
            return await self._in_process("slow", task, self._limits.decode_s, gone)
        except TimeoutError as error:
            raise InputError(
                f"expected a file that is decoded within {self._limits.decode_s:g} seconds, got a slower one; "
                "send it smaller, or as PNG or JPEG"
            ) from error

    async def _in_process(self, lane: str, task: Callable[[], Answer], seconds: float, gone: Gone) -> Answer:
        """Run a task; once more, if its process ended, as the system may have ended it for others' sake."""
        for _ in range(2):
            try:
                future = self._lanes[lane].schedule(_guarded, args=(task,), timeout=seconds)
                return await _unless(gone, asyncio.wrap_future(future))
            except ProcessExpired as error:
                log.warning("a decoding process ended (%s)", error)
        raise InputError(
            "expected a file that can be decoded here, got one that needs too much memory; "
            "send it smaller, or as PNG or JPEG"
        )

    async def run(self, work: Callable[[], Answer], gone: Gone) -> Answer:
        """Compute in a thread; Cancelled if gone() returns first: what waited is then dropped."""
        return await _unless(gone, asyncio.get_running_loop().run_in_executor(self._threads, work))

    def warm(self) -> None:
        """Start the processes in the background; `unready` reports when they are ready."""
        self._warming = [lane.schedule(ready) for lane in self._lanes.values()]

    def unready(self) -> str:
        """Return why a photo would be refused now; "" if it would be accepted."""
        if any(not future.done() for future in self._warming):
            return "the decoding processes are starting"
        return "all places are taken" if self.is_full else ""

    def close(self) -> None:
        """End all processes, and drop waiting work."""
        for lane in self._lanes.values():
            lane.stop()
        self._threads.shutdown(wait=False, cancel_futures=True)
        for lane in self._lanes.values():
            lane.join()


async def _unless(gone: Gone, future: asyncio.Future[Answer]) -> Answer:
    leaving: asyncio.Future[Any] = asyncio.ensure_future(gone())
    waited: list[asyncio.Future[Any]] = [future, leaving]
    try:
        await asyncio.wait(waited, return_when=asyncio.FIRST_COMPLETED)
        if not future.done():
            raise Cancelled
        return future.result()
    finally:
        leaving.cancel()
        future.cancel()


# In the process itself


def _begin(memory_mb: int, niceness: int) -> None:
    """Prepare a process: silence C libraries, give way to others, limit memory to what it has now plus memory_mb."""
    null = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(null, number)
    with suppress(AttributeError, OSError):
        os.nice(niceness)
    with suppress(ImportError, OSError, ValueError):  # systems without such limits
        import resource

        with open("/proc/self/statm", encoding="ascii") as stream:
            used = int(stream.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory_mb * 2**20,) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _guarded(task: Callable[[], Answer]) -> Answer:
    try:
        return task()
    except Exception as error:
        is_ours = isinstance(error, AnyprobeError) and isinstance(error.__cause__, MemoryError)
        if is_ours or isinstance(error, MemoryError) or "bad_alloc" in str(error):
            text = "expected a file that fits in memory when decoded, got a larger one; send it smaller"
            raise InputError(text) from None
        raise
