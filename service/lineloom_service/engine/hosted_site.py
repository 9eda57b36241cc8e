"""A site as the process that maps has it: what is shown, and what is made to be shown next.

Other parameters or other code make another map of the same log. It is made from the first scan,
beside the one that is shown, which goes on being fed; once it is as far, it takes its place.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.engine.back_fill import BackFill
from lineloom_service.engine.making import LATE, Making, former_making
from lineloom_service.engine.protocol import Engine, Recorder, Remade, WorkerDiedError
from lineloom_service.engine.published import NOTHING, Published
from lineloom_service.engine.site_runner import Pace, SiteRunner
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_last_events
from lineloom_service.store.records import SiteRecord
from lineloom_service.store.snapshots import saved_position

_LOG = logging.getLogger(__name__)
_AGAIN_S = 1.0


@dataclass(frozen=True, slots=True)
class Remaking:
    """The map that will be shown instead: at entry `position` of `of`. why: it is made."""

    position: int
    of: int
    why: str


async def remaking_elsewhere(store: Store, record: SiteRecord) -> Remaking | None:
    """Return the same as far as the store has it, for a process that does not map: it is saved."""
    unasked = record.config is None and not record.order
    told = None if unasked else await store.read(read_last_events, record.id)
    ordered = Making.of(record)
    if told is None or told.producer == ordered.id:
        return None
    saved = await store.read(saved_position, record.id, ordered.id)
    return Remaking(saved, record.position, ordered.why_not(told.producer))


@dataclass(frozen=True, slots=True)
class Means:
    """What sites are mapped with. keep, stored: save the view of a site, and read that one."""

    store: Store
    engine: Engine
    pace: Pace
    recorder: Recorder | None
    keep: Callable[[int, Published], None]
    stored: Callable[[int], Awaitable[Published | None]]


class HostedSite:
    """One site while this process maps it. new: nothing of it was ever answered."""

    def __init__(self, record: SiteRecord, means: Means, *, new: bool = False) -> None:
        self.new = new
        self._record = record
        self._means = means
        self._target = Making.of(record)
        self._served: SiteRunner | None = None
        self._next: SiteRunner | None = None
        self._former: Published | None = None
        """What is shown where nothing maps it any more: other code made it."""
        self._unopened: str | None = None
        self._told = 0
        self._why = ""
        self._generation = 0
        self._tasks: dict[SiteRunner, asyncio.Task[None]] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self._back_fill = BackFill(
            means.store, record, means.pace.back_fill_after_s, lambda: self._next is not None
        )
        self._back_fill.on_commit(record)
        self._opening = asyncio.create_task(self._open(), name=f"open-{record.name}")
        self._opening.add_done_callback(_report_end)

    @property
    def name(self) -> str:
        """The site's name."""
        return self._record.name

    @property
    def published(self) -> Published:
        """The view that is shown."""
        if self._served is None:
            return self._former or NOTHING
        return self._served.published or NOTHING

    @property
    def done(self) -> int:
        """The position that the mapper is through whose map is shown."""
        return 0 if self._served is None else self._served.done

    @property
    def trouble(self) -> str | None:
        """Why the site is not mapped, shown or saved just now; None where all is well."""
        found = [
            *self._own_troubles(),
            *(runner.damage for runner in self._runners),
            *(self._means.engine.trouble(r.host) for r in self._runners),
        ]
        return "; ".join(dict.fromkeys(text for text in found if text)) or None

    @property
    def _runners(self) -> list[SiteRunner]:
        return [runner for runner in (self._served, self._next) if runner is not None]

    def _own_troubles(self) -> list[str]:
        """What is wrong with this site, and not with the worker that others are on as well."""
        found = (self._unopened, *(runner.trouble for runner in self._runners))
        return [text for text in found if text]

    @property
    def remaking(self) -> Remaking | None:
        """How far what will be shown next is; None where nothing is made."""
        if self._next is None:
            return None
        return Remaking(self._next.done, self._record.position, self._why)

    def unfinished(self, shown: int) -> str | None:
        """Say how far the map is where it is not as far again as it was; None where it is.

        shown: position of the view that queries see.
        """
        runner = self._served
        # One site in trouble does not keep the others from being served.
        if self.new or self._own_troubles() or self._former is not None:
            return None
        if runner is None:
            return f"site {self.name} is being opened"
        if runner.published is not None and shown >= runner.expected:
            return None
        done, expected = runner.done, runner.expected
        far = f": entry {done} of {expected}" if done < expected else ""
        return f"site {self.name} is being resumed{far}"

    def host(self) -> int:
        """Return the engine's number for the mapper that answers. Raises WorkerDiedError."""
        if self._served is None:
            raise WorkerDiedError(None, "the site's map is being made anew", killed=False)
        return self._served.host

    def on_commit(self, record: SiteRecord) -> None:
        """There may be more to feed, and other parameters."""
        changed = (record.config, record.order) != (self._record.config, self._record.order)
        self._record = record
        for runner in self._tasks:
            runner.on_commit(record)
        if changed and self._opening.done():
            self._follow()
        self._back_fill.on_commit(record)

    def on_view(self, host: int, position: int, view: SiteView) -> bool:
        """Take what a worker published; True where it is shown."""
        runner = next((r for r in self._tasks if r.host == host), None)
        if runner is None:
            return False
        runner.on_view(position, view)
        if runner is self._next and self._is_as_far(runner):
            self._swap(runner)
        return runner is self._served

    def on_view_failed(self, host: int, position: int, reason: str) -> None:
        """The last view stands."""
        for runner in self._tasks:
            if runner.host == host:
                runner.on_view_failed(position, reason)

    def on_death(self, host: int) -> None:
        """Have it mapped again, even where there is nothing to map: there may be questions."""
        for runner in self._tasks:
            if runner.host == host:
                runner.on_death()

    async def end(self) -> list[SiteRunner]:
        """Feed no longer; return those that may still `finish`."""
        self._opening.cancel()
        await self._back_fill.end()
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(self._opening, *self._tasks.values(), return_exceptions=True)
        return list(self._tasks)

    async def forget(self) -> None:
        """Host the site no longer: it was deleted."""
        for runner in await self.end():
            self._means.engine.stop_site(runner.host)
        self._tasks.clear()

    async def _open(self) -> None:
        """Find out what is shown: mostly what the log orders, else what was told of last."""
        while True:
            try:
                await self._find_served()
            except Exception as error:  # whatever it is: a site is never given up
                if self._unopened is None:
                    _LOG.exception("site %s: cannot be opened, trying again", self.name)
                self._unopened = f"what was shown of it cannot be read: {error}"
                await asyncio.sleep(_AGAIN_S)
            else:
                self._unopened = None
                break
        self._follow()

    async def _find_served(self) -> None:
        store, recorder, target = self._means.store, self._means.recorder, self._target
        told = None if recorder is None else await recorder.told_of(self._record.id)
        if recorder is None or told is None or told == target.id:
            self._served = self._run(target, recorder)
            return
        why = target.why_not(told)
        former = await former_making(store, self._record.id, told, target)
        if former is not None:
            self._served = self._run(former, recorder)
        else:
            self._told = await recorder.recorded_position(self._record.id)
            self._former = await self._means.stored(self._record.id)
            if self._former is None:
                _LOG.warning("site %s: made anew and shown as it grows: %s", self.name, why)
                self._served = self._run(target, recorder)
                return
        self._begin_next(target, why)

    def _follow(self) -> None:
        """Begin to make what the log orders, where that is something new."""
        target = Making.of(self._record)
        if target.id == self._target.id:
            return
        why = "" if self._served is None else target.why_not(self._served.making.id)
        self._target = target
        if self._next is not None:
            self._drop(self._next)
            self._next = None
        if self._served is None:
            self._begin_next(target, self._why)
        elif self._record.accepted == 0:  # nothing of it is shown yet
            self._drop(self._served)
            self._served = self._run(target, self._means.recorder)
        else:
            self._begin_next(target, why)

    def _begin_next(self, target: Making, why: str) -> None:
        _LOG.warning("site %s: its map is made anew, beside the one shown: %s", self.name, why)
        self._why = why
        self._next = self._run(target, None, self._served if why == LATE else None)

    def _is_as_far(self, runner: SiteRunner) -> bool:
        published = runner.published
        making = runner.making
        far = max(self.published.position, making.since, making.order, self._told)
        return published is not None and published.position >= far

    def _swap(self, runner: SiteRunner) -> None:
        """Show what was made beside, from its view of just now on."""
        before, after = self.published, runner.published
        assert after is not None
        if self._served is not None:
            self._drop(self._served)
        self._served, self._next, self._former = runner, None, None
        if (recorder := self._means.recorder) is not None:
            made = Remade(after.position, after.view, runner.making.id, before.view, self._why)
            recorder.on_remade(self._record.id, made)
        runner.serve(recorder)
        _LOG.warning(
            "site %s: the map made anew is shown from entry %d on", self.name, after.position
        )

    def _run(
        self, making: Making, recorder: Recorder | None, former: SiteRunner | None = None
    ) -> SiteRunner:
        means = self._means
        runner = SiteRunner(
            self._record, means.store, means.engine, means.pace, making, recorder,
            generation=self._generation, former=None if former is None else former.making,
            on_saved=self._keep_view,
        )  # fmt: skip
        self._generation += 1
        task = asyncio.create_task(runner.run(), name=f"site-{self.name}")
        task.add_done_callback(_report_end)
        self._tasks[runner] = task
        return runner

    def _keep_view(self, runner: SiteRunner) -> None:
        """Other code can show the view, and cannot go on from the snapshot."""
        if runner is self._served and runner.published is not None:
            self._means.keep(self._record.id, runner.published)

    def _drop(self, runner: SiteRunner) -> None:
        task = self._tasks.pop(runner)
        task.cancel()
        ending = asyncio.create_task(self._end(runner, task))
        self._ending.add(ending)
        ending.add_done_callback(self._ending.discard)

    async def _end(self, runner: SiteRunner, task: asyncio.Task[None]) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            await task
        self._means.engine.stop_site(runner.host)


def _report_end(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        _LOG.critical("%s is no longer mapped", task.get_name(), exc_info=task.exception())
