"""A worker process: hosts the mappers of some sites, one log entry after another."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
import time
import zlib
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import Any

from lineloom_core import timing
from lineloom_core.codec import decode, encode, inflate
from lineloom_core.mapping.config import config_from
from lineloom_core.mapping.snapshot import Snapshot

from lineloom_service.allocator import trim
from lineloom_service.engine.current_entry import BUSY, RESTORING, CurrentEntry
from lineloom_service.engine.mapper import Mapper, MapperFactory, apply, load
from lineloom_service.engine.messages import (
    Answered,
    Ask,
    Chapter,
    ChapterTaken,
    EncodedView,
    Failed,
    Fed,
    Feed,
    Order,
    Ready,
    Sent,
    SnapshotTaken,
    Started,
    StartSite,
    Stopped,
    StopSite,
    TakeSnapshot,
    Timed,
    ViewFailed,
)
from lineloom_service.engine.questions import unpack_arguments
from lineloom_service.engine.turns import Turns
from lineloom_service.engine.view_parts import ViewEncoder
from lineloom_service.observation.durations import Durations
from lineloom_service.observation.log import configure_from_environment
from lineloom_service.store.records import LogEntry

_LOG = logging.getLogger(__name__)

_NICENESS = 5
_BEAT_S = 0.5
_COMPILED = "LINELOOM_WORKER_HAS_COMPILED"
_CAUGHT_UP_PAUSE_S = 0.05
_PUBLISHING_SHARE = 0.1
"""At most this share of a worker's time goes into building and sending views of a site."""


@dataclass(slots=True)
class _Hosted:
    """A site's mapper. taken: entries of the feed under way that it has.

    due: when to publish, None where the view is up to date. settled: whether the view is to be, or
    is, at the optimum. shown: the position of the view that was sent last.
    """

    run: int
    mapper: Mapper
    position: int
    taken: int = 0
    due: float | None = None
    settled: bool = False
    shown: int | None = None
    earliest: float = 0.0
    pause: float = 0.0
    encoder: ViewEncoder = field(default_factory=ViewEncoder)


@dataclass(slots=True)
class _Gathered:
    """The chapters that a start of a site will go on from."""

    run: int
    chapters: list[bytes] = field(default_factory=list)


