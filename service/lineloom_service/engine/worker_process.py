"""A worker as the service sees it: a child process, a pipe, and two threads that tend it."""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import queue
import signal
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection

from lineloom_service.engine.messages import Order, Ready, Report
from lineloom_service.engine.worker import run_worker

_SPAWN = multiprocessing.get_context("spawn")


class WorkerProcess:
    """One life of one worker. Callbacks come on the event loop; `on_death` comes last, once.

    Threads, because a full pipe must not stop the event loop, and unpickling a large map neither.
    """

    def __init__(
        self,
        name: str,
        mapper: str,
        warm_up: str | None,
        publish_every_s: float,
        on_report: Callable[[Report], None],
        on_death: Callable[[], None],
    ) -> None:
        self.name = name
        self.ready = False
        self._on_report = on_report
        self._on_death = on_death
        self._loop = asyncio.get_running_loop()
        self._current = _SPAWN.Array("q", 2, lock=False)
        ours, theirs = _SPAWN.Pipe()
        self._connection: Connection[Order, Report] = ours
        self._process = _SPAWN.Process(
            target=run_worker,
            args=(theirs, self._current, mapper, warm_up, publish_every_s),
            name=name,
            daemon=True,
        )
        self._process.start()
        theirs.close()  # so that the pipe breaks when the child ends
        self._orders: queue.SimpleQueue[Order | None] = queue.SimpleQueue()
        for target in (self._send_orders, self._receive_reports):
            threading.Thread(target=target, name=f"{name}-{target.__name__}", daemon=True).start()

    @property
    def pid(self) -> int | None:
        """The child's process id."""
        return self._process.pid

    @property
    def blamed(self) -> tuple[int, int] | None:
        """Site and position that the child was (last) working on, None where on nothing."""
        site, position = self._current[0], self._current[1]
        return (site, position) if position else None

    @property
    def killed(self) -> bool:
        """Whether SIGKILL ended the child."""
        return self._process.exitcode == -signal.SIGKILL

    @property
    def last_words(self) -> str:
        """How the child ended."""
        code = self._process.exitcode
        if code is not None and code < 0:
            return f"the worker was ended by {signal.Signals(-code).name}"
        return f"the worker ended with code {code}"

    def send(self, order: Order) -> None:
        """Send an order as soon as the pipe takes it."""
        self._orders.put(order)

    def kill(self) -> None:
        """End the child at once."""
        self._process.kill()

    def _send_orders(self) -> None:
        # A broken pipe is a dead child: the other thread tells.
        with contextlib.suppress(OSError):
            while (order := self._orders.get()) is not None:
                self._connection.send(order)

    def _receive_reports(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                report = self._connection.recv()
                self._tell(self._take, report)
        self._orders.put(None)
        self._process.join()
        self._tell(self._on_death)

    def _take(self, report: Report) -> None:
        if isinstance(report, Ready):
            self.ready = True
        self._on_report(report)

    def _tell(self, callback: Callable[..., None], *arguments: object) -> None:
        # The event loop may be gone already when the service ends.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(callback, *arguments)
