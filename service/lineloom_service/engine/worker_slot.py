"""A worker's place: one process after another, whatever becomes of each."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from lineloom_service.engine.messages import Ready, Report
from lineloom_service.engine.worker_process import WorkerProcess

_LOG = logging.getLogger(__name__)
_AGAIN_S = 0.1
_AGAIN_LIMIT_S = 10.0
_ADD_UP = 16
"""Failures that make the pause longer: beyond, it is at its limit anyway."""

MakeProcess = Callable[[str, Callable[[Report], None], Callable[[], None]], WorkerProcess]
"""Starts a worker of that name, given who is to be told of its reports and of its end."""


class WorkerSlot:
    """Keeps a worker running. One that ends is replaced, one that cannot be started is tried again.

    ready: set while there is a worker that takes orders. sites: those hosted here.
    """

    def __init__(
        self,
        number: int,
        make: MakeProcess,
        on_report: Callable[[Report], None],
        on_death: Callable[[WorkerSlot, WorkerProcess], None],
    ) -> None:
        """on_death: called with the process that ended; another one is on its way."""
        self.number = number
        self.process: WorkerProcess | None = None
        self.ready = asyncio.Event()
        self.sites: set[int] = set()
        self.last_words = ""
        self._make = make
        self._on_report = on_report
        self._on_death = on_death
        self._failures = 0
        """In a row: died before it was ready, or could not be started."""
        self._unstartable = False
        self._open = False
        self._next: asyncio.TimerHandle | None = None

    @property
    def ailment(self) -> str | None:
        """Why nothing is mapped here just now; None while there is a worker, or the first comes."""
        if self.process is not None and self.process.silence is not None:
            return f"worker {self.number}: {self.process.silence}"
        if self._unstartable:
            return f"worker {self.number} {self.last_words}; it is tried again"
        if not self.ready.is_set() and self.last_words:
            return f"worker {self.number} is warming up again: {self.last_words}"
        return None

    def open(self) -> None:
        """Start a worker, and keep one running from now on."""
        self._open = True
        self._failures = 0
        self._spawn()

    def close(self) -> None:
        """End it for good."""
        self._open = False
        self.ready.clear()
        if self._next is not None:
            self._next.cancel()
        if self.process is not None:
            self.process.kill()
            self.process = None
        self.sites.clear()
        self.last_words, self._unstartable = "", False

    def look(self, patience_s: float) -> None:
        """End the worker where it hangs: see `WorkerProcess.look`."""
        if self.process is not None:
            self.process.look(patience_s)

    def _spawn(self) -> None:
        if not self._open or self.process is not None:
            return
        try:
            process = self.process = self._make(
                f"lineloom-worker-{self.number}",
                lambda report: self._take(process, report),
                lambda: self._bury(process),
            )
        except Exception as error:  # no file handles, no memory, no threads: there may be again
            self.last_words = f"cannot be started: {type(error).__name__}: {error}"
            if not self._unstartable:
                _LOG.exception("worker %d cannot be started, trying again", self.number)
            self._unstartable = True
            self._spawn_later()
        else:
            self._unstartable = False

    def _spawn_later(self) -> None:
        pause = min(_AGAIN_LIMIT_S, _AGAIN_S * 2**self._failures) if self._failures else 0.0
        self._failures = min(self._failures + 1, _ADD_UP)
        self._next = asyncio.get_running_loop().call_later(pause, self._spawn)

    def _take(self, process: WorkerProcess, report: Report) -> None:
        if process is not self.process:
            return
        if isinstance(report, Ready):
            self._failures = 0
            self.ready.set()
        else:
            self._on_report(report)

    def _bury(self, process: WorkerProcess) -> None:
        if process is not self.process:
            return  # we ended it
        self.last_words = process.last_words
        _LOG.warning("worker %d (process %s): %s", self.number, process.pid, self.last_words)
        if process.ready:
            self._failures = 0
        self.ready.clear()
        self.process = None
        self._on_death(self, process)
        self._spawn_later()
