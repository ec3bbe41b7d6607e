"""anyprobe serve: the live page and the HTTP API on this machine, or the page as static files."""

from __future__ import annotations

import datetime
import ipaddress
import math
import os
import secrets
import socket
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from anyprobe.cli.doctor import mask_network
from anyprobe.cli.options import ModelOption, bounded
from anyprobe.errors import InputError, OutputError, optional
from anyprobe.files.graphs import CHILD_ENVIRONMENT, usable_cores
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.masks.weights import find_weights
from anyprobe.serve.limits import DRAIN_S, IDLE_S, MAX_CONNECTIONS, Limits

LOOPBACK = ("127.0.0.1", "localhost", "[::1]", "::1")
"""Host names of a server on the same machine."""
MIN_TOKEN = 8
DAYS = 30
"""Days for which a certificate is valid."""
SHARED_MEMORY = "/dev/shm"
"""Folder in memory on Linux, in containers too."""
EVERYWHERE = ("0.0.0.0", "::", "")
"""Hosts that stand for all addresses of this machine."""


def serve(
    *,
    host: str = "127.0.0.1",
    port: Annotated[int, bounded(0, 65535)] = 8000,
    https: bool = False,
    static: Annotated[Path | None, Parameter(metavar="DIR")] = None,
    workers: Annotated[int | None, bounded(1)] = None,
    max_mb: Annotated[int, bounded(1, 1024)] = 32,
    allow_origin: Annotated[list[str] | None, Parameter(metavar="ORIGIN")] = None,
    allow_host: Annotated[list[str] | None, Parameter(metavar="NAME")] = None,
    token: Annotated[str | None, Parameter(env_var="ANYPROBE_TOKEN")] = None,
    drain: Annotated[float, bounded(0, 600)] = DRAIN_S,
    model: ModelOption = DEFAULT_MODEL,
) -> None:
    """Serve the web page and the HTTP API.

    Everything is computed here; nothing leaves this machine.

    Args:
        host: Address to listen on; 0.0.0.0 for other machines too.
        port: Port to listen on.
        https: Serve HTTPS with a new self-signed certificate; a phone's camera needs it.
        static: Write the page as static files into DIR and exit.
        workers: Photos processed at a time; default: one per core.
        max_mb: Largest upload, MiB.
        allow_origin: Allow pages of this origin to use the API (CORS); repeatable.
        allow_host: Additional host name to answer to; repeatable.
        token: Token of 8 characters or more that clients must send, or none; default: a new one beyond this machine.
        drain: Seconds that running work gets when the server is stopped (SIGTERM).
    """
    for package in ("fastapi", "uvicorn", "pebble", "prometheus-client", "python-multipart"):
        optional(package.replace("-", "_"), package, "serve", "anyprobe serve")
    import uvicorn

    from anyprobe.estimate.estimator import Estimator
    from anyprobe.serve.api import create_app
    from anyprobe.serve.page import Page, write_static

    _find_temporary_folder()
    estimator = Estimator(model, threads=1)
    page = Page(estimator, model)
    if static is not None:
        written = write_static(page, static)
        size = sum(path.stat().st_size for path in written)
        print(f"{static}: {len(written)} files, {size / 2**20:.0f} MiB; see docs/how-to/serve.md", file=sys.stderr)
        return
    os.environ.update(CHILD_ENVIRONMENT)  # decoding processes use one thread each
    limits = Limits(max_bytes=max_mb * 2**20, workers=workers or usable_cores())
    extra_names = [name.lower() for name in allow_host or []]
    with _open_port(host, port) as listening, tempfile.TemporaryDirectory() as folder:
        shown_host = own_address() if host in EVERYWHERE else host
        is_local = is_loopback(host)
        token = _token(token, is_local)
        # a token is no use to a page of a foreign name that was pointed at this machine
        hosts = ["*"] if token else [host.lower(), shown_host, *LOOPBACK, *extra_names]
        app = create_app(estimator, limits, page=page, hosts=hosts, origins=allow_origin or [], token=token)
        encrypted: dict[str, Any] = {}
        if https:
            certified = ["localhost", "127.0.0.1", shown_host, *extra_names]
            certificate, key = write_certificate(Path(folder), list(dict.fromkeys(certified)))
            encrypted = {"ssl_certfile": str(certificate), "ssl_keyfile": str(key)}
        place = f"[{shown_host}]" if ":" in shown_host else shown_host
        address = f"{'https' if https else 'http'}://{place}:{listening.getsockname()[1]}/"
        entry = address if token is None else f"{address}?token={token}"
        _say(f"{entry} (API: {address}api/), Ctrl-C stops it")
        if find_weights() is None:
            _say(mask_network())
        if not is_local:
            whom = "with that token" if token else "without a token"
            _say(f"warning: any machine that can reach this one can use the server {whom}")
            if not https:
                _say("over http, other machines get no camera and traffic is not encrypted; add --https")
        app.state.pool.warm()
        config = uvicorn.Config(
            app,
            timeout_keep_alive=IDLE_S,
            timeout_graceful_shutdown=math.ceil(drain),
            limit_concurrency=MAX_CONNECTIONS,
            ws="none",
            server_header=False,
            log_level="warning",
            **encrypted,
        )
        uvicorn.Server(config).run(sockets=[listening])


