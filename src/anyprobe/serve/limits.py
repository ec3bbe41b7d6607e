"""Limits of requests, listed in docs/reference/security.md."""

from dataclasses import dataclass

MAX_CONNECTIONS = 512
"""Largest number of connections; beyond it 503."""

IDLE_S = 5
"""Time that a connection without a request is kept open [s]."""

UNREAD_S = 5.0
"""Time for which the body of a refused request is still received [s]."""

MAX_PHOTOS = 16
"""Largest number of photos in one request."""

MAX_MAP_ROWS = 512
"""Largest map that is exported [rows]: a cube of it takes 5 seconds; ours have 64 rows."""

MAX_SENT_SIDECAR_BYTES = 16 * 2**20
"""Largest .json of a map that is exported [bytes]; ours have one with radiance, stages and mask."""

MAX_PANORAMA_PIXELS = 8_500_000
"""Largest panorama of surroundings [pixels]; it is reduced to 128 x 64."""

QUICK_BYTES = 16 * 2**20
"""Largest total size of JPEG, PNG and WebP files that decode quickly [bytes]."""

MAX_CALLS = 500
"""Pieces of work after which a decoding process is replaced: libraries leak."""

DRAIN_S = 8.0
"""Time for running work when the server is stopped [s]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Limits:
    """Bounds that keep memory flat and answers prompt.

    Attributes:
        max_bytes: largest body of a request; beyond it 413.
        max_pixels: largest photo or mask, judged by its header before it is decoded; beyond it 413.
        workers: photos computed at the same time.
        waiting: requests that may wait for a worker, those whose body is arriving included; beyond them 429.
        upload_s: seconds in which a body must have arrived; later it is 408.
        retry_after_s: what a 429 asks for.
        quick_s: seconds, usually 1 to 3, for decoding a JPEG, PNG or WebP and finding its object; one that takes
            longer is tried again with the slow formats.
        decode_s: seconds for decoding any file, and for an export; beyond them 422.
        decode_mb: memory for that, beyond the idle process's own; beyond it 422.
    """

    max_bytes: int = 32 * 2**20
    max_pixels: int = 25_000_000
    workers: int = 2
    waiting: int = 30
    upload_s: float = 60.0
    retry_after_s: int = 1
    quick_s: float = 20.0
    decode_s: float = 40.0
    decode_mb: int = 900

    @property
    def places(self) -> int:
        """Requests that are taken at the same time."""
        return self.workers + self.waiting
