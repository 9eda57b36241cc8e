"""The service without its HTTP face: store, engine and matcher, started and stopped together."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from functools import partial

from lineloom import wire
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.body_budget import BodyBudget
from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.protocol import Engine
from lineloom_service.events.hub import EventHub
from lineloom_service.events.recorder import EventRecorder
from lineloom_service.floorplans import FloorPlans
from lineloom_service.maps.map_store import MapStore
from lineloom_service.matching import PairMatcher
from lineloom_service.observation.arrivals import Arrivals
from lineloom_service.observation.conflicts import Conflicts
from lineloom_service.observation.latency import Latency
from lineloom_service.observation.loads import Loads
from lineloom_service.observation.metrics import Metrics, SiteFigures
from lineloom_service.observation.storage_watch import StorageWatch
from lineloom_service.pacing import Pacer
from lineloom_service.plan_reading import PlanReader
from lineloom_service.security.guard import Guard
from lineloom_service.security.hosts import Hosts
from lineloom_service.security.quotas import Allowance, Quotas
from lineloom_service.security.token_book import read_tokens
from lineloom_service.settings import Settings
from lineloom_service.store.choice import database_at
from lineloom_service.store.protocol import NewsKind, Store
from lineloom_service.store.records import SiteRecord, StoreError
from lineloom_service.store.sql_store import SqlStore

_LOG = logging.getLogger(__name__)
_LOOK_S = 0.05
_LISTEN_S = 5.0


class Service:
    """What the routes work with. Store and engine may be given; the embedded ones are default."""

    def __init__(
        self, settings: Settings, *, store: Store | None = None, engine: Engine | None = None
    ) -> None:
        self.settings = settings
        self.store: Store = store or SqlStore(
            database_at(settings.database_url, settings.database_path),
            gap_window_s=settings.gap_window_s,
            max_held=settings.max_held,
            group_limit=settings.group_limit,
        )
        self.engine: Engine = engine or LocalEngine(
            settings.workers,
            publish_every_s=settings.publish_every_s,
            settle_after_s=settings.settle_after_s,
            patience_s=settings.entry_timeout_s,
        )
        self.events = EventHub()
        self._recorder = EventRecorder(self.store, self.events, settings.event_history)
        self.conductor = Conductor(self.store, self.engine, settings, self._recorder)
        self.pacer = Pacer()
        self.bodies = BodyBudget(settings.max_bodies_bytes)
        self.maps = MapStore(settings.map_cache_bytes)
        self.store.subscribe_news(self._on_news)
        self.matcher = PairMatcher()
        self.floorplans = FloorPlans(self.store)
        self.plans = PlanReader()
        self.guard = Guard(partial(self.store.read, read_tokens))
        self.hosts = Hosts((*settings.allow_hosts, settings.host), settings.allow_origins)
        self.quotas = Quotas(
            Allowance(settings.token_requests, settings.token_streams, settings.token_rate)
        )
        self.storage = StorageWatch(self.store.check)
        self.metrics = Metrics()
        self.conflicts = Conflicts()
        self._latency = Latency()
        self.arrivals = Arrivals(settings.silent_after_s)
        self.loads = Loads(self.conductor.processed)
        self._sites_seen: list[SiteRecord] = []
        self.metrics.watch(
            self.site_figures, self.engine.durations, self._latency.histogram, self.readiness
        )
        self._warming: asyncio.Task[None] | None = None
        self._listening: asyncio.Task[None] | None = None
        self._taking = False

    async def start(self) -> None:
        """Open the store and begin to map. Readiness comes later.

        Raises StoreError, and UnprotectedError where others could come in.
        """
        await self.store.open()
        try:
            await self.guard.start(self.settings.host, open=self.settings.open)
        except BaseException:
            await self.store.close()
            raise
        for record in await self.store.sites():
            self.arrivals.begin(record)
        self.store.subscribe(self._latency.on_commit)
        self.store.subscribe(self.arrivals.on_commit)
        self.store.subscribe(self.loads.on_commit)
        self.conductor.subscribe(self._latency.on_view)
        self.conductor.subscribe(self._on_view)
        await self.conductor.start()
        self._taking = True
        self._warming = asyncio.create_task(self._warm_up())
        self._warming.add_done_callback(_report_failure)
        self._listening = asyncio.create_task(self._listen())
        self._listening.add_done_callback(_report_failure)

    async def stop(self) -> None:
        """Save and close. What was answered 202 is safe in any case."""
        self._taking = False
        for task in (self._warming, self._listening):
            if task is not None:
                task.cancel()
        self.matcher.close()
        await self.guard.stop()
        await self.conductor.stop()
        await self.store.close()

    async def _warm_up(self) -> None:
        """Load the matcher's kernels; where workers compile them, once they have.

        The compiler would keep 300 MB of this process for as long as it runs.
        """
        while self.conductor.maps and self.engine.not_ready():
            await asyncio.sleep(_LOOK_S)
        await self.matcher.warm_up()

    async def _listen(self) -> None:
        """Tell of robots that fall silent, and of those that are heard again."""
        while True:
            await asyncio.sleep(min(_LISTEN_S, 0.25 * self.settings.silent_after_s))
            with contextlib.suppress(StoreError):
                for record in await self.store.sites():
                    turned = self.arrivals.turned(record)
                    if not turned or not self.conductor.maps:
                        continue
                    if await self._recorder.tell_silence(record.id, turned):
                        self.arrivals.note_told(record.id, turned)

    def _on_view(self, site_id: int, _position: int, _view: SiteView) -> None:
        # Not this very view: one from before a restart is not shown.
        self.maps.prepare(site_id, self.conductor.published(site_id).view)

    def _on_news(self, kind: NewsKind, key: str) -> None:
        if kind == "events":
            self.events.wake(int(key))

    async def look_around(self) -> None:
        """Find out which sites there are, and whether more can be stored, for the figures."""
        await self.look_at_storage()
        with contextlib.suppress(StoreError):  # the figures are wanted most while it fails
            self._sites_seen = await self.store.sites()

    def site_figures(self) -> list[SiteFigures]:
        """Return how every site is doing."""
        return [
            SiteFigures(
                record.name,
                max(0, record.position - published.position),
                record.held,
                published.view,
                0 if remaking is None else max(0, remaking.of - remaking.position),
                self.trouble(record.id) is not None,
                self.arrivals.silent(record),
            )
            for record in self._sites_seen
            for published in [self.conductor.published(record.id)]
            for remaking in [self.conductor.remaking(record.id)]
        ]

    def not_ready(self) -> list[str]:
        """Return why scans are not mapped, or pairs not matched at once; empty when they are."""
        return self.conductor.not_ready() + self.matcher.not_ready()

    def trouble(self, site_id: int) -> str | None:
        """Return what is wrong with a site now, in words; None where all is well."""
        failure = self.storage.failure
        taken = None if failure is None else f"nothing can be taken: {failure}"
        return "; ".join(filter(None, (taken, self.conductor.trouble(site_id)))) or None

    async def look_at_storage(self) -> None:
        """Find out whether more can be stored, for those who ask next."""
        if self._taking:
            await self.storage.look()

    def readiness(self) -> wire.Readiness:
        """Return whether scans are taken, whether they are mapped, and why not."""
        missing = self.not_ready()
        refuses = self.storage.failure
        if not self._taking:
            refuses = "the service is not open: it starts or stops"
        return wire.Readiness(
            takes_scans=refuses is None,
            maps=self._taking and not missing,
            reasons=([] if refuses is None else [refuses]) + missing,
        )


def _report_failure(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        _LOG.critical("a task of the service ended", exc_info=task.exception())
