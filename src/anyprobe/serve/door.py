"""Limits that uvicorn lacks: on half-open requests, on connections, and on the length of the log.

Also a self-signed certificate: phones give a page their camera over https only.
"""

from __future__ import annotations

import asyncio
import datetime
import ipaddress
import logging
import math
import socket
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from anyprobe.errors import MissingExtra
from anyprobe.serve import limits
from anyprobe.serve.pool import WorkerPool


class DoorProtocol(H11Protocol):
    """HTTP/1.1 with time limits for heads and for clients that do not read, and a bound on connections."""

    max_connections = limits.MAX_CONNECTIONS
    head_s = limits.HEAD_S
    read_s = limits.READ_S

    def connection_made(self, transport: Any) -> None:
        self._waits_since: float | None = None
        self._head: asyncio.TimerHandle | None = None
        self._unread: asyncio.TimerHandle | None = None
        if len(self.connections) >= self.max_connections:
            waiting: list[Any] = [c for c in self.connections if getattr(c, "_waits_since", None) is not None]
            if not waiting:  # all of them are being answered
                super().connection_made(transport)
                transport.abort()
                return
            min(waiting, key=lambda c: c._waits_since).transport.abort()
        super().connection_made(transport)
        self._await_head()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.transport.is_closing():
            return
        if self.conn.their_state is h11.IDLE:  # the next head is not there yet
            if self._head is None:
                self._await_head()
        else:
            self._head_came()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        if not self.transport.is_closing() and self.conn.their_state is h11.IDLE:
            self._waits_since = time.monotonic()  # kept alive: uvicorn's own timer ends it

    def connection_lost(self, exc: Exception | None) -> None:
        self._head_came()
        if self._unread is not None:
            self._unread.cancel()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        self._unread = self.loop.call_later(self.read_s, self.transport.abort)
        super().pause_writing()

    def resume_writing(self) -> None:
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None
        super().resume_writing()

    def _await_head(self) -> None:
        self._waits_since = time.monotonic()
        self._head = self.loop.call_later(self.head_s, self.transport.abort)

    def _head_came(self) -> None:
        self._waits_since = None
        if self._head is not None:
            self._head.cancel()
            self._head = None


class DrainingServer(uvicorn.Server):
    """uvicorn server that drains the queue at shutdown: running work gets some seconds, the rest gets 503."""

    def __init__(self, config: uvicorn.Config, pool: WorkerPool) -> None:
        super().__init__(config)
        self._pool = pool

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._pool.drain()
        await super().shutdown(sockets)


class FewLines(logging.Filter):
    """Filter that passes a limited number of lines a minute; the next minute's first line says how many were
    dropped."""

    def __init__(self, max_lines: int = limits.LINES_PER_MINUTE) -> None:
        super().__init__()
        self._max_lines, self._since, self._count = max_lines, time.monotonic(), 0

    def filter(self, record: logging.LogRecord) -> bool:
        if time.monotonic() - self._since >= 60.0:
            num_dropped, self._since, self._count = self._count - self._max_lines, time.monotonic(), 0
            if num_dropped > 0:
                record.msg, record.args = f"({num_dropped} lines left out) {record.getMessage()}", ()
        self._count += 1
        return self._count <= self._max_lines


class FewLinesHandler(logging.StreamHandler):
    """Handler that writes all libraries' lines to stderr, as many as FewLines passes."""

    def __init__(self) -> None:
        super().__init__()
        self.addFilter(FewLines())
        self.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))


def bound_log() -> None:
    """Send the log of every library through one FewLinesHandler: clients can make any of them log."""
    root = logging.getLogger()
    for handler in [handler for handler in root.handlers if isinstance(handler, FewLinesHandler)]:
        root.removeHandler(handler)
    root.addHandler(FewLinesHandler())


def settings(drain_s: float = limits.DRAIN_S) -> dict[str, Any]:
    """Return uvicorn settings with limits that fit this process; raise its limit of descriptors and set up logging."""
    num_descriptors = _most_descriptors()
    max_connections = min(limits.MAX_CONNECTIONS, max(16, num_descriptors - limits.SPARE_DESCRIPTORS))
    bound_log()
    return {
        "http": type("Door", (DoorProtocol,), {"max_connections": max_connections}),
        "ws": "none",
        "h11_max_incomplete_event_size": limits.MAX_HEAD_BYTES,
        "timeout_keep_alive": limits.IDLE_S,
        "backlog": 128,
        "server_header": False,
        "log_config": None,
        "log_level": "warning",
        "timeout_graceful_shutdown": math.ceil(drain_s) + 2,
    }


def _most_descriptors() -> int:
    """Raise this process's limit of open files towards the system's, and return it."""
    try:
        import resource
    except ImportError:  # Windows
        return limits.MAX_CONNECTIONS
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        target = limits.MAX_CONNECTIONS + limits.SPARE_DESCRIPTORS
        target = target if hard == resource.RLIM_INFINITY else min(target, hard)
        if soft < target:
            resource.setrlimit(resource.RLIMIT_NOFILE, (target, hard))
            return target
    return soft


DAYS = 30


def write_certificate(folder: Path, hosts: Sequence[str]) -> tuple[Path, Path]:
    """Make a key and a certificate for the hosts (names or addresses), valid for DAYS.

    Browsers warn once, since no authority signed it; the traffic is encrypted all the same.

    Returns:
        Paths of certificate and key, PEM; the key is readable by its owner alone.
    """
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec
    except ImportError as error:
        raise MissingExtra("cryptography", "serve", "--https", error) from error
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, "anyprobe")])
    now = datetime.datetime.now(datetime.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))  # clocks differ
        .not_valid_after(now + datetime.timedelta(days=DAYS))
        .add_extension(x509.SubjectAlternativeName([_alternative(host) for host in hosts]), critical=False)
        .sign(key, hashes.SHA256())
    )
    certificate_path, key_path = folder / "certificate.pem", folder / "key.pem"
    certificate_path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    key_path.touch(mode=0o600)
    key_path.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return certificate_path, key_path


def _alternative(host: str):
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)
