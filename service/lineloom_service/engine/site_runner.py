"""One site's way from the log into the map: resume, feed, save, and what to do when it fails."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.engine.damaged_entries import describe_damage, read_the_whole_ones
from lineloom_service.engine.making import Making, host_of
from lineloom_service.engine.protocol import (
    Engine,
    MapperFailedError,
    Recorder,
    ResumeFailedError,
    SnapshotFailedError,
    WorkerDiedError,
)
from lineloom_service.engine.published import Published
from lineloom_service.store.actions import record_skip
from lineloom_service.store.feed_order import FeedOrder, read_order
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_feed, read_skips
from lineloom_service.store.records import (
    SCANS,
    ChapterLostError,
    DamagedError,
    LogEntry,
    SiteRecord,
    Skip,
    SnapshotRecord,
    StoreError,
)
from lineloom_service.store.snapshots import (
    drop_snapshot,
    read_chapters,
    read_snapshot,
    save_snapshot,
)

_LOG = logging.getLogger(__name__)

_FEEDS_UNDER_WAY = 2
"""One being mapped, the next one waiting at the worker's door."""

_AGAIN_S = 1.0
_GATHER_S = 0.02
"""A site that was idle waits so long for more: one by one, scans cost several times as much."""

_SAVE_AGAIN_S = 5.0
"""After a failure: it will likely fail again, and mapping goes on without."""

_STRIKES = {"raised": 2, "crashed": 3, "killed": 10}
"""An entry is skipped after so many failures without a success in between.

Raising is deterministic, and the second time excludes a passing shortage. A crash is likely the
entry's fault. SIGKILL most likely is not: an operator, or the kernel short of memory.
"""


@dataclass(frozen=True, slots=True)
class Pace:
    """How much at a time, and how often saved; see Settings."""

    chunk: int
    snapshot_every: int
    snapshot_idle_s: float
    back_fill_after_s: float = 2.0


