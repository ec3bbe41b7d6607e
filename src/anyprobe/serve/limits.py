"""What one server lets itself be asked for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Limits:
    """Bounds that keep memory flat and answers prompt.

    Attributes:
        max_bytes: largest body of a request; beyond it 413.
        max_pixels: largest photo or mask, judged by its header before it is decoded; beyond it 413.
        workers: photos computed at the same time.
        waiting: requests that may wait for a worker, read bodies included; beyond them 429.
        upload_s: seconds in which a body must have arrived; later it is 408.
        retry_after_s: what a 429 asks for.
    """

    max_bytes: int = 32 * 2**20
    max_pixels: int = 25_000_000
    workers: int = 2
    waiting: int = 30
    upload_s: float = 60.0
    retry_after_s: int = 1
