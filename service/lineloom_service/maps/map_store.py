"""The maps of all sites, and what else is made of their views, ready to be sent."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from lineloom import wire
from lineloom_core.io.selection import BBox
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.maps.line_history import LineHistory
from lineloom_service.maps.map_json import write_line, write_map
from lineloom_service.maps.render_cache import RenderCache
from lineloom_service.store.records import SiteRecord


@dataclass(frozen=True, slots=True)
class MapPart:
    """What of a map is asked for. since: a version; only what changed after it."""

    component: str | None = None
    box: BBox | None = None
    since: int | None = None
    since_settled: bool = False
    layers: tuple[str, ...] = wire.USUAL_LAYERS


WHOLE_MAP = MapPart()


class MapStore:
    """Renders views, each form of each version once. limit: bytes kept."""

    def __init__(self, limit: int) -> None:
        self._cache = RenderCache(limit)
        self._histories: dict[int, LineHistory] = {}
        self._asked: dict[int, SiteRecord] = {}
        self._turns: dict[int, asyncio.Lock] = {}
        self._preparing: set[asyncio.Task[bytes]] = set()

    def prepare(self, site_id: int, view: SiteView) -> None:
        """Render a new view where somebody has asked for the one before; never waits.

        Otherwise the first who asks pays for it, and under load that is one in a hundred.
        """
        site = self._asked.pop(site_id, None)
        if site is not None:
            task = asyncio.create_task(self._json(site, view, WHOLE_MAP))
            self._preparing.add(task)
            task.add_done_callback(self._preparing.discard)

    async def json(self, site: SiteRecord, view: SiteView, part: MapPart = WHOLE_MAP) -> bytes:
        """Return the map as JSON, or a part of it."""
        if part == WHOLE_MAP:
            self._asked[site.id] = site
        return await self._json(site, view, part)

    async def _json(self, site: SiteRecord, view: SiteView, part: MapPart) -> bytes:
        history = self._histories.setdefault(site.id, LineHistory(write_line))

        def render() -> bytes:
            chosen = part.component, part.box, part.since, part.since_settled, part.layers
            return write_map(site.name, view, history.at(view), *chosen)

        return await self._cache.get((site.id, view.stage, "json", part), render)

    async def other(
        self,
        site: SiteRecord,
        view: SiteView,
        form: tuple[object, ...],
        render: Callable[[], str | bytes],
        *,
        is_large: bool = False,
    ) -> bytes:
        """Return what `render` makes of the view; `form` names all that tells it from others.

        is_large: it takes much room while it is made: of each site one at a time.
        """
        turn = self._turns.setdefault(site.id, asyncio.Lock()) if is_large else None
        return await self._cache.get((site.id, view.stage, *form), render, turn)

    def forget_site(self, site_id: int) -> None:
        """A site was deleted."""
        self._histories.pop(site_id, None)
        self._asked.pop(site_id, None)
        self._turns.pop(site_id, None)