def _find_temporary_folder() -> None:
    """Use shared memory for temporary files where no folder can be written, as in a container with a read-only root."""
    try:
        tempfile.gettempdir()
    except OSError as error:
        if not os.access(SHARED_MEMORY, os.W_OK):
            raise OutputError("no folder for temporary files is writable; set TMPDIR to one that is") from error
        tempfile.tempdir = os.environ["TMPDIR"] = SHARED_MEMORY


def _say(line: str) -> None:
    print(f"anyprobe: {line}", file=sys.stderr, flush=True)


def _token(given: str | None, is_local: bool) -> str | None:
    """Return the token that clients must send: the given one, a new one beyond the loopback, else None."""
    if given is None:
        return None if is_local else secrets.token_urlsafe(12)
    if given == "none":
        return None
    if not given.isascii() or not given.isprintable() or len(given) < MIN_TOKEN or " " in given:
        raise InputError(
            f"expected none, or at least {MIN_TOKEN} ASCII characters without spaces, got {len(given)}; "
            "leave it out to get a new one",
            subject="token",
        )
    return given


def _open_port(host: str, port: int) -> socket.socket:
    """Return a listening socket; InputError if there is none."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        is_6 = family == socket.AF_INET6
        return socket.create_server(address, family=family, dualstack_ipv6=is_6 and socket.has_dualstack_ipv6())
    except OSError as error:
        text = f"{host}:{port}: cannot listen there ({error.strerror or error}); choose another --host or --port"
        raise InputError(text) from error


def is_loopback(host: str) -> bool:
    """Return whether a host name is unreachable for other machines."""
    if host == "localhost":
        return True
    with suppress(ValueError):  # another name
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    return False


def own_address() -> str:
    """Return this machine's address in its own network; nothing is sent to find it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        with suppress(OSError):
            probe.connect(("192.0.2.1", 9))  # a documentation address: choosing a route sends no packet
            return str(ipaddress.ip_address(probe.getsockname()[0]))
    return "127.0.0.1"


def write_certificate(folder: Path, hosts: Sequence[str]) -> tuple[Path, Path]:
    """Make a key and a certificate for the hosts (names or addresses), valid for DAYS.

    Phones give a page their camera over https only. Browsers warn once, since no authority signed it; the traffic is
    encrypted all the same.

    Returns:
        Paths of certificate and key, PEM; the key is readable by its owner alone.
    """
    optional("cryptography.x509", "cryptography", "serve", "--https")
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

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

    with suppress(ValueError):
        return x509.IPAddress(ipaddress.ip_address(host))
    return x509.DNSName(host)
