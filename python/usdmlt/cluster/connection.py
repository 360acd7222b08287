"""The way to a scheduler of Dask: one that is there, or one that is started here."""

from __future__ import annotations

import asyncio
import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from usdmlt.errors import Error
from usdmlt.settings import available_processors

if TYPE_CHECKING:
    from distributed import Client

SECONDS_TO_CONNECT = 10.0


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """A client of the scheduler at ``tcp://HOST:PORT``, or ``tls://`` by Dask's configuration.

    :class:`usdmlt.Error` where none answers.
    """
    _quiet()
    from distributed import Client

    _knock(address)
    try:
        client = Client(address, timeout=SECONDS_TO_CONNECT, set_as_default=False)
    except OSError as error:
        raise Error(f"no scheduler of Dask answers at {address}") from error
    try:
        yield client
    finally:
        client.close(timeout=SECONDS_TO_CONNECT)


def _knock(address: str) -> None:
    """Connect once, in a given time: a client of Dask's would wait for ever for the answer of what
    is no scheduler, such as a dashboard, and not all that it raises ends it."""
    from distributed.comm import CommClosedError, connect

    arguments = _arguments(address)

    async def knock() -> None:
        waits = connect(address, timeout=SECONDS_TO_CONNECT, **arguments)
        comm = await asyncio.wait_for(waits, SECONDS_TO_CONNECT + 1)
        comm.abort()

    try:
        asyncio.run(knock())
    except CommClosedError as error:
        # Something is there, and hung up.
        hint = (
            "it is not tls://, or its certificates and those here do not match"
            if address.startswith("tls:")
            else "it is tls://, or none"
        )
        raise Error(f"no scheduler of Dask answers at {address}: perhaps {hint}") from error
    except Exception as error:  # whatever is there may say anything
        raise Error(f"no scheduler of Dask answers at {address}") from error


def _arguments(address: str) -> dict[str, Any]:
    """Of connections to an address, by Dask's configuration; :class:`usdmlt.Error` for an address
    that is none, or a configuration that does not do for it."""
    from distributed import Security
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    try:
        scheme, location = parse_address(address)
        get_backend(scheme)
        parse_host_port(location)
        security = Security()
    except (ValueError, TypeError, ImportError) as error:
        raise Error(f"no scheduler of Dask is at {address}: {error}") from error
    if scheme != "tls" and security.require_encryption:
        raise Error(f"Dask's configuration requires encryption: {address} is not tls://")
    files = security.get_tls_config_for_role("client")
    try:
        arguments: dict[str, Any] = security.get_connection_args("client")
    except (OSError, ValueError, TypeError) as error:
        paths = [files[name] for name in ("ca_file", "cert", "key")]
        named = ", ".join(path for path in paths if path and "\n" not in path)  # no key itself
        raise Error(f"Dask's certificates ({named}) cannot be used: {error}") from error
    if scheme == "tls" and arguments["ssl_context"] is None:
        raise Error(
            f"Dask's configuration has no certificates for {address}: it needs a ca-file and the "
            "client's cert"
        )
    return arguments


@contextmanager
def local(workers: int, threads: int | None) -> Iterator[Client]:
    """A client of so many worker processes on this machine, which share ``threads``; they listen
    on the loopback only and end with the block."""
    _quiet()
    import dask
    from distributed import Client, LocalCluster

    each = max((threads or available_processors()) // workers, 1)
    # Profiles of what workers do, of Dask, would show one call and cost a hundredth of the time.
    with _interrupts_ignored(), dask.config.set({"distributed.worker.profile.enabled": False}):
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=each,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            worker_dashboard_address="127.0.0.1:0",
        )
    with cluster, Client(cluster, set_as_default=False) as client:
        yield client


@contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Ctrl-C goes to all processes of a terminal; those that are started here leave it to this
    one, which ends when their units are finished."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _quiet() -> None:
    """Import Dask, which says much when connections end; :class:`usdmlt.Error` where it is not
    installed."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise Error(
            "rendering on workers needs Dask: install usdmlt[cluster], or the package distributed"
        ) from None
    for name in ("distributed", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
