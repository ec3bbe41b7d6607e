"""A bounded number of workers: who comes too many is sent away at once, who leaves is not computed."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import TypeVar

from anyprobe.serve.limits import Limits

Answer = TypeVar("Answer")


class Busy(Exception):
    """Every worker and every place in the queue is taken."""


class Cancelled(Exception):
    """Whoever asked is gone; the work stops at its next step."""


class Job:
    """What a piece of work holds to ask whether it is still wanted; shared between threads."""

    def __init__(self) -> None:
        self._gone = threading.Event()

    def cancel(self) -> None:
        self._gone.set()

    @property
    def cancelled(self) -> bool:
        return self._gone.is_set()

    def step(self) -> None:
        """Called between the steps of the work.

        Raises:
            Cancelled: nobody waits for the answer any more.
        """
        if self.cancelled:
            raise Cancelled


class WorkerPool:
    """Threads around the networks, which let go of Python's lock while they compute."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._threads = ThreadPoolExecutor(limits.workers, thread_name_prefix="anyprobe")
        self._taken = 0

    @property
    def taken(self) -> int:
        """Requests that hold a place now."""
        return self._taken

    @asynccontextmanager
    async def place(self) -> AsyncIterator[None]:
        """Hold a place in the queue: from before the body is read until the answer is made.

        Raises:
            Busy: there is none.
        """
        if self._taken >= self._limits.workers + self._limits.waiting:
            raise Busy
        self._taken += 1
        try:
            yield
        finally:
            self._taken -= 1

    async def run(self, work: Callable[[Job], Answer], gone: Callable[[], Awaitable[None]]) -> Answer:
        """Compute work(job) in a thread, unless gone() returns first.

        The place is held until a started step has ended, so that those who leave and
        come again cannot pile up work.

        Raises:
            Cancelled: gone() returned; what waited is dropped, what ran stops at its next step.
        """
        job = Job()
        future = asyncio.get_running_loop().run_in_executor(self._threads, _run, work, job)
        leaving = asyncio.ensure_future(gone())
        try:
            await asyncio.wait({future, leaving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            leaving.cancel()
            if not future.done():
                job.cancel()
        return await asyncio.shield(future)

    def close(self) -> None:
        """Let the running work end; drop what waits."""
        self._threads.shutdown(wait=True, cancel_futures=True)


def _run(work: Callable[[Job], Answer], job: Job) -> Answer:
    job.step()  # whoever left while waiting costs nothing
    return work(job)
