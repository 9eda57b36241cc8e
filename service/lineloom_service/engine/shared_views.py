"""Published views on their way between processes that share a database."""

from __future__ import annotations

import asyncio
import logging
import time

from lineloom_service.engine.published import Published
from lineloom_service.engine.view_record import ViewReader, ViewWriter
from lineloom_service.store.actions import save_view
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_view
from lineloom_service.store.records import StoreError

_LOG = logging.getLogger(__name__)

_SAVING_SHARE = 0.1
"""At most this share of the time goes into saving views of a site."""

_AGAIN_S = 1.0


class SharedViews:
    """Saves what is published here, takes in what is published elsewhere. Latest wins."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._views: dict[int, Published] = {}
        self._readers: dict[int, ViewReader] = {}
        self._writers: dict[int, ViewWriter] = {}
        self._to_save: dict[int, Published] = {}
        self._wanted: set[int] = set()
        self._tasks: dict[tuple[str, int], asyncio.Task[None]] = {}

    def get(self, site_id: int) -> Published | None:
        """Return the latest view that came from elsewhere."""
        return self._views.get(site_id)

    def waiting(self) -> list[int]:
        """Return the sites of which a view is known to be there, and not yet here."""
        return [site for site in self._wanted if site not in self._views]

    def save(self, site_id: int, published: Published) -> None:
        """Let the others have a view; never waits."""
        self._to_save[site_id] = published
        self._run("save", site_id)

    def fetch(self, site_id: int) -> None:
        """There may be a new view elsewhere."""
        self._wanted.add(site_id)
        self._run("fetch", site_id)

    async def load(self, site_id: int) -> Published | None:
        """Return the view that was saved last, by whatever code; None where none can be read."""
        record = await self._store.read(read_view, site_id, 0)
        try:
            return None if record is None else await asyncio.to_thread(ViewReader().read, record)
        except ValueError as error:
            _LOG.warning("site %d: %s", site_id, error)
            return None

    def forget_site(self, site_id: int) -> None:
        """A site was deleted."""
        for kind in ("save", "fetch"):
            task = self._tasks.pop((kind, site_id), None)
            if task is not None:
                task.cancel()
        self._views.pop(site_id, None)
        self._readers.pop(site_id, None)
        self._writers.pop(site_id, None)
        self._to_save.pop(site_id, None)
        self._wanted.discard(site_id)

    async def stop(self) -> None:
        """Save what waits, if the store takes it."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        for site_id, published in list(self._to_save.items()):
            try:
                # Whole: a thread that was given up may still be at it with the site's own writer.
                record = await asyncio.to_thread(ViewWriter().write, published)
                await self._store.write_apart_as_engine(save_view, site_id, record)
            except StoreError:
                _LOG.warning("the last view of site %d is not shared", site_id)
        self._to_save.clear()

    def _run(self, kind: str, site_id: int) -> None:
        task = self._tasks.get((kind, site_id))
        if task is None or task.done():
            work = self._save(site_id) if kind == "save" else self._fetch(site_id)
            self._tasks[kind, site_id] = asyncio.create_task(work)

    async def _save(self, site_id: int) -> None:
        while (published := self._to_save.pop(site_id, None)) is not None:
            begin = time.monotonic()
            try:
                writer = self._writers.setdefault(site_id, ViewWriter())
                record = await asyncio.to_thread(writer.write, published)
                await self._store.write_apart_as_engine(save_view, site_id, record)
            except StoreError as error:
                _LOG.warning("site %d: a view is not shared: %s", site_id, error)
                self._to_save.setdefault(site_id, published)
                await asyncio.sleep(_AGAIN_S)
            except asyncio.CancelledError:
                self._to_save.setdefault(site_id, published)
                raise
            else:
                await asyncio.sleep((time.monotonic() - begin) * (1 / _SAVING_SHARE - 1))

    async def _fetch(self, site_id: int) -> None:
        while site_id in self._wanted:
            self._wanted.discard(site_id)
            known = self._views.get(site_id)
            try:
                from_on = 0 if known is None else known.position
                record = await self._store.read(read_view, site_id, from_on)
                if record is not None:
                    reader = self._readers.setdefault(site_id, ViewReader())
                    found = await asyncio.to_thread(reader.read, record)
                    # One that was made anew may be no further than the one that it replaces.
                    if known is None or _order(found) > _order(known):
                        self._views[site_id] = found
            except StoreError:
                self._wanted.add(site_id)
                await asyncio.sleep(_AGAIN_S)
            except ValueError as error:  # damaged, or of another version of the service
                _LOG.warning("site %d: %s; the view before stands", site_id, error)


def _order(published: Published) -> tuple[tuple[int, bool], int]:
    return published.rank, published.view.version
