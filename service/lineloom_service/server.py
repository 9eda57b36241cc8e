"""`lineloom serve`: the app behind uvicorn, until told to stop."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import os
import signal
import socket
import sys
from collections.abc import Iterator
from types import FrameType
from typing import NoReturn

import uvicorn
import uvloop

from lineloom_service.allocator import give_back
from lineloom_service.app import create_app
from lineloom_service.head_limit import HeadLimitApp, head_limited
from lineloom_service.observation import log
from lineloom_service.security.guard import UnprotectedError
from lineloom_service.service import Service
from lineloom_service.settings import Settings
from lineloom_service.store.records import StoreError

_LOG = logging.getLogger(__name__)

_SHUTDOWN_S = 5
_CLOSE_S = 5
_LOOK_EVERY_S = 0.5
_SWITCH_S = 0.001
"""How long a thread that renders or writes has the interpreter while an answer waits for it."""

_FULL_COLLECTION_EVERY = 100
"""Collections of the middle generation; Python's 10 came every two seconds under load."""


def run(settings: Settings) -> None:
    """Serve until SIGINT or SIGTERM. Exits with a message where it cannot even start."""
    log.configure(settings.log_level, settings.log_format)
    give_back()
    try:
        run_service(Service(settings))
    except (StoreError, UnprotectedError) as error:
        sys.exit(f"lineloom: {error}")


def run_service(service: Service) -> NoReturn:
    """Serve until SIGINT or SIGTERM, then end this process. Raises where it cannot even start."""
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        try:
            runner.run(serve(service))
        except KeyboardInterrupt:
            _leave(0)  # while starting, or a second time while stopping
        except SystemExit:
            _leave(1)  # uvicorn has said that the port is taken
        _leave(0)


def _leave(code: int) -> NoReturn:
    """End the process at once: all is on the disk.

    An ordinary end waits for every thread, and one may be compiling the matcher's kernels: without
    a cache that is half a minute in which a supervisor loses its patience.
    """
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


async def serve(service: Service) -> None:
    """Serve until SIGINT or SIGTERM, then save what was mapped."""
    sys.setswitchinterval(_SWITCH_S)
    await service.start()
    freezing = asyncio.create_task(_freeze_when_ready(service))
    settings = service.settings
    try:
        config = uvicorn.Config(
            HeadLimitApp(create_app(service=service)),
            host=settings.host,
            port=settings.port,
            log_config=None,
            http=head_limited(settings.slow_sender_s),
            ws="none",
            proxy_headers=False,
            access_log=False,
            timeout_graceful_shutdown=_SHUTDOWN_S,
            server_header=False,
            ssl_certfile=settings.ssl_certfile,
            ssl_keyfile=settings.ssl_keyfile,
        )
        listening = config.bind_socket()
        _drop_the_deaf(listening, settings.slow_reader_s)
        with _signals_end_only_the_serving():
            await _Server(config, service).serve(sockets=[listening])
    finally:
        freezing.cancel()
        await _stop(service)


class _Server(uvicorn.Server):
    """Uvicorn waits for every answer to end, and those of listeners to events have no end."""

    def __init__(self, config: uvicorn.Config, service: Service) -> None:
        super().__init__(config)
        self._service = service

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Let the listeners go first."""
        self._service.events.stop()
        await super().shutdown(sockets)


async def _stop(service: Service) -> None:
    """Save and close, within bounds: a database that does not answer must not keep us."""
    try:
        async with asyncio.timeout(service.settings.stop_grace_s + _CLOSE_S):
            await service.stop()
    except TimeoutError:
        _LOG.warning("stopped before all was closed; what was acknowledged is on the disk")


@contextlib.contextmanager
def _signals_end_only_the_serving() -> Iterator[None]:
    """Have the signal that ended uvicorn end nothing else.

    Uvicorn raises it again once it has stopped, for whoever handled it before: by default that
    ends the process, or cancels the task, before anything is saved.
    """
    before = {sig: signal.signal(sig, _ignore) for sig in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for sig, handler in before.items():
            signal.signal(sig, handler)


def _ignore(_signal: int, _frame: FrameType | None) -> None:
    """Not SIG_IGN, which child processes would inherit."""


async def _freeze_when_ready(service: Service) -> None:
    """Spare the collector what was loaded to start: walking it held every answer up for 0.2 s."""
    while service.not_ready():
        await asyncio.sleep(_LOOK_EVERY_S)
    gc.collect()
    gc.freeze()
    young, middle, _ = gc.get_threshold()
    gc.set_threshold(young, middle, _FULL_COLLECTION_EVERY)


def _drop_the_deaf(listening: socket.socket, patience_s: float) -> None:
    """Have the kernel end connections whose other side takes nothing any more."""
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        patience_ms = round(1000 * patience_s)
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, patience_ms)
