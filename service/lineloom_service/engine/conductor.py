"""Brings every site's log into its map: between the store and the engine."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from typing import Any

import lineloom_core
from lineloom_core.mapping.site_view import SiteView

from lineloom_service.engine.protocol import Engine, Recorder
from lineloom_service.engine.site_runner import Pace, Published, SiteRunner
from lineloom_service.settings import Settings
from lineloom_service.store.protocol import Store
from lineloom_service.store.records import SiteRecord, Skip

_LOOK_AGAIN_S = 0.02

_LOG = logging.getLogger(__name__)

EMPTY_VIEW = SiteView(
    version=0,
    robots={},
    components=(),
    merged_into={},
    trajectories={},
    lines=(),
    keyframes=(),
    constraints=(),
)
NOTHING = Published(0, 0, 0, EMPTY_VIEW)
"""What is known of a site before its first view."""


class Conductor:
    """One SiteRunner per site, and the latest view of each for the queries."""

    def __init__(
        self,
        store: Store,
        engine: Engine,
        settings: Settings,
        recorder: Recorder | None = None,
    ) -> None:
        self._store = store
        self._engine = engine
        self._recorder = recorder
        self._pace = Pace(settings.chunk, settings.snapshot_every, settings.snapshot_idle_s)
        self._stop_grace_s = settings.stop_grace_s
        self._runners: dict[int, SiteRunner] = {}
        self._tasks: dict[int, asyncio.Task[None]] = {}
        self._forgetting: set[asyncio.Task[None]] = set()
        self._stopping = False

    async def start(self) -> None:
        """Start the engine and every site that the store knows."""
        self._store.subscribe(self._on_commit)
        self._engine.subscribe(self._on_view)
        await self._engine.start()
        for record in await self._store.sites():
            if record.id not in self._runners:
                self._runner(record)

    async def stop(self) -> None:
        """Save what was mapped since the last snapshots, as far as the grace period allows."""
        self._stopping = True
        for task in self._tasks.values():
            task.cancel()
        await asyncio.gather(*self._tasks.values(), return_exceptions=True)
        savings = [asyncio.ensure_future(runner.finish()) for runner in self._runners.values()]
        if savings:
            _, late = await asyncio.wait(savings, timeout=self._stop_grace_s)
            for saving in late:
                saving.cancel()
            await asyncio.gather(*savings, return_exceptions=True)
        if self._recorder is not None:
            await self._recorder.stop()
        await self._engine.stop()

    def published(self, site_id: int) -> Published:
        """Return the latest view of a site; never waits."""
        runner = self._runners.get(site_id)
        return NOTHING if runner is None or runner.published is None else runner.published

    async def ask(self, site_id: int, question: str, *arguments: object) -> Any:
        """Ask a site's mapper; it may be in the middle of a chunk of scans.

        Raises WorkerDiedError where it is not running, QuestionFailedError where it cannot say.
        """
        return await self._engine.ask(site_id, question, *arguments)

    async def reached(self, site_id: int, position: int, within_s: float) -> bool:
        """Wait until the published view holds the entry at `position`; False if it takes longer."""
        deadline = asyncio.get_running_loop().time() + within_s
        while self.published(site_id).position < position:
            if asyncio.get_running_loop().time() > deadline:
                return False
            await asyncio.sleep(_LOOK_AGAIN_S)
        return True

    def skips(self, site_id: int) -> list[Skip]:
        """Return the entries of a site that are not in its map for good."""
        runner = self._runners.get(site_id)
        return [] if runner is None else [runner.skips[at] for at in sorted(runner.skips)]

    def not_ready(self) -> list[str]:
        """Return what is missing before scans are mapped and queries answer as before."""
        restoring = [r.name for r in self._runners.values() if not r.restored.is_set()]
        return self._engine.not_ready() + [f"site {name} is being restored" for name in restoring]

    async def forget_site(self, site_id: int) -> None:
        """Stop mapping a site that was deleted."""
        self._runners.pop(site_id, None)
        task = self._tasks.pop(site_id, None)
        if task is not None:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
        self._engine.stop_site(site_id)
        if self._recorder is not None:
            self._recorder.forget_site(site_id)

    def _runner(self, record: SiteRecord) -> SiteRunner:
        runner = SiteRunner(
            record,
            self._store,
            self._engine,
            self._pace,
            lineloom_core.__version__,
            self._recorder,
        )
        self._runners[record.id] = runner
        task = asyncio.create_task(runner.run(), name=f"site-{record.name}")
        task.add_done_callback(_report_end)
        self._tasks[record.id] = task
        return runner

    def _on_commit(self, record: SiteRecord) -> None:
        if self._stopping:
            return
        runner = self._runners.get(record.id)
        if record.deleted:
            forgetting = asyncio.create_task(self.forget_site(record.id))
            self._forgetting.add(forgetting)
            forgetting.add_done_callback(self._forgetting.discard)
        elif runner is None:
            # New: nothing to restore, so it does not keep the service from being ready.
            self._runner(record).restored.set()
        else:
            runner.on_commit(record)

    def _on_view(self, site_id: int, position: int, view: SiteView) -> None:
        runner = self._runners.get(site_id)
        if runner is not None:
            runner.on_view(position, view)


def _report_end(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        _LOG.critical("%s is no longer mapped", task.get_name(), exc_info=task.exception())
