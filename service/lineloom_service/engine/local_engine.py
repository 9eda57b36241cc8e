"""The embedded engine: worker processes on this machine, sites spread over them."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from lineloom_core.codec import CodecError, encode
from lineloom_core.mapping.snapshot import Snapshot

from lineloom_service.engine.compilation import Compilation
from lineloom_service.engine.current_entry import BUSY, RESTORING
from lineloom_service.engine.mapper import SITE_MAPPER, WARM_UP
from lineloom_service.engine.messages import (
    Answered,
    Ask,
    Chapter,
    ChapterTaken,
    Failed,
    Fed,
    Feed,
    Ready,
    Report,
    SnapshotTaken,
    Started,
    StartSite,
    StopSite,
    TakeSnapshot,
    Timed,
    View,
    ViewFailed,
)
from lineloom_service.engine.protocol import (
    DeathListener,
    FailureListener,
    MapperFailedError,
    QuestionFailedError,
    ResumeFailedError,
    SnapshotFailedError,
    ViewListener,
    WorkerDiedError,
)
from lineloom_service.engine.questions import unpack_answer
from lineloom_service.engine.signs_of_life import LOOK_S
from lineloom_service.engine.worker_process import WorkerProcess
from lineloom_service.engine.worker_slot import WorkerSlot
from lineloom_service.observation.durations import Durations
from lineloom_service.store.records import LogEntry

_LOG = logging.getLogger(__name__)


@dataclass(slots=True)
class _Site:
    """A hosted site: the number of its start and the answers awaited, in order.

    process: the one that it was started on. gathering: the chapters that it is to go on from are
    on their way, and nothing else is taken.
    """

    slot: WorkerSlot
    process: WorkerProcess | None = None
    run: int = 0
    gathering: bool = False
    awaited: deque[asyncio.Future[Any]] = field(default_factory=deque)

    def fail(self, error: Exception) -> None:
        """Let everyone who waits for this site know."""
        while self.awaited:
            answer = self.awaited.popleft()
            if not answer.done():
                answer.set_exception(error)


class LocalEngine:
    """Implements `engine.protocol.Engine` by child processes. A dead one is replaced."""

    def __init__(
        self,
        workers: int,
        *,
        publish_every_s: float = 0.5,
        settle_after_s: float = 0.1,
        patience_s: float = 120.0,
        mapper: str = SITE_MAPPER,
        warm_up: str | None = WARM_UP,
    ) -> None:
        self._warm_up = warm_up
        start = partial(_start_worker, mapper, warm_up, publish_every_s, settle_after_s)
        self._patience_s = patience_s
        self._watching: asyncio.Task[None] | None = None
        self._compilation = Compilation()
        self._compiling: asyncio.Task[None] | None = None
        self._slots = [
            WorkerSlot(number, start, self._on_report, self._on_death) for number in range(workers)
        ]
        self._sites: dict[int, _Site] = {}
        self._listeners: list[ViewListener] = []
        self._failure_listeners: list[FailureListener] = []
        self._death_listeners: list[DeathListener] = []
        self._durations = Durations()

    @property
    def pids(self) -> list[int]:
        """Process ids of the workers that run."""
        return [slot.process.pid for slot in self._slots if slot.process is not None]

    async def start(self) -> None:
        """Have kernels compiled where that has not been done, and spawn the workers."""
        self._compilation = Compilation()
        if self._warm_up == WARM_UP:
            self._compiling = asyncio.create_task(self._compile(), name="compile-kernels")
        else:
            self._open_slots()
        self._watching = asyncio.create_task(self._watch(), name="watch-workers")

    async def stop(self) -> None:
        """Kill the workers."""
        if self._watching is not None:
            self._watching.cancel()
        if self._compiling is not None:
            self._compiling.cancel()
            self._compilation.stop()
        for slot in self._slots:
            slot.close()
        for site in self._sites.values():
            site.fail(WorkerDiedError(None, "the engine is stopping", killed=True))
        self._sites.clear()

    def subscribe(self, listener: ViewListener) -> None:
        """Have `listener` told of published views."""
        self._listeners.append(listener)

    def subscribe_failures(self, listener: FailureListener) -> None:
        """Have `listener` told of views that could not be made."""
        self._failure_listeners.append(listener)

    def subscribe_deaths(self, listener: DeathListener) -> None:
        """Have `listener` told of sites whose mapper died."""
        self._death_listeners.append(listener)

    def not_ready(self) -> list[str]:
        """Return which workers are not warm yet, or not there."""
        return self._compilation.reasons() or [
            slot.ailment or f"worker {slot.number} is warming up"
            for slot in self._slots
            if slot.ailment or not slot.ready.is_set()
        ]

    def trouble(self, site: int) -> str | None:
        """Return what is wrong with the site's worker."""
        hosted = self._sites.get(site)
        return None if hosted is None else hosted.slot.ailment

    def durations(self) -> Durations:
        """Return how long the workers' stages took so far."""
        return self._durations

    async def start_site(
        self,
        site: int,
        position: int,
        state: bytes | None,
        chapters: AsyncIterator[bytes] | None = None,
        parameters: Mapping[str, Any] | None = None,
        *,
        settled: bool = False,
    ) -> None:
        """Host a site on the worker that has fewest, or on the one that has it already."""
        hosted = self._sites.get(site)
        if hosted is None:
            slot = min(self._slots, key=lambda s: (len(s.sites), s.number))
            slot.sites.add(site)
            hosted = self._sites[site] = _Site(slot)
        await hosted.slot.ready.wait()
        hosted.fail(WorkerDiedError(None, "the site was started again", killed=False))
        hosted.run += 1
        hosted.process = hosted.slot.process
        hosted.gathering = chapters is not None
        if chapters is not None:
            await self._gather(site, hosted, chapters)
            hosted.gathering = False
        order = StartSite(site, hosted.run, position, state, parameters or {}, settled)
        await self._ask(hosted, order)

    async def _gather(self, site: int, hosted: _Site, chapters: AsyncIterator[bytes]) -> None:
        """Send chapters to the process that is there now, each when it has the one before."""
        run, process = hosted.run, hosted.process

        def check() -> None:
            """While a chapter was read nobody waited for an answer that could have told this."""
            if hosted.slot.process is not process:
                raise WorkerDiedError(None, hosted.slot.last_words, killed=False)
            if self._sites.get(site) is not hosted or hosted.run != run:
                raise WorkerDiedError(None, "the site was started again", killed=False)

        async for chapter in chapters:
            check()
            await self._ask(hosted, Chapter(site, run, chapter))
        check()

    def feed(
        self,
        site: int,
        entries: Sequence[LogEntry],
        through: int,
        *,
        caught_up: bool,
        publish: bool = False,
        settled: bool = False,
    ) -> Awaitable[object]:
        """Send entries to the site's worker."""
        hosted = self._sites[site]
        run, taken = hosted.run, tuple(entries)
        return self._ask(hosted, Feed(site, run, taken, through, caught_up, publish, settled))

    async def snapshot(self, site: int, known: int = 0) -> Snapshot:
        """Ask the site's worker for the mapper's state."""
        hosted = self._sites[site]
        snapshot: Snapshot = await self._ask(hosted, TakeSnapshot(site, hosted.run, known))
        return snapshot

    def ask(self, site: int, question: str, *arguments: object) -> Awaitable[Any]:
        """Ask the site's mapper."""
        hosted = self._sites.get(site)
        if hosted is None:
            raise WorkerDiedError(None, "the site is not hosted yet", killed=False)
        if hosted.gathering:
            raise WorkerDiedError(None, "the site is being resumed", killed=False)
        order = Ask(site, hosted.run, question, encode(arguments))
        return _answer(question, self._ask(hosted, order))

    def stop_site(self, site: int) -> None:
        """Host a site no longer."""
        hosted = self._sites.pop(site, None)
        if hosted is None:
            return
        hosted.slot.sites.discard(site)
        hosted.fail(WorkerDiedError(None, "the site was stopped", killed=False))
        if hosted.slot.process is not None:
            hosted.slot.process.send(StopSite(site))

    def _ask(
        self, hosted: _Site, order: Chapter | StartSite | Feed | TakeSnapshot | Ask
    ) -> asyncio.Future[Any]:
        """Send an order; its answer comes in turn, as a worker obeys in order."""
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        # Who asked may have stopped waiting: then the exception is nobody's business.
        answer.add_done_callback(lambda done: done.cancelled() or done.exception())
        process = hosted.slot.process
        # One that took a dead one's place knows nothing of the site until that is started there.
        if process is None or not process.ready or process is not hosted.process:
            answer.set_exception(WorkerDiedError(None, hosted.slot.last_words, killed=False))
        else:
            hosted.awaited.append(answer)
            process.send(order)
        return answer

    async def _watch(self) -> None:
        """A worker may hang and not die, in a solver or by a signal: then it is ended."""
        while True:
            await asyncio.sleep(LOOK_S)
            for slot in self._slots:
                slot.look(self._patience_s)

    async def _compile(self) -> None:
        try:
            await self._compilation.until_it_maps()
        except Exception:  # no threads, no disk: then each worker compiles what it needs
            _LOG.exception("kernels were not compiled beforehand")
        self._open_slots()

    def _open_slots(self) -> None:
        for slot in self._slots:
            slot.open()

    def _on_report(self, report: Report) -> None:
        if isinstance(report, Timed):
            self._durations.add(report.durations)
            return
        if isinstance(report, Ready):
            return  # its slot has seen to that
        hosted = self._sites.get(report.site)
        if hosted is None or hosted.run != report.run:
            return
        if isinstance(report, View):
            for listener in self._listeners:
                listener(report.site, report.position, report.view)
        elif isinstance(report, ViewFailed):
            for told in self._failure_listeners:
                told(report.site, report.position, report.reason)
        elif isinstance(report, Failed):
            hosted.fail(MapperFailedError(report.position, report.reason))
        elif isinstance(report, Started) and report.failure is not None:
            hosted.fail(ResumeFailedError(report.failure))
        elif hosted.awaited:
            _resolve(hosted.awaited.popleft(), report)

    def _on_death(self, slot: WorkerSlot, process: WorkerProcess) -> None:
        for number in slot.sites:
            site, blamed = self._sites[number], process.blamed
            position: int | None = None
            if blamed is not None and blamed[0] == number and blamed[1] != BUSY:
                position = blamed[1]
            elif blamed is None and site.gathering:
                position = RESTORING  # most likely it had no room for the chapters
            site.fail(WorkerDiedError(position, slot.last_words, killed=process.killed))
            for told in self._death_listeners:
                told(number)


def _start_worker(
    mapper: str,
    warm_up: str | None,
    publish_every_s: float,
    settle_after_s: float,
    name: str,
    on_report: Callable[[Report], None],
    on_death: Callable[[], None],
) -> WorkerProcess:
    return WorkerProcess(
        name, mapper, warm_up, publish_every_s, settle_after_s, on_report, on_death
    )


async def _answer(question: str, answered: Awaitable[bytes]) -> Any:
    """The answer to a question, read on a thread: it may be large."""
    data = await answered
    try:
        return await asyncio.to_thread(unpack_answer, question, data)
    except CodecError as error:
        raise QuestionFailedError(f"unreadable answer: {error}") from error


def _resolve(
    answer: asyncio.Future[Any], report: ChapterTaken | Fed | Started | SnapshotTaken | Answered
) -> None:
    if answer.done():
        return
    if isinstance(report, Answered) and report.failure is not None:
        answer.set_exception(QuestionFailedError(report.failure))
    elif isinstance(report, Answered):
        answer.set_result(report.value)
    elif isinstance(report, SnapshotTaken) and report.failure is not None:
        answer.set_exception(SnapshotFailedError(report.failure))
    else:
        answer.set_result(report.snapshot if isinstance(report, SnapshotTaken) else None)