class Worker:
    """Serves orders until the pipe closes.

    current: shared with the service, so that it knows whom to blame if this process dies.
    """

    def __init__(
        self,
        connection: Connection[Any, Any],
        current: CurrentEntry,
        factory: MapperFactory,
        publish_every_s: float,
        settle_after_s: float,
    ) -> None:
        self._connection = connection
        self._current = current
        self._factory = factory
        self._publish_every_s = publish_every_s
        self._settle_after_s = settle_after_s
        self._sites: dict[int, _Hosted] = {}
        self._gathered: dict[int, _Gathered] = {}
        self._turns = Turns()
        self._durations = Durations()
        timing.listen(self._durations.observe)

    def serve(self) -> None:
        """Work through orders entry by entry, sites in turn, and publish what is due between."""
        self._send(Ready())
        while True:
            while self._connection.poll(self._pause()):
                try:
                    self._turns.put(decode(self._connection.recv_bytes(), Order))
                except EOFError:
                    return
            if self._turns:
                self._take_turn()
            self._publish_due()

    def _send(self, message: Sent) -> None:
        self._connection.send_bytes(encode(message))

    def _take_turn(self) -> None:
        order = self._turns.next()
        begin = time.monotonic()
        if self._obey(order):
            self._turns.spend(order.site, time.monotonic() - begin)
            self._turns.done(order.site)
        else:
            self._turns.spend(order.site, time.monotonic() - begin)

    def _pause(self) -> float | None:
        if self._turns:
            return 0.0
        due = [h.due for h in self._sites.values() if h.due is not None and not h.taken]
        return max(0.0, min(due) - time.monotonic()) if due else None

    def _obey(self, order: Order) -> bool:
        """Carry out an order, of a feed one entry only; False while there is more of it."""
        if isinstance(order, Feed):
            return self._feed(order)
        if isinstance(order, Chapter):
            self._gather(order)
        elif isinstance(order, StartSite):
            self._start(order)
        elif isinstance(order, TakeSnapshot):
            self._snapshot(order)
        elif isinstance(order, Ask):
            self._answer(order)
        elif isinstance(order, StopSite):
            self._sites.pop(order.site, None)
            self._gathered.pop(order.site, None)
            self._send(Stopped(order.site))
        return True

    def _gather(self, order: Chapter) -> None:
        self._sites.pop(order.site, None)  # what is to be replaced is not kept beside it
        gathered = self._gathered.get(order.site)
        if gathered is None or gathered.run != order.run:
            gathered = self._gathered[order.site] = _Gathered(order.run)
        gathered.chapters.append(order.data)
        self._send(ChapterTaken(order.site, order.run))

    def _start(self, order: StartSite) -> None:
        self._sites.pop(order.site, None)
        gathered = self._gathered.pop(order.site, None)
        chapters = () if gathered is None or gathered.run != order.run else gathered.chapters
        self._current.mark(order.site, RESTORING)
        try:
            if order.state is None:
                mapper = self._factory(config_from(order.parameters))
            else:
                state = inflate(order.state)
                mapper = self._factory.resume(Snapshot(state, 0, tuple(chapters)))
        except Exception as error:
            self._send(Started(order.site, order.run, describe(error)))
            return
        finally:
            self._current.clear()
        self._sites[order.site] = _Hosted(
            order.run, mapper, order.position, due=time.monotonic(), settled=order.settled
        )
        self._send(Started(order.site, order.run))

    def _feed(self, order: Feed) -> bool:
        hosted = self._hosted(order)
        if hosted is None:
            return True
        if hosted.taken < len(order.entries):
            if not self._apply(hosted, order, order.entries[hosted.taken]):
                return True
            hosted.taken += 1
        if hosted.taken < len(order.entries):
            return False
        hosted.taken = 0
        hosted.position = order.through
        if hosted.position != hosted.shown:
            pause = _CAUGHT_UP_PAUSE_S if order.caught_up else self._publish_every_s
            hosted.due = hosted.earliest + max(pause, hosted.pause)
            hosted.settled = order.settled
            if order.publish:
                self._publish(order.site, hosted)
        self._send(Fed(order.site, order.run))
        return True

    def _apply(self, hosted: _Hosted, order: Feed, entry: LogEntry) -> bool:
        self._current.mark(order.site, entry.position)
        begin = time.perf_counter()
        try:
            apply(hosted.mapper, entry)
        except Exception as error:
            # Half of the entry may have been taken: this mapper is not to be used again.
            del self._sites[order.site]
            reason = describe(error)
            self._send(Failed(order.site, order.run, entry.position, reason))
            return False
        finally:
            self._current.clear()
        self._durations.observe("entry", time.perf_counter() - begin)
        return True

    def _snapshot(self, order: TakeSnapshot) -> None:
        hosted = self._hosted(order)
        if hosted is None:
            return
        self._current.mark(order.site, BUSY)
        try:
            begin = time.perf_counter()
            snapshot = hosted.mapper.snapshot(order.known)
            # Four times smaller at the quickest level; chapters are as small as they get.
            snapshot = replace(snapshot, state=zlib.compress(snapshot.state, 1))
            self._durations.observe("snapshot", time.perf_counter() - begin)
        except Exception as error:
            # The map is as it was, and no entry is to blame: the site goes on without.
            _LOG.exception("site %d: no snapshot", order.site)
            self._send(SnapshotTaken(order.site, order.run, failure=describe(error)))
            return
        finally:
            self._current.clear()
        self._send(SnapshotTaken(order.site, order.run, snapshot))
        trim()

    def _answer(self, order: Ask) -> None:
        hosted = self._hosted(order)
        if hosted is None:
            return
        self._current.mark(order.site, BUSY)
        try:
            arguments = unpack_arguments(order.question, order.arguments)
            value = encode(getattr(hosted.mapper, order.question)(*arguments))
        except Exception as error:
            # The map is as it was: the question is to blame, not the mapper.
            _LOG.exception("site %d: %s was not answered", order.site, order.question)
            self._send(Answered(order.site, order.run, failure=describe(error)))
            return
        finally:
            self._current.clear()
        self._send(Answered(order.site, order.run, value))

    def _hosted(self, order: Feed | TakeSnapshot | Ask) -> _Hosted | None:
        """Return the site's mapper, unless the order is meant for one that has failed since."""
        hosted = self._sites.get(order.site)
        return hosted if hosted is not None and hosted.run == order.run else None

    def _publish_due(self) -> None:
        now = time.monotonic()
        for site, hosted in self._sites.items():
            # A version is what whole entries made, and a position what was fed through.
            if hosted.due is not None and hosted.due <= now and not hosted.taken:
                self._publish(site, hosted)

    def _publish(self, site: int, hosted: _Hosted) -> None:
        started = time.monotonic()
        hosted.due = None
        self._current.mark(site, BUSY)
        try:
            parts = hosted.encoder.encode(hosted.mapper.view(settled=hosted.settled))
        except Exception as error:
            # The site stays at its last view, and is not idle: that is the truth.
            _LOG.exception("site %d: no view after entry %d", site, hosted.position)
            failed = ViewFailed(site, hosted.run, hosted.position, describe(error))
            self._send(failed)
        else:
            self._durations.observe("view", time.monotonic() - started)
            self._send(Timed(self._durations.take()))
            self._send(EncodedView(site, hosted.run, hosted.position, parts))
            hosted.shown = hosted.position
        self._current.clear()
        hosted.earliest = time.monotonic()
        took = hosted.earliest - started
        if hosted.settled:
            return
        hosted.pause = took / _PUBLISHING_SHARE
        if hosted.shown != hosted.position:
            return
        # Nothing may come for a while: then what is shown is to be exact. A feed puts this off.
        hosted.due, hosted.settled = hosted.earliest + max(self._settle_after_s, took), True


