"""A worker as the service sees it: a child process, a pipe, and two threads that tend it."""

from __future__ import annotations

import asyncio
import contextlib
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection, Pipe
from typing import Any

from lineloom_core.codec import CodecError, decode, encode

from lineloom_service.engine.current_entry import CurrentEntry
from lineloom_service.engine.messages import (
    EncodedView,
    Order,
    Ready,
    Report,
    Sent,
    Stopped,
    View,
)
from lineloom_service.engine.signs_of_life import LOOK_S, SignsOfLife
from lineloom_service.engine.view_parts import ViewDecoder


class WorkerProcess:
    """One life of one worker. Callbacks come on the event loop; `on_death` comes last, once.

    A program of its own and not `multiprocessing`'s: that would run the main script again in the
    child, which starts another service where the script has no guard. Threads, because a full
    pipe must not stop the event loop, and reading a large map neither. What the child sends is
    data: a child that sends anything else is ended.
    """

    def __init__(
        self,
        name: str,
        mapper: str,
        warm_up: str | None,
        publish_every_s: float,
        settle_after_s: float,
        on_report: Callable[[Report], None],
        on_death: Callable[[], None],
    ) -> None:
        """Start it. Raises whatever the system has too little of; then nothing is left behind."""
        self.name = name
        self.ready = False
        self._on_report = on_report
        self._on_death = on_death
        self._loop = asyncio.get_running_loop()
        self._blamed: tuple[int, int] | None = None
        self._ended_for: str | None = None
        self._stopped = False
        self._alive = True
        self._decoders: dict[int, tuple[int, ViewDecoder]] = {}
        self._orders: queue.SimpleQueue[Order | None] = queue.SimpleQueue()
        with contextlib.ExitStack() as undo:
            self._current = CurrentEntry.create()
            undo.callback(self._current.close)
            self._connection: Connection[Any, Any]
            self._connection, theirs = Pipe()
            undo.callback(self._connection.close)
            undo.callback(theirs.close)
            life, self._life = os.pipe()
            undo.callback(os.close, self._life)
            with os.fdopen(life):
                descriptors = (theirs.fileno(), life, self._current.fd)
                arguments = (mapper, warm_up or "", publish_every_s, settle_after_s, *descriptors)
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "lineloom_service.engine", *map(str, arguments)],
                    stdin=subprocess.DEVNULL,
                    pass_fds=descriptors,
                    # The same modules as here, wherever they were found.
                    env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
                )
            undo.callback(self._process.wait)
            undo.callback(self._process.kill)
            self._signs = SignsOfLife(self._process.pid, self._current.beats)
            self._start_threads(undo)
            undo.pop_all()
        theirs.close()  # so that the pipe breaks when the child ends

    def _start_threads(self, undo: contextlib.ExitStack) -> None:
        self._sender = threading.Thread(
            target=self._send_orders, name=f"{self.name}-sender", daemon=True
        )
        self._sender.start()
        undo.callback(self._orders.put, None)
        receiver = threading.Thread(
            target=self._receive_reports, name=f"{self.name}-receiver", daemon=True
        )
        receiver.start()

    @property
    def pid(self) -> int:
        """The child's process id."""
        return self._process.pid

    @property
    def blamed(self) -> tuple[int, int] | None:
        """Site and position that the child was working on when it died, None where on nothing."""
        return self._blamed

    @property
    def killed(self) -> bool:
        """Whether a signal from elsewhere ended or stopped the child: nothing that it was at."""
        killed = self._process.returncode == -signal.SIGKILL and self._ended_for is None
        return killed or self._stopped

    @property
    def last_words(self) -> str:
        """How the child ended."""
        code = self._process.returncode
        if self._ended_for is not None:
            return self._ended_for
        if code is not None and code < 0:
            return f"the worker was ended by {signal.Signals(-code).name}"
        return f"the worker ended with code {code}"

    @property
    def silence(self) -> str | None:
        """Say that the child gives no sign of life, once that is more than chance."""
        looks = self._signs.silent_looks
        return f"the worker gives no sign of life for {looks * LOOK_S:g} s" if looks > 1 else None

    def look(self, patience_s: float) -> None:
        """End the child if it is silent, or has been at one thing for longer than that.

        To be called every `LOOK_S`.
        """
        # Its memory is let go of on another thread when it has ended.
        with contextlib.suppress(ValueError):
            if not self._alive or self._ended_for is not None:
                return
            self._signs.look()
            if self._signs.gone:
                self._stopped = self._signs.stopped
                self._end(f"{self.silence}{': a signal stopped it' if self._stopped else ''}")
            elif self._current.seconds() > patience_s:
                self._end(f"the worker did not come back within {patience_s:g} s")

    def _end(self, why: str) -> None:
        self._ended_for = why
        self._process.kill()

    def send(self, order: Order) -> None:
        """Send an order as soon as the pipe takes it."""
        self._orders.put(order)

    def kill(self) -> None:
        """End the child at once."""
        self._process.kill()

    def _send_orders(self) -> None:
        try:
            while (order := self._orders.get()) is not None:
                self._connection.send_bytes(encode(order))
        except OSError:
            pass  # a broken pipe is a dead child: the other thread tells
        except Exception as error:  # no memory left: what comes next must not go without this
            self._end(f"an order could not be sent: {type(error).__name__}: {error}")

    def _receive_reports(self) -> None:
        try:
            while True:
                report = self._read(decode(self._connection.recv_bytes(), Sent))
                if report is not None:
                    self._tell(self._take, report)
        except CodecError as error:
            self._end(f"the worker sent what is no report: {error}")
        except (EOFError, OSError):
            pass  # it has ended
        except Exception as error:  # no memory left for what it sent
            self._end(f"a report could not be read: {type(error).__name__}: {error}")
        self._orders.put(None)
        self._process.wait()
        self._sender.join()  # before its pipe's number can be another's
        self._alive = False
        self._blamed = self._current.read()
        self._current.close()
        self._connection.close()
        os.close(self._life)
        self._tell(self._on_death)

    def _read(self, sent: Sent) -> Report | None:
        if isinstance(sent, Stopped):
            self._decoders.pop(sent.site, None)
            return None
        if not isinstance(sent, EncodedView):
            return sent
        run, decoder = self._decoders.get(sent.site, (None, ViewDecoder()))
        if run != sent.run:
            decoder = ViewDecoder()  # the worker's encoder is a new one as well
        self._decoders[sent.site] = sent.run, decoder
        return View(sent.site, sent.run, sent.position, decoder.decode(sent.parts))

    def _take(self, report: Report) -> None:
        if isinstance(report, Ready):
            self.ready = True
        self._on_report(report)

    def _tell(self, callback: Callable[..., None], *arguments: object) -> None:
        # The event loop may be gone already when the service ends.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(callback, *arguments)