class SiteRunner:
    """Feeds one site for as long as its task runs."""

    def __init__(
        self,
        record: SiteRecord,
        store: Store,
        engine: Engine,
        pace: Pace,
        making: Making,
        recorder: Recorder | None = None,
        *,
        generation: int = 0,
        former: Making | None = None,
        on_saved: Callable[[SiteRunner], None] = lambda _: None,
    ) -> None:
        """former: whose snapshots may serve, up to where the order of the feed is another."""
        self._on_saved = on_saved
        self.making = making
        self._former = former
        self._order = FeedOrder()
        self.host = host_of(record.id, generation)
        """The engine's number for it."""
        self.site = record.id
        self.name = record.name
        self.skips: dict[int, Skip] = {}
        self.published: Published | None = None
        self.expected = 0
        """Only a view at this position, or later, answers as was answered before the start."""
        self._end = record.position
        self._store = store
        self._engine = engine
        self._pace = pace
        self._recorder = recorder
        self._recorded, self._recorded_settled = 0, False
        self._wake = asyncio.Event()
        self._died = False
        self._strikes: Counter[int] = Counter()
        self._troubles: dict[str, str] = {}
        self._save_at = 0.0
        self._sent = self._done = self._saved = 0
        self._chapters = 0
        """How many of the mapper's chapters are saved."""
        self._scans_sent = self._scans_done = 0
        self._marks: dict[int, int] = {}
        self._under_way: deque[tuple[asyncio.Future[object], int, int]] = deque()

    @property
    def trouble(self) -> str | None:
        """Why the site is not mapped, shown or saved just now; None where all is well."""
        return "; ".join(self._troubles.values()) or None

    @property
    def damage(self) -> str | None:
        """Which entries of the log cannot be read any more and are left out; None: none."""
        return describe_damage(self.skips.values())

    @property
    def done(self) -> int:
        """The position that the mapper is through."""
        return self._done

    def on_commit(self, record: SiteRecord) -> None:
        """There may be more to feed."""
        self._end = record.position
        self._wake.set()

    def on_view(self, position: int, view: SiteView) -> None:
        """Take what the worker published; a replay does not take queries back in time."""
        if self.published is not None and (position, view.settled) < self.published.rank:
            return
        scans = self._marks.get(position, self._scans_done)
        number = self._order.number
        left_out = tuple(s for _, s in sorted(self.skips.items()) if number(s.position) <= position)
        skipped = sum(skip.kind in SCANS for skip in left_out)
        self.published = Published(position, scans, skipped, view, left_out)
        self._marks = {at: n for at, n in self._marks.items() if at >= position}
        self._troubles.pop("view", None)
        if self._recorder is not None:
            self._recorder.on_view(self.site, position, view, self.making.id)

    def on_view_failed(self, position: int, reason: str) -> None:
        """The last view stands."""
        self._troubles["view"] = f"its map after entry {position} cannot be shown: {reason}"

    def on_death(self) -> None:
        """The mapper is gone; where it had nothing to do, nobody else would tell."""
        self._died = True
        self._wake.set()

    async def run(self) -> None:
        """Keep the site hosted and fed, whatever happens to its worker."""
        while True:
            try:
                self.skips = {s.position: s for s in await self._store.read(read_skips, self.site)}
                await self._host()
            except MapperFailedError as failure:
                await self._strike(failure.position, "raised", failure.reason)
            except WorkerDiedError as death:
                if death.position is not None:
                    how = "killed" if death.killed else "crashed"
                    await self._strike(death.position, how, death.reason)
            except (ResumeFailedError, ChapterLostError) as failure:
                await self._drop_snapshot(str(failure))
            except StoreError as error:
                if "log" not in self._troubles:
                    _LOG.exception("site %s: its log cannot be read, trying again", self.name)
                self._troubles["log"] = f"its log cannot be read: {error}"
                await asyncio.sleep(_AGAIN_S)
            except Exception as error:  # no threads, no memory: a site is never given up
                if "unforeseen" not in self._troubles:
                    _LOG.exception("site %s: an unexpected error, trying again", self.name)
                kind = type(error).__name__
                self._troubles["unforeseen"] = f"it cannot be mapped: {kind}: {error}"
                await asyncio.sleep(_AGAIN_S)

    async def save(self) -> None:
        """Save a snapshot if anything was mapped since the last one. Nothing may be under way.

        Where it cannot be saved, the site says so and goes on: a restart maps again what is not.
        """
        if self._done == self._saved:
            return
        if self._recorder is not None:
            # Events are never behind the snapshots: a restart finds the view they go on from.
            await self._engine.feed(
                self.host, [], self._done, caught_up=self._done >= self._end, publish=True
            )
            await self._recorder.settled(self.site)
        try:
            taken = await self._engine.snapshot(self.host, self._chapters)
            record = SnapshotRecord(
                self._done,
                self._scans_done,
                self.making.id,
                taken.state,
                taken.first,
                taken.chapters,
            )
            await self._store.write_as_engine(save_snapshot, self.site, record)
        except (SnapshotFailedError, StoreError) as error:
            if "saving" not in self._troubles:
                _LOG.exception("site %s: its map cannot be saved, trying again", self.name)
            self._troubles["saving"] = f"its map is not saved beyond entry {self._saved}: {error}"
            self._save_at = time.monotonic() + _SAVE_AGAIN_S
        else:
            self._troubles.pop("saving", None)
            self._saved, self._chapters = self._done, record.end
            self._on_saved(self)

    def serve(self, recorder: Recorder | None) -> None:
        """Be the one that is shown from now on."""
        self._recorder = recorder

    async def finish(self) -> None:
        """After `run` was cancelled: wait for what is under way and save."""
        await self._drain()
        await self.save()

    async def _host(self) -> None:
        if self._recorder is not None:
            self._recorded = await self._recorder.recorded_position(self.site)
            self._recorded_settled = await self._recorder.recorded_settled(self.site)
        await self._resume()
        self._troubles.pop("start", None)
        self._troubles.pop("unforeseen", None)
        while True:
            if self._died:
                raise WorkerDiedError(None, "its mapper died", killed=False)
            self._wake.clear()
            while self._sent < self._end and len(self._under_way) < _FEEDS_UNDER_WAY:
                await self._send()
            if self._under_way:
                await self._await_one()
            elif self._sent >= self._end:
                await self._idle()
            unsaved = self._done - self._saved
            if unsaved >= self._pace.snapshot_every and time.monotonic() >= self._save_at:
                await self._drain()
                await self.save()

    async def _resume(self) -> None:
        """Start from the latest snapshot, or from nothing."""
        self._died = False
        self._order = await self._store.read(read_order, self.site, self.making.order)
        snapshot = await self._newest_snapshot()
        self._chapters = 0 if snapshot is None else snapshot.end
        if snapshot is None and self._former is not None:
            snapshot = await self._snapshot_of(self._former)
        self._saved = 0 if snapshot is None else snapshot.position
        self._scans_sent = self._scans_done = 0 if snapshot is None else snapshot.scans
        self._sent = self._done = self._saved
        # What was answered from is recorded or saved, the later of the two; the log has it all.
        self.expected = min(self._end, max(self.expected, self._recorded, self._saved))
        self._marks = {self._done: self._scans_done}
        self._under_way.clear()
        if snapshot is None:
            parameters = self.making.parameters
            await self._engine.start_site(self.host, 0, None, parameters=parameters)
        else:
            chapters = read_chapters(self._store, self.site, snapshot)
            settled = self._recorded_settled and self._saved == self._recorded
            await self._engine.start_site(
                self.host, self._saved, snapshot.data, chapters, settled=settled
            )

    async def _snapshot_of(self, former: Making) -> SnapshotRecord | None:
        """Return what another order of the log left, up to where both are the same."""
        order = await self._store.read(read_order, self.site, former.order)
        alike = self._order.alike(order)
        return await self._store.read(read_snapshot, self.site, former.id, alike)

    async def _newest_snapshot(self) -> SnapshotRecord | None:
        try:
            found = await self._store.read(read_snapshot, self.site, self.making.id)
        except DamagedError as error:
            self._troubles["saving"] = f"its snapshot cannot be read: {error}"
            return None
        return found

    async def _send(self) -> None:
        # The next events go on from the view right there, so that view has to be published.
        short_of = self._recorded - self._sent
        limit = min(self._pace.chunk, short_of) if short_of > 0 else self._pace.chunk
        entries = await self._read(limit)
        if not entries:  # the site was deleted: its runner is about to be stopped
            self._end = self._sent
            return
        wanted: list[LogEntry] = [e for e in entries if self._is_for_it(e)]
        self._troubles.pop("log", None)
        self._sent = self._order.number(entries[-1].position)
        self._scans_sent += sum(entry.kind in SCANS for entry in wanted)
        self._marks[self._sent] = self._scans_sent
        answer = self._engine.feed(
            self.host,
            wanted,
            self._sent,
            caught_up=self._sent >= self._end,
            publish=self._sent == self._recorded,
            settled=self._sent == self._recorded and self._recorded_settled,
        )
        self._under_way.append((asyncio.ensure_future(answer), self._sent, self._scans_sent))

    async def _read(self, limit: int) -> list[LogEntry]:
        """Read on. What is damaged is left out for good: the rest of the log is not."""
        try:
            return await self._store.read(read_feed, self.site, self._sent, limit, self._order)
        except DamagedError:
            count = min(limit, self._end - self._sent)
            return await read_the_whole_ones(
                self._store, self.site, self._order, self._sent, count, self.skips
            )

    def _is_for_it(self, entry: LogEntry) -> bool:
        # What orders another making is not for this one: so the other's version is the greater.
        making = self.making
        later = entry.kind == "config" and entry.position > making.since
        late = entry.kind == "late" and entry.position > making.order
        return entry.position not in self.skips and not later and not late and entry.kind != "order"

    async def _await_one(self) -> None:
        answer, position, scans = self._under_way[0]
        await asyncio.shield(answer)  # a cancelled runner may still `finish`
        self._under_way.popleft()
        self._done, self._scans_done = position, scans
        for struck in [p for p in self._strikes if self._order.number(p) <= position]:
            del self._strikes[struck]

    async def _drain(self) -> None:
        while self._under_way:
            await self._await_one()

    async def _idle(self) -> None:
        self._troubles.pop("log", None)  # nothing is left to read
        pause = None
        if self._done != self._saved:
            pause = max(self._pace.snapshot_idle_s, self._save_at - time.monotonic())
        try:
            # Not `wait_for`: that may lose a cancellation that comes together with the event.
            async with asyncio.timeout(pause):
                await self._wake.wait()
        except TimeoutError:
            await self.save()
        else:
            await asyncio.sleep(_GATHER_S)

    async def _strike(self, position: int, how: str, reason: str) -> None:
        self._strikes[position] += 1
        _LOG.warning(
            "site %s, entry %d: the mapper %s (%d): %s",
            self.name,
            position,
            how,
            self._strikes[position],
            reason,
        )
        if self._strikes[position] < _STRIKES[how]:
            return
        if position <= 0:  # while restoring, not on an entry
            del self._strikes[position]
            await self._drop_snapshot(reason)
            return
        try:
            await self._store.write_as_engine(record_skip, self.site, position, reason)
        except StoreError:
            _LOG.exception("site %s: entry %d could not be skipped", self.name, position)
            await asyncio.sleep(1.0)

    async def _drop_snapshot(self, reason: str) -> None:
        """Go back to the snapshot before, or to the log."""
        if self._saved == 0:
            _LOG.error("site %s: the mapper does not start: %s", self.name, reason)
            self._troubles["start"] = f"its mapper does not start: {reason}"
            await asyncio.sleep(5.0)
            return
        _LOG.error("site %s: snapshot %d is unreadable: %s", self.name, self._saved, reason)
        try:
            await self._store.write_as_engine(drop_snapshot, self.site, self._saved)
        except StoreError:
            _LOG.exception("site %s: snapshot %d could not be removed", self.name, self._saved)
            await asyncio.sleep(_AGAIN_S)