def describe(error: BaseException) -> str:
    """Return an exception as one short line."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0] if text else ''}"[:300].rstrip(": ")


def run_worker(
    mapper: str,
    warm_up: str | None,
    publish_every_s: float,
    settle_after_s: float,
    *,
    pipe: int,
    life: int,
    current: int,
) -> None:
    """Be a worker process. Ends with the service, however that ends.

    pipe, life, current: file descriptors of the pipe to the service, of one that the service
    holds open as long as it lives, and of the shared CurrentEntry.
    """
    # A Ctrl-C goes to the whole terminal group, and systemd's SIGTERM to all processes of a unit.
    # The service decides when its workers end: it has their maps saved first.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Thread(target=_end_with_service, args=(life,), daemon=True).start()
    entry = CurrentEntry(current)
    threading.Thread(target=_beat, args=(entry,), daemon=True).start()
    with contextlib.suppress(OSError):
        os.nice(_NICENESS - os.nice(0))  # answers go before mapping
    configure_from_environment()
    factory = load(mapper)
    if warm_up is not None and load(warm_up)():
        _begin_again()
    connection: Connection[Any, Any] = Connection(pipe)
    # The service has closed its end: nobody is left to report to.
    with contextlib.suppress(BrokenPipeError, ConnectionResetError):
        worker = Worker(connection, entry, factory, publish_every_s, settle_after_s)
        worker.serve()


def _begin_again() -> None:
    """Be the same process anew, without the compiler and all that it keeps; once at most."""
    if _COMPILED not in os.environ:
        os.environ[_COMPILED] = "1"
        os.execv(sys.executable, sys.orig_argv)


def _beat(entry: CurrentEntry) -> None:
    while True:
        entry.beat()
        time.sleep(_BEAT_S)


def _end_with_service(life: int) -> None:
    os.read(life, 1)  # nothing is ever written: this returns when the other end closes
    os._exit(0)
