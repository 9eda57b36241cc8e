"""Brings every site's log into its map: between the store and the engine.

Of all processes that share a store one maps, the others answer from the views that it saves and
wait for their turn.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Any

from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.engine.forwarding import Forwarding
from lineloom_service.engine.hosted_site import (
    HostedSite,
    Means,
    Remaking,
    remaking_elsewhere,
)
from lineloom_service.engine.making import site_of
from lineloom_service.engine.protocol import Engine, Recorder, ViewListener, WorkerDiedError
from lineloom_service.engine.published import NOTHING, Published
from lineloom_service.engine.shared_views import SharedViews
from lineloom_service.engine.site_runner import Pace, SiteRunner
from lineloom_service.settings import Settings
from lineloom_service.site_config import first_config, to_order
from lineloom_service.store.actions import begin_sites_with, configure
from lineloom_service.store.database import Claim, ClaimedError
from lineloom_service.store.protocol import NewsKind, Store
from lineloom_service.store.records import SiteRecord, Skip, StoreError

_LOOK_AGAIN_S = 0.02

_LOG = logging.getLogger(__name__)
_AGAIN_S = 1.0


class Conductor:
    """All sites while it is this process that maps; the latest view of each."""

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
        pace = Pace(
            settings.chunk,
            settings.snapshot_every,
            settings.snapshot_idle_s,
            settings.back_fill_after_s,
        )
        self._stop_grace_s = settings.stop_grace_s
        self._mode = settings.engine
        self._base = settings.mapper
        self._sites: dict[int, HostedSite] = {}
        self._views = SharedViews(store)
        self._means = Means(store, engine, pace, recorder, self._views.save, self._views.load)
        self._listeners: list[ViewListener] = []
        self._forwarding = Forwarding(store, self._ask_here)
        self._turns: asyncio.Task[None] | None = None
        self._forgetting: set[asyncio.Task[None]] = set()
        self._mapping = self._was_standby = self._beginning = False

    @property
    def maps(self) -> bool:
        """Whether it is this process that maps."""
        return self._mapping

    async def start(self) -> None:
        """Map every site that the store knows, or answer from what another process maps."""
        await self._store.write(begin_sites_with, first_config(self._base))
        self._store.subscribe(self._on_commit)
        self._store.subscribe_news(self._on_news)
        self._engine.subscribe(self._on_view)
        self._engine.subscribe_failures(self._on_view_failed)
        self._engine.subscribe_deaths(self._on_death)
        if self._store.shared:
            for record in await self._store.sites():
                self._views.fetch(record.id)
        if self._mode == "off":
            _LOG.warning("this process answers and takes scans, and never maps")
            return
        claim = await self._first_claim()
        if claim is not None:
            await self._begin()
        if self._store.shared:
            self._turns = asyncio.create_task(self._take_turns(claim), name="mapping-turns")

    async def stop(self) -> None:
        """Save what was mapped since the last snapshots, as far as the grace period allows."""
        if self._turns is not None:
            self._turns.cancel()
            await asyncio.gather(self._turns, return_exceptions=True)
        runners = await self._end_sites()
        savings = [asyncio.ensure_future(runner.finish()) for runner in runners]
        if savings:
            _, late = await asyncio.wait(savings, timeout=self._stop_grace_s)
            for saving in late:
                saving.cancel()
            if late:
                _LOG.warning("%d sites are not saved; what is not is mapped again", len(late))
            await asyncio.gather(*savings, return_exceptions=True)
        await self._views.stop()
        if self._recorder is not None:
            await self._recorder.stop()
        await self._engine.stop()

    def published(self, site_id: int) -> Published:
        """Return the latest view of a site; never waits."""
        site = self._sites.get(site_id)
        here = NOTHING if site is None else site.published
        elsewhere = self._views.get(site_id) or NOTHING
        # After taking over, what the former one published stands until our own map is as far.
        return here if here.rank >= elsewhere.rank else elsewhere

    async def ask(self, site_id: int, question: str, *arguments: object) -> Any:
        """Ask a site's mapper; it may be in the middle of a chunk of scans.

        Raises WorkerDiedError where it is not running, QuestionFailedError where it cannot say.
        """
        asked = self._ask_here if self._mapping or not self._store.shared else self._forwarding.ask
        return await asked(site_id, question, *arguments)

    async def _ask_here(self, site_id: int, question: str, *arguments: object) -> Any:
        site = self._sites.get(site_id)
        if site is None:
            raise WorkerDiedError(None, "the site is not hosted yet", killed=False)
        return await self._engine.ask(site.host(), question, *arguments)

    def subscribe(self, listener: ViewListener) -> None:
        """Have `listener` told of the views that are shown, after they are."""
        self._listeners.append(listener)

    def remaking(self, site_id: int) -> Remaking | None:
        """Return how far the map is that will be shown instead; None where none is made here."""
        site = self._sites.get(site_id)
        return None if site is None else site.remaking

    async def remaking_anywhere(self, record: SiteRecord) -> Remaking | None:
        """Return the same, whichever process makes it: of another's, as far as it is saved."""
        if self._mapping or not self._store.shared:
            return self.remaking(record.id)
        return await remaking_elsewhere(self._store, record)

    async def reached(self, site_id: int, position: int, within_s: float) -> bool:
        """Wait until the published view holds the entry at `position`; False if it takes longer."""
        deadline = asyncio.get_running_loop().time() + within_s
        while self.published(site_id).position < position:
            if asyncio.get_running_loop().time() > deadline:
                return False
            await asyncio.sleep(_LOOK_AGAIN_S)
        return True

    def processed(self, site_id: int) -> int:
        """Return the position that the mapper is known to be through: often beyond the view's."""
        site = self._sites.get(site_id)
        done = 0 if site is None else site.done
        return max(done, self.published(site_id).position)

    def trouble(self, site_id: int) -> str | None:
        """Return why a site is not mapped just now, None where all is well."""
        if not self._mapping:
            return self._nobody_maps()
        site = self._sites.get(site_id)
        return None if site is None else site.trouble

    def skips(self, site_id: int) -> list[Skip]:
        """Return the entries of a site that are not in its map for good."""
        return list(self.published(site_id).skips)

    def not_ready(self) -> list[str]:
        """Return what is missing before scans are mapped and queries answer as before."""
        unseen = [f"the view of site {site} is being loaded" for site in self._views.waiting()]
        if not self._mapping:
            nobody = self._nobody_maps()
            return unseen if nobody is None else [nobody, *unseen]
        if self._was_standby:  # taking over, it goes on answering
            return self._engine.not_ready() + unseen
        found = (s.unfinished(self.published(i).position) for i, s in self._sites.items())
        reasons = [reason for reason in found if reason is not None]
        return self._engine.not_ready() + reasons + unseen

    def _nobody_maps(self) -> str | None:
        if self._beginning:
            return "this process takes over from the one that mapped"
        return self._store.mapper_trouble()

    async def _first_claim(self) -> Claim | None:
        try:
            return await self._store.claim_mapping(wait=False)
        except ClaimedError as error:
            if self._mode == "require":
                raise StoreError(str(error)) from error
            _LOG.warning(
                "%s. This process takes scans, answers, and maps when that one ends", error
            )
            return None

    async def _take_turns(self, claim: Claim | None) -> None:
        """Map whenever no other process does."""
        while True:
            try:
                if claim is None:
                    self._was_standby = True
                    claim = await self._store.claim_mapping(wait=True)
                    _LOG.warning("no other engine has this database: this process maps from now on")
                    self._beginning = True
                    await self._begin()
                await claim.lost.wait()
                _LOG.error("the database has ended our right to map; waiting for the next turn")
            except Exception:  # the database, mostly; without turns nobody would ever map again
                _LOG.exception("this process does not map, trying again")
                await asyncio.sleep(_AGAIN_S)
            claim, self._beginning = None, False
            await self._stand_by()

    async def _stand_by(self) -> None:
        """Map nothing: from now on that is another process's, or this one's again."""
        await self._end_sites()
        self._sites.clear()
        await self._engine.stop()
        if self._recorder is not None:
            self._recorder.release()

    async def _begin(self) -> None:
        await self._engine.start()
        for record in await self._store.sites():
            await self._order(record)
        records = await self._store.sites()
        self._mapping = True
        for record in records:
            if record.id not in self._sites:
                self._sites[record.id] = HostedSite(record, self._means)

    async def _order(self, record: SiteRecord) -> None:
        """Have the log of a site say what its map is made with, as far as it is to be another."""
        try:
            told = None if self._recorder is None else await self._recorder.told_of(record.id)
        except StoreError:  # one damaged site is no reason to map none
            _LOG.exception("site %s: what was told of it cannot be read", record.name)
            return
        ordered = to_order(record, self._base, told)
        if ordered is not None:
            await self._store.write_as_engine(configure, record.name, ordered)

    async def _end_sites(self) -> list[SiteRunner]:
        self._mapping = False
        ended = await asyncio.gather(*(site.end() for site in self._sites.values()))
        return [runner for runners in ended for runner in runners]

    async def forget_site(self, site_id: int) -> None:
        """Stop mapping a site that was deleted."""
        site = self._sites.pop(site_id, None)
        if site is not None:
            await site.forget()
        self._views.forget_site(site_id)
        if self._recorder is not None:
            self._recorder.forget_site(site_id)

    def _on_commit(self, record: SiteRecord) -> None:
        if record.deleted:
            forgetting = asyncio.create_task(self.forget_site(record.id))
            self._forgetting.add(forgetting)
            forgetting.add_done_callback(self._forgetting.discard)
        elif (site := self._sites.get(record.id)) is not None:
            site.on_commit(record)
        elif self._mapping:
            # New: nothing to resume, so it does not keep the service from being ready.
            self._sites[record.id] = HostedSite(record, self._means, new=True)

    def _on_news(self, kind: NewsKind, key: str) -> None:
        if kind == "view" and not self._mapping:
            self._views.fetch(int(key))
        elif kind == "answer":
            self._forwarding.on_answer(key)
        elif kind == "question" and self._mapping:
            self._forwarding.on_question(key)

    def _on_view(self, host: int, position: int, view: SiteView) -> None:
        site_id = site_of(host)
        site = self._sites.get(site_id)
        if site is None or not site.on_view(host, position, view):
            return
        if self._store.shared:
            self._views.save(site_id, site.published)
        for listener in self._listeners:
            listener(site_id, position, view)

    def _on_view_failed(self, host: int, position: int, reason: str) -> None:
        site = self._sites.get(site_of(host))
        if site is not None:
            site.on_view_failed(host, position, reason)

    def _on_death(self, host: int) -> None:
        site = self._sites.get(site_of(host))
        if site is not None:
            site.on_death(host)
