"""A bounded queue that refuses requests beyond its bound at once and drops those whose client has left."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from starlette.exceptions import HTTPException

from anyprobe.serve.limits import Limits
from anyprobe.serve.processes import Lane, TooSlow
from anyprobe.serve.tasks import ready

Answer = TypeVar("Answer")

log = logging.getLogger("anyprobe.serve")


class Busy(Exception):
    """Every worker and every place in the queue is taken."""


class Ending(Exception):
    """The server is shutting down; this work is dropped."""


class Cancelled(Exception):
    """The client is gone; the work stops at its next step."""


class Cancellation(threading.Event):
    """Event, shared between threads, that is set once the result of running work is no longer wanted."""

    def check(self) -> None:
        """Raise Cancelled if the client no longer waits; called between the steps of the work."""
        if self.is_set():
            raise Cancelled


@dataclass(kw_only=True, slots=True, eq=False)
class _Upload:
    """A body that is arriving: its timeout, its start, and how many bytes have come."""

    timeout: asyncio.Timeout
    since: float
    received: Callable[[], int]

    def rate(self) -> float:
        return self.received() / max(time.monotonic() - self.since, 1e-3)


class WorkerPool:
    """Places in the queue, threads that compute, and processes that decode.

    Decoding has two lanes, so that a plain photo never waits behind a file that takes seconds.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        slow = max(1, limits.workers // 2)
        self._threads = {
            "compute": ThreadPoolExecutor(limits.workers, thread_name_prefix="anyprobe"),
            "quick": ThreadPoolExecutor(limits.workers, thread_name_prefix="anyprobe-quick"),
            "slow": ThreadPoolExecutor(slow, thread_name_prefix="anyprobe-slow"),
        }
        self._lanes = {
            "quick": Lane(seconds=limits.quick_s, memory_mb=limits.decode_mb),
            "slow": Lane(seconds=limits.decode_s, memory_mb=limits.decode_mb, niceness=5),
        }
        self._uploads: list[_Upload] = []
        self._warming: list[Future] = []
        self._ends: asyncio.Event = asyncio.Event()
        self._is_draining = False
        self.taken = 0
        """Requests that hold a place now."""

    @asynccontextmanager
    async def place(self) -> AsyncIterator[None]:
        """Hold a place in the queue from before the body is read until the answer is ready.

        Raises:
            Busy: there is none. Ending: the server is shutting down.
        """
        if self._is_draining:
            raise Ending
        if self._is_full() and not await self._make_room():
            raise Busy
        self.taken += 1
        try:
            yield
        finally:
            self.taken -= 1

    def _is_full(self) -> bool:
        return self.taken >= self._limits.workers + self._limits.waiting

    async def _make_room(self) -> bool:
        """End the slowest body whose grace has passed, so that slow senders do not lock others out."""
        slow = [upload for upload in self._uploads if time.monotonic() - upload.since > self._limits.grace_s / 2]
        if not slow:
            return False
        slowest = min(slow, key=_Upload.rate)
        self._uploads.remove(slowest)
        slowest.timeout.reschedule(asyncio.get_running_loop().time())
        for _ in range(20):
            await asyncio.sleep(0.01)
            if not self._is_full():
                return True
        return False

    @asynccontextmanager
    async def upload(self, received: Callable[[], int]) -> AsyncIterator[None]:
        """Limit the time in which a body arrives; received: returns the bytes so far.

        Raises:
            HTTPException: 408, it was too slow, or others needed its place.
        """
        try:
            async with asyncio.timeout(self._limits.upload_s) as timeout:
                arriving = _Upload(timeout=timeout, since=time.monotonic(), received=received)
                self._uploads.append(arriving)
                try:
                    yield
                finally:
                    with contextlib.suppress(ValueError):
                        self._uploads.remove(arriving)
        except TimeoutError as error:
            raise HTTPException(
                408,
                f"expected the whole body within {self._limits.upload_s:g} seconds, or sooner if others wait, "
                "got a slower one; send a smaller photo",
                {"Connection": "close"},
            ) from error

    async def decode(self, task: Callable[[], Answer], quick: bool, gone: Callable[[], Awaitable[object]]) -> Answer:
        """Run a function of serve.tasks, with its arguments bound, in a process; raise what it and Lane.call raise."""
        if quick:
            try:
                return await self.run(lambda _: self._lanes["quick"].call(task), gone, "quick")
            except TooSlow:
                pass
        return await self.run(lambda _: self._lanes["slow"].call(task), gone, "slow")

    async def run(
        self, work: Callable[[Cancellation], Answer], gone: Callable[[], Awaitable[object]], kind: str = "compute"
    ) -> Answer:
        """Compute work(cancellation) in a thread, unless gone() returns first.

        The place is held until a started step has ended, so that clients that leave and come again cannot pile up work.

        Raises:
            Cancelled: gone() returned; what waited is dropped, what ran stops at its next step.
            Ending: the server is shutting down, and the time for running work is over.
        """
        cancellation = Cancellation()
        try:
            future = asyncio.get_running_loop().run_in_executor(self._threads[kind], _run, work, cancellation)
        except RuntimeError as error:  # the threads are shut down
            raise Ending from error
        leaving: asyncio.Future[Any] = asyncio.ensure_future(gone())
        ending = asyncio.ensure_future(self._ends.wait())
        try:
            await asyncio.wait([future, leaving, ending], return_when=asyncio.FIRST_COMPLETED)
        finally:
            leaving.cancel()
            ending.cancel()
            if not future.done():
                cancellation.set()
        if self._ends.is_set() and not future.done():
            # its error is read, so that asyncio does not log it as lost
            future.add_done_callback(lambda late: late.cancelled() or late.exception())
            raise Ending
        return await asyncio.shield(future)

    def warm(self) -> None:
        """Start a process of each kind in the background; `unready` reports when they are ready, or why not."""
        self._warming = [self._threads[name].submit(lane.call, ready) for name, lane in self._lanes.items()]
        for future in self._warming:
            future.add_done_callback(_log_fault)

    def unready(self) -> str:
        """Return why a photo would be refused now; "" if it would be accepted."""
        if self._is_draining:
            return "the server is shutting down"
        if any(not future.done() for future in self._warming):
            return "the decoding processes are starting"
        if any(future.cancelled() or future.exception() for future in self._warming):
            self.warm()
            return "the decoding processes cannot be started; see the log"
        if self._is_full():
            return "all places are taken"
        return ""

    def drain(self) -> None:
        """Accept nothing more and give running work limits.drain_s; called within the event loop."""
        self._is_draining = True
        asyncio.get_running_loop().call_later(self._limits.drain_s, self._ends.set)

    def close(self) -> None:
        """Let running work end, or after a drain only its current step; drop waiting work."""
        was_draining = self._is_draining  # then nobody waits for an answer any more
        for lane in self._lanes.values() if was_draining else ():
            lane.close()
        for threads in self._threads.values():
            threads.shutdown(wait=not was_draining, cancel_futures=True)
        for lane in self._lanes.values():
            lane.close()


def _log_fault(future: Future) -> None:
    if not future.cancelled() and (error := future.exception()) is not None:
        log.error("%s", error)


def _run(work: Callable[[Cancellation], Answer], cancellation: Cancellation) -> Answer:
    cancellation.check()  # whoever left while waiting costs nothing
    return work(cancellation)
