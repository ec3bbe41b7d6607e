"""A polite HTTP client: one request at a time, a pause between two, patience with a busy server.

Nothing counts as there before its MD5 agrees. Standard library only.
"""

import hashlib
import http.client
import json
import ssl
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable

from anyprobe import __version__
from anyprobe.errors import AnyprobeError

USER_AGENT = f"anyprobe/{__version__} (anyprobe_train.assets)"
"""Poly Haven's terms ask for one that names the software."""

PAUSE_S = 0.5
"""Between the end of one request and the start of the next."""

TIMEOUT_S = 30.0
"""Without a byte from the server."""

ATTEMPTS = 5
"""In a row; then the file fails."""

BACKOFF_S = 1.0
"""Wait before the second attempt; it doubles, up to MAX_BACKOFF_S, unless the server says how long."""

MAX_BACKOFF_S = 60.0

MAX_WAIT_S = 300.0
"""A server that asks for more patience than this is left alone: ServerBusy."""


class DownloadError(AnyprobeError):
    """A page or file that could not be had; others may."""


class ServerBusy(DownloadError):
    """The server asks for a long pause: no further requests are made."""


class _Transient(Exception):
    """Worth another attempt, after `wait_s` seconds if the server named a time."""

    def __init__(self, reason: str, wait_s: float | None = None) -> None:
        super().__init__(reason)
        self.wait_s = wait_s


Fetch = tuple[str, Callable[[], str]]
"""The name of a file, and what fetches it and says its status: fetched, complete (it was there), kept (a file of the
user's), or cannot be had, and after a colon why. It may raise an AnyprobeError; after ServerBusy no other file is to be
asked for."""


class Client:
    """Fetches JSON and files, never two at once; `say` hears why it waits."""

    def __init__(self, *, pause_s: float = PAUSE_S, say: Callable[[str], None] = lambda text: None) -> None:
        self._pause_s = pause_s
        self._say = say
        self._free_at = 0.0

    def get_json(self, url: str) -> dict:
        """Return the JSON object at a URL.

        Raises:
            DownloadError: there is none, or the server does not answer.
        """
        body = self._patiently(url)
        try:
            answer = json.loads(body)
        except (ValueError, RecursionError):
            answer = None
        if not isinstance(answer, dict):
            start = body[:40].decode("utf-8", "replace")
            raise DownloadError(
                f"{url}: expected a JSON object, got {start!r}...; is something between you and the server?"
            )
        return answer

    def download(self, url: str, md5: str) -> bytes:
        """Return a file, whose MD5 agrees with its publisher's.

        Raises:
            DownloadError: it cannot be had, or has the wrong MD5 twice.
        """
        for _ in range(2):
            body = self._patiently(url)
            found = md5_of(body)
            if found == md5:
                return body
        raise DownloadError(f"{url}: expected MD5 {md5}, got {found}, twice; tell the publisher")

    def _get(self, url: str) -> bytes:
        """Return the body of a response of status 200; trouble that may pass becomes _Transient."""
        headers = {"User-Agent": USER_AGENT, "Accept-Encoding": "identity"}
        if not url.startswith(("http://", "https://")):
            raise DownloadError(f"{url}: expected a http or https address")
        time.sleep(max(0.0, self._free_at - time.monotonic()))
        try:
            quoted = urllib.parse.quote(url, safe="%/:?#[]@!$&'()*+,;=~")
            request = urllib.request.Request(quoted, headers=headers)
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as response:
                return response.read()
        except urllib.error.HTTPError as error:
            with error:
                if error.code in (408, 425, 429) or error.code >= 500:
                    seconds = (error.headers.get("Retry-After") or "").strip()
                    wait_s = float(seconds) if seconds.isdecimal() else None
                    raise _Transient(f"HTTP {error.code} {error.reason}", wait_s) from error
                raise DownloadError(f"{url}: HTTP {error.code} {error.reason}") from error
        except (http.client.InvalidURL, ValueError) as error:  # not an address; no second try
            raise DownloadError(f"{url}: expected an address ({error})") from error
        except (OSError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", error)
            if isinstance(reason, ssl.SSLCertVerificationError):
                raise DownloadError(f"{url}: the certificate is not trusted ({reason})") from error
            raise _Transient(str(reason) or type(reason).__name__) from error
        finally:
            self._free_at = time.monotonic() + self._pause_s

    def _patiently(self, url: str) -> bytes:
        """Try until it works, at most ATTEMPTS times."""
        failures = 0
        while True:
            try:
                return self._get(url)
            except _Transient as trouble:
                failures += 1
                if failures == ATTEMPTS:
                    raise DownloadError(f"{url}: {trouble}, {ATTEMPTS} times in a row; try later") from trouble
                wait_s = trouble.wait_s
                if wait_s is None:
                    wait_s = min(BACKOFF_S * 2 ** (failures - 1), MAX_BACKOFF_S)
                if wait_s > MAX_WAIT_S:
                    raise ServerBusy(
                        f"{url}: {trouble}, and the server asks to wait {wait_s:.0f} s; "
                        "run the same command then, it goes on where it stopped"
                    ) from trouble
                self._say(f"{url}: {trouble}; again in {wait_s:.0f} s")
                time.sleep(wait_s)


def md5_of(data: bytes) -> str:
    """MD5 in hexadecimal."""
    return hashlib.md5(data, usedforsecurity=False).hexdigest()
